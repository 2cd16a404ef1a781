"""Makes the assets of the viewer's tests, and what the reference reader reads of them.

    python make_assets.py FOLDER

Each NAME.umbel gets a NAME.json: its tables, some of its groups decoded, and the library's cuts.
Arrays are base64 of their little-endian bytes.
"""

import base64
import json
import os
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tests" / "python"))

from make_textured import make_textured  # noqa: E402

import umbel  # noqa: E402
from helpers.meshes import decorated_blob  # noqa: E402
from helpers.reference_reader import Reader  # noqa: E402

DATA = Path(os.environ.get("UMBEL_DATA") or ROOT.parent / "shared" / "data")
#: The attributes that the viewer reads; it skips joints, weights and further texture coordinates.
SHOWN = ("triangles", "positions", "normals", "tangents", "uvs", "colors")
REAL = ["Fox.glb", "cad_gears_19k.ply", "gargo_50k_normals_colors.ply"]


def encoded(values: Any, kind: str) -> str:
    """Base64 of an array."""
    return base64.b64encode(np.ascontiguousarray(values, kind).tobytes()).decode()


def views(asset: umbel.Asset) -> list[dict[str, Any]]:
    """Cuts of an asset, half by error, half by camera, and each level."""
    made = []
    errors = asset.tables.groups["error"]
    finite = errors[np.isfinite(errors)]
    for error in [0.0, *np.quantile(finite, [0.1, 0.5, 0.9]).tolist(), 1e30] if len(finite) else []:
        made.append({"kind": "error", "error": error, "cut": asset.cut(error=error)})
    for level in range(len(asset.tables.levels)):
        made.append({"kind": "level", "level": level, "cut": asset.cut(level=level)})
    bounds = asset.info["bounds"]
    if bounds:
        low, high = np.array(bounds)
        size = float(np.linalg.norm(high - low))
        rng = np.random.default_rng(7)
        for _ in range(24):
            eye = (low + high) / 2 + rng.normal(size=3) * size * rng.choice([0.2, 0.6, 2.0, 50.0])
            fov, height = float(rng.uniform(0.3, 1.5)), int(rng.integers(200, 2000))
            pixels = float(rng.choice([0.1, 1.0, 4.0, 32.0]))
            camera = umbel.Camera(
                position=tuple(eye.tolist()), fov_y=fov, height=height, pixel_error=pixels
            )
            view = {"eye": eye.tolist(), "fov_y": fov, "height": height, "pixel_error": pixels}
            made.append({"kind": "camera", **view, "cut": asset.cut(camera=camera)})
    for view in made:
        view["cut"] = encoded(view["cut"], "<u4")
    return made


