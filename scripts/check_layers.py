"""Checks that each folder of src/ includes only what stands above it.

The order is the design's: a folder may use itself, the folders before it in LAYERS, and the
public headers of those.
"""

import re
import sys
from pathlib import Path

LAYERS = [
    "base",
    "mesh",
    "io",
    "cluster",
    "bvh",
    "kdtree",
    "uniform",
    "lod",
    "asset",
    "stream",
    "trace",
    "cuda",
    "capi",
]

# Public headers that are not named after a folder.
HEADER_LAYERS = {
    "types.hpp": "base",
    "version.hpp": "base",
    "frame_clusters.hpp": "cluster",
    "triangle_bvh.hpp": "bvh",
    "triangle_queries.hpp": "bvh",
    "bvh_presets.hpp": "bvh",
    "bvh_traverse.hpp": "bvh",
    "compact_bvh.hpp": "bvh",
    "cuda_bvh.hpp": "cuda",
    "ray_arrays.hpp": "bvh",
    "lod_select.hpp": "lod",
    "umbel_lod.h": "capi",
    "umbel_kdtree.h": "capi",
    "umbel_kary.h": "capi",
    "umbel.h": "capi",
    "umbel_cuda.h": "capi",
    "umbel_cuda_select.h": "capi",
    "umbel_cuda_trace.h": "capi",
    "cuda_select.hpp": "cuda",
    "cuda_trace.hpp": "cuda",
    "trace_material.hpp": "trace",
}

INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^">]+)[">]', re.MULTILINE)


def layer_of_header(header: str) -> str | None:
    """The layer of a public header, `None` for umbel.hpp, which stands for all of them."""
    if header == "umbel.hpp":
        return None
    return HEADER_LAYERS.get(header, Path(header).stem)


def layer_of_include(include: str) -> str | None:
    """The layer that an include leads to; `None` if it does not lead into Umbel."""
    first, _, rest = include.partition("/")
    if first == "umbel":
        # umbel.hpp reaches everything, so only what may use everything can include it.
        return layer_of_header(rest) or LAYERS[-1]
    return first if first in LAYERS else None


def problems_of(path: Path, layer: str, root: Path) -> list[str]:
    """What is wrong with one file's includes, as messages that an editor can jump to."""
    if layer not in LAYERS:
        return [f"{path.relative_to(root)}: `{layer}` is no layer: give it its place in LAYERS"]
    text = path.read_text(encoding="utf-8")
    found = []
    for match in INCLUDE.finditer(text):
        used = layer_of_include(match[1])
        if used is not None and used not in LAYERS:
            found.append((match, f"`{match[1]}` belongs to no layer"))
        elif used is not None and LAYERS.index(used) > LAYERS.index(layer):
            found.append((match, f"`{layer}` may not use `{used}` ({match[1]})"))
    return [
        f"{path.relative_to(root)}:{text.count(chr(10), 0, match.start(1)) + 1}: {message}"
        for match, message in found
    ]


def check(root: Path) -> list[str]:
    """The problems of a whole source tree."""
    problems = []
    for path in sorted((root / "src").rglob("*")):
        if path.suffix in {".hpp", ".cpp", ".cuh", ".cu"}:
            problems += problems_of(path, path.relative_to(root / "src").parts[0], root)
    for path in sorted((root / "include" / "umbel").glob("*.h*")):
        layer = layer_of_header(path.name)
        if layer is not None:
            problems += problems_of(path, layer, root)
    return problems


def main() -> int:
    """Prints the problems; the exit status is 1 if there are any."""
    problems = check(Path(__file__).resolve().parent.parent)
    for problem in problems:
        print(problem)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
