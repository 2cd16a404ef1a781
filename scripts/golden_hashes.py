"""Hashes of what the library makes of meshes, to show that a change leaves every byte as it was.

    .venv/bin/python scripts/golden_hashes.py FOLDER -o before.json
    ... change, rebuild ...
    .venv/bin/python scripts/golden_hashes.py FOLDER -o after.json --compare before.json

Each mesh file of the folder is read, clustered, built into trees, traced and built into levels of
detail, on one thread and on two; both must give the same bytes, which is checked here as well. A
mesh that is refused is golden too.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import umbel

MESHES = (".glb", ".gltf", ".obj", ".ply", ".stl")
BUILDERS = ("sweep", "binned", "sbvh", "lbvh", "hlbvh", "kmeans", "ploc", "atrbvh")
SLOW = ("agglomerative", "aac", "insertion")
SLOW_TRIANGLES, KD_TRIANGLES = 50_000, 400_000
RAYS = 4096


def digest(*parts: Any) -> str:
    """A short hash of arrays, bytes and text."""
    out = hashlib.sha256()
    for part in parts:
        if isinstance(part, str):
            part = part.encode()
        data = part if isinstance(part, bytes) else np.ascontiguousarray(part).tobytes()
        out.update(len(data).to_bytes(8, "little") + data)
    return out.hexdigest()[:16]


def rays_around(mesh: umbel.Mesh) -> tuple[Any, Any]:
    """Rays through the mesh's box, the same for the same mesh."""
    low, high = np.asarray(mesh.bounds, np.float64)
    random = np.random.default_rng(1)
    size = max(float((high - low).max()), 1e-30)
    origins = (low + high) / 2 + size * random.standard_normal((RAYS, 3))
    targets = low + (high - low) * random.random((RAYS, 3))
    return origins.astype(np.float32), (targets - origins).astype(np.float32)


def hits_of(structure: Any, rays: tuple[Any, Any], threads: int) -> str:
    """Nearest hits and occlusion of the rays."""
    hits = structure.intersect(*rays, threads=threads)
    blocked = structure.occluded(*rays, threads=threads)
    return digest(hits.t, hits.primitive, hits.u, hits.v, blocked)


def tables_of(lod: umbel.Lod) -> str:
    """All tables of the levels, and the geometry of the finest."""
    tables = lod.tables
    mesh = lod.mesh(lod.cut(level=0))
    names = (mesh.positions, mesh.triangles)
    return digest(tables.levels, tables.groups, tables.clusters, tables.nodes, *names)


def pages_of(asset: umbel.Asset, path: Path) -> str:
    """The file behind its head: pages, nodes and embedded files."""
    return digest(path.read_bytes()[asset.info["header_bytes"] :])


def saved(make: Callable[[Path], Any], suffix: str) -> bytes:
    """The bytes of a file that `make` writes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"file{suffix}"
        make(path)
        return path.read_bytes()


def asset_of(lod: umbel.Lod, **options: Any) -> str:
    """The asset's pages."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "file.umbel"
        lod.save(path, textures="none", **options)
        return pages_of(umbel.Asset(path), path)


Job = tuple[str, Callable[[], str]]


def tree_jobs(mesh: umbel.Mesh, threads: int) -> Iterator[Job]:
    """Bounding volume hierarchies by every builder, their layouts and hits; kd-trees."""
    rays = rays_around(mesh)
    slow = SLOW if len(mesh.triangles) <= SLOW_TRIANGLES else ()
    for builder in (*BUILDERS, *slow):

        def tree(builder: str = builder) -> str:
            made = umbel.build_bvh2(mesh, builder=builder, threads=threads)
            return digest(made.nodes, made.primitives)

        yield f"bvh2 {builder}", tree
    for builder, width in (("quality", 8), ("best", 8), ("binned", 4), ("lbvh", 2)):

        def traced(builder: str = builder, width: int = width) -> str:
            made = umbel.Bvh(mesh, builder=builder, width=width, threads=threads)
            return digest(saved(made.save, ".umbvh"), hits_of(made, rays, threads))

        yield f"bvh {builder} {width}", traced
    if len(mesh.triangles) <= KD_TRIANGLES:

        def kdtree() -> str:
            made = umbel.KdTree(mesh, ropes=True, threads=threads)
            return digest(saved(made.save, ".umkd"), hits_of(made, rays, threads))

        yield "kdtree", kdtree


