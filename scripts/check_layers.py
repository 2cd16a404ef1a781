"""Checks that each folder of src/ includes only what stands above it.

A folder may use itself, the folders before it in LAYERS, and their public headers. Folders within
folders have places of their own.
"""

import re
import sys
from pathlib import Path

LAYERS = [
    "base",
    "base/simd",
    "mesh",
    "io",
    "io/source",
    "query",
    "cluster",
    "cluster/bisect",
    "cluster/meshlet",
    "cluster/frame",
    "bvh/tree",
    "bvh/optimize",
    "bvh/build",
    "bvh/wide",
    "bvh/compressed",
    "bvh/two_level",
    "kdtree",
    "uniform",
    "lod/dag",
    "lod/simplify/collapse",
    "lod/simplify",
    "lod/build",
    "lod/select",
    "lod/verify",
    "asset/codec",
    "asset/instances",
    "asset/file",
    "scale",
    "stream",
    "trace",
    "cuda",
    "capi",
    "capi/cuda",
]

# The first folder that may use each public header.
HEADER_LAYERS = {
    "types.hpp": "base",
    "version.hpp": "base",
    "mesh.hpp": "mesh",
    "mesh_buffers.hpp": "mesh",
    "triangle_source.hpp": "io/source",
    "scale.hpp": "scale",
    "triangle_queries.hpp": "query",
    "ray_arrays.hpp": "query",
    "cluster.hpp": "cluster",
    "frame_clusters.hpp": "cluster/frame",
    "cuda_types.hpp": "cluster/frame",
    "cuda_clusters.hpp": "cuda",
    "cuda.hpp": "cuda",
    "cuda_memory.hpp": "cuda",
    "bvh.hpp": "bvh/tree",
    "bvh_traverse.hpp": "bvh/tree",
    "dynamic_bvh.hpp": "bvh/build",
    "bvh_presets.hpp": "bvh/build",
    "triangle_bvh.hpp": "bvh/wide",
    "collision.hpp": "bvh/wide",
    "compact_bvh.hpp": "bvh/compressed",
    "cuda_bvh.hpp": "bvh/compressed",
    "cuda_cluster_bvh.hpp": "cuda",
    "cuda_trace.hpp": "bvh/compressed",
    "kdtree.hpp": "kdtree",
    "kdtree_traverse.hpp": "kdtree",
    "uniform.hpp": "uniform",
    "camera.hpp": "lod/select",
    "lod/types.hpp": "lod/dag",
    "lod/build.hpp": "lod/dag",
    "lod/select.hpp": "lod/select",
    "lod/verify.hpp": "lod/verify",
    "lod.hpp": "lod/verify",
    "cuda_select.hpp": "lod/select",
    "asset.hpp": "asset/codec",
    "instance_tree.hpp": "stream",
    "stream.hpp": "stream",
    "trace_material.hpp": "trace",
    "trace.hpp": "trace",
    "umbel.h": "capi",
    "umbel_base.h": "capi",
    "umbel_cluster.h": "capi",
    "umbel_frame_clusters.h": "capi",
    "umbel_bvh.h": "capi",
    "umbel_dynamic_bvh.h": "capi",
    "umbel_kdtree.h": "capi",
    "umbel_uniform.h": "capi",
    "umbel_lod.h": "capi",
    "umbel_lod_build.h": "capi",
    "umbel_lod_select.h": "capi",
    "umbel_asset.h": "capi",
    "umbel_instance_tree.h": "capi",
    "umbel_cuda.h": "capi",
    "umbel_cuda_types.h": "capi",
    "umbel_cuda_clusters.h": "capi",
    "umbel_cuda_bvh.h": "capi",
    "umbel_cuda_cluster_bvh.h": "capi",
    "umbel_cuda_select.h": "capi",
    "umbel_cuda_trace.h": "capi",
    "umbel_cuda_memory.h": "capi",
}

INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^">]+)[">]', re.MULTILINE)


def layer_of_header(header: str) -> str | None:
    """The layer of a public header, `None` for umbel.hpp, which stands for all of them."""
    if header == "umbel.hpp":
        return None
    return HEADER_LAYERS.get(header, header)


def layer_of_include(include: str) -> str | None:
    """The layer that an include leads to; `None` if it does not lead into Umbel."""
    first, _, rest = include.partition("/")
    if first == "umbel":
        # umbel.hpp reaches everything, so only what may use everything can include it.
        return layer_of_header(rest) or LAYERS[-1]
    if not any(layer.partition("/")[0] == first for layer in LAYERS):
        return None
    return include.rpartition("/")[0]


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
            problems += problems_of(path, str(path.parent.relative_to(root / "src")), root)
    for path in sorted((root / "include" / "umbel").rglob("*.h*")):
        layer = layer_of_header(str(path.relative_to(root / "include" / "umbel")))
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