def dump(path: Path) -> None:
    """Writes the JSON beside an asset."""
    reader, asset = Reader(path), umbel.Asset(path)
    count = len(reader.pages)
    pages = {}
    for page in sorted({0, count // 2, count - 1}) if count else []:
        pages[page] = [
            {
                "group": number,
                "mesh": group.mesh,
                "first_cluster": group.first_cluster,
                "level": group.level,
                "method": group.method,
                "parents": group.parents,
                "sphere": encoded([*group.sphere, group.error], "<f4"),
                "references": [row[:3] for row in group.references],
                "made_from": group.made_from,
                "materials": group.materials,
                "boxes": encoded(group.boxes, "<f4"),
                "clusters": [
                    {
                        name: encoded(value, "<u4" if name == "triangles" else "<f4")
                        for name, value in cluster.items()
                        if name in SHOWN
                    }
                    for cluster in group.clusters
                ],
            }
            for (_, number), group in reader.page(page).items()
        ]
    tables = asset.tables
    expected = {
        "levels": [list(level) for level in reader.levels],
        "source_triangles": reader.meshes[0][0] if reader.meshes else 0,
        "groups": len(tables.groups),
        "triangles": encoded(tables.clusters["triangle_count"], "<u4"),
        "pages": pages,
        "views": views(asset),
    }
    path.with_suffix(".json").write_text(json.dumps(expected), encoding="utf-8")


def make_forest(folder: Path) -> None:
    """An asset with a tree of instances, and what the library selects from it."""
    rng = np.random.default_rng(3)
    count, side = 70_000, 265
    matrices = np.zeros((count + 1, 3, 4), np.float32)
    angle, scale = rng.uniform(0, 6.3, count), rng.uniform(0.5, 1.5, (count, 3))
    for axis in range(3):
        matrices[:count, axis, axis] = scale[:, axis]
    matrices[:count, 0, 0] *= np.cos(angle)
    matrices[:count, 2, 0] = -scale[:, 0] * np.sin(angle)
    matrices[:count, 0, 2] = scale[:, 2] * np.sin(angle)
    matrices[:count, 2, 2] *= np.cos(angle)
    places = np.stack([np.arange(count) % side, np.arange(count) // side], 1) * 3.0
    matrices[:count, ::2, 3] = places + rng.uniform(-1, 1, (count, 2))
    matrices[count] = np.eye(4)[:3]
    ground = umbel.shapes.grid(64, 64)
    ground.positions = 3 * side * ground.positions[:, [1, 2, 0]] - np.float32([0, 1, 0])
    meshes = rng.integers(0, 2, count + 1)
    meshes[count] = 2
    lods = [
        umbel.build_lod(mesh, max_triangles=64)
        for mesh in (umbel.shapes.blob(5, seed=1), umbel.shapes.blob(4, seed=2), ground)
    ]
    path = folder / "forest.umbel"
    umbel.save_asset(path, lods, umbel.Placements(matrices, meshes))
    asset = umbel.Asset(path)
    steps = []
    for eye, target, pixels in (
        ((400.0, 3.0, 400.0), (500.0, 0.0, 420.0), 1.0),
        ((400.0, 3.0, 400.0), (300.0, 0.0, 300.0), 4.0),
        ((30.5, 40.0, 700.0), (400.0, 0.0, 400.0), 2.0),
        ((400.0, 600.0, -500.0), (400.0, 0.0, 400.0), 2.0),
        ((400.0, 6000.0, -5000.0), (400.0, 0.0, 400.0), 1.0),
    ):
        camera = umbel.Camera(eye, target, height=600, pixel_error=pixels)
        selector = umbel.InstanceSelector(asset)
        first = selector.step(camera, aspect=1.5)
        last = selector.settle(camera, aspect=1.5)
        steps.append(
            {
                "eye": eye,
                "fov_y": camera.fov_y,
                "height": 600,
                "pixel_error": pixels,
                "planes": camera.planes(1.5).astype(float).ravel().tolist(),
                "missing": np.asarray(first.missing).tolist(),
                "runs": np.asarray(last.runs).astype(int).ravel().tolist(),
                "shown": int(last.shown),
                "stand_ins": int(last.stand_ins),
            }
        )
    (folder / "forest.steps.json").write_text(json.dumps(steps), encoding="utf-8")


def main() -> None:
    """Makes them all."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    blob = decorated_blob(4)
    for precision in (None, "16bits", "8bits"):
        for exact in (False, True):
            name = f"blob_{precision or 'float'}_{'exact' if exact else 'compact'}.umbel"
            lod = umbel.build_lod(blob, max_triangles=64, precision=precision)
            lod.save(folder / name, exact=exact)
            dump(folder / name)
    empty = umbel.Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    umbel.build_lod(empty).save(folder / "empty.umbel")
    dump(folder / "empty.umbel")
    # For the browser: deep enough that a camera matters.
    big = umbel.shapes.blob(7, seed=5)
    umbel.build_lod(big, precision="16bits").save(folder / "planet.umbel")
    dump(folder / "planet.umbel")
    # One shape in several sizes, without normals and with them.
    shape = umbel.shapes.blob(4, seed=5)
    directions = shape.positions / np.linalg.norm(shape.positions, axis=1, keepdims=True)
    for exponent in (-30, -21, -3, 0, 15):
        positions = (shape.positions.astype(np.float64) * 10.0**exponent).astype(np.float32)
        for kind, normals in (("flat", None), ("smooth", directions)):
            sized = umbel.Mesh(positions, shape.triangles, normals=normals)
            umbel.build_lod(sized).save(folder / f"{kind}_1e{exponent}.umbel")
    # Coarse triangles that stick out of the source.
    random = np.random.default_rng(1)
    corners = random.random((2000, 1, 3)) + 0.05 * random.normal(size=(2000, 3, 3))
    corners = corners.astype(np.float32).reshape(-1, 3)
    numbers = np.arange(6000, dtype=np.uint32).reshape(-1, 3)
    umbel.build_lod((corners, numbers), max_triangles=32).save(folder / "scattered.umbel")
    # More than 4096 pages, so that their table is read in slices.
    umbel.build_lod(umbel.shapes.blob(8, seed=5), max_triangles=8).save(
        folder / "paged.umbel", page_bytes=4096
    )
    shutil.rmtree(folder / "planet_tiles", ignore_errors=True)
    umbel.export_tiles(folder / "planet.umbel", folder / "planet_tiles", tile_triangles=8192)
    make_textured(folder)
    make_forest(folder)
    for path in (ROOT / "tests" / "vectors").glob("format*/*.umbel"):
        copy = folder / f"{path.parent.name}_{path.name}"
        shutil.copyfile(path, copy)
        dump(copy)
    for name in REAL:
        if (DATA / name).is_file():
            out = folder / f"{Path(name).stem}.umbel"
            umbel.build_lod(DATA / name, precision="16bits").save(out)
            dump(out)


if __name__ == "__main__":
    main()