def cluster_jobs(mesh: umbel.Mesh, threads: int) -> Iterator[Job]:
    """Clusters of every kind."""
    ways: dict[str, dict[str, Any]] = {
        "quality": {"preset": "quality"},
        "fast": {"preset": "fast"},
        "vertices": {"max_triangles": 124, "max_vertices": 64},
        "morton": {"method": "morton"},
    }
    for name, options in ways.items():

        def clusters(options: dict[str, Any] = options) -> str:
            made = umbel.cluster_mesh(mesh, threads=threads, **options)
            return digest(made.items, made.offsets)

        yield f"clusters {name}", clusters


def lod_jobs(mesh: umbel.Mesh, threads: int) -> Iterator[Job]:
    """Levels of detail, exact and on a grid, and their assets."""
    for name, precision in (("exact", None), ("16bits", "16bits")):

        def built(precision: str | None = precision) -> str:
            lod = umbel.build_lod(mesh, precision=precision, threads=threads)
            return digest(tables_of(lod), asset_of(lod, threads=threads))

        yield f"lod {name}", built


def answer(job: Callable[[], str]) -> str:
    """A job's hash, or that it was refused. Sentences may change; an error that is none of the
    library's own shows by its name."""
    try:
        return job()
    except umbel.Error:
        return "refused"
    except (ArithmeticError, LookupError, TypeError, ValueError) as error:
        return f"failed: {type(error).__name__}"


def hashes_of(path: Path, threads: int) -> dict[str, str]:
    """All hashes of one mesh."""
    try:
        mesh = umbel.load(path)
    except umbel.Error:
        return {"load": "refused"}
    names = ("normals", "tangents", "uvs", "colors", "material_ids")
    given = [a for a in (getattr(mesh, name) for name in names) if a is not None]
    out = {"load": digest(mesh.positions, mesh.triangles, *given)}
    jobs = [*cluster_jobs(mesh, threads), *lod_jobs(mesh, threads)]
    if mesh.bounds is not None and np.isfinite(mesh.bounds).all():
        jobs += tree_jobs(mesh, threads)
    return out | {name: answer(job) for name, job in jobs}


def main() -> int:
    """Hashes all meshes; the exit status is 1 if threads or the file to compare with differ."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--compare", type=Path, help="hashes from before")
    parser.add_argument("--threads", default="1,2", help="numbers of threads, all to agree")
    parser.add_argument("--match", default="*", help="which files: a pattern")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    counts = [int(text) for text in arguments.threads.split(",")]
    found: dict[str, dict[str, str]] = {}
    differences = 0
    for path in sorted(arguments.folder.glob(arguments.match)):
        if path.suffix not in MESHES:
            continue
        first, *others = [hashes_of(path, threads) for threads in counts]
        found[path.name] = first
        for name in first:
            if any(other[name] != first[name] for other in others):
                print(f"{path.name}: {name} depends on the threads")
                differences += 1
        print(f"{path.name}: {len(first)} hashes", file=sys.stderr, flush=True)
        arguments.output.write_text(json.dumps(found, indent=1, sort_keys=True) + "\n")
    before = json.loads(arguments.compare.read_text()) if arguments.compare else {}
    for mesh, names in found.items():
        for name, value in names.items():
            old = before.get(mesh, {}).get(name, value)
            if old != value:
                print(f"{mesh}: {name} was {old} and is {value}")
                differences += 1
    total = sum(len(names) for names in found.values())
    print(f"{total} hashes of {len(found)} meshes on {arguments.threads} threads: ", end="")
    print(f"{differences} differences")
    return 1 if differences else 0


if __name__ == "__main__":
    sys.exit(main())
