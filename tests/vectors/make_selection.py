"""Writes selection.json: what every implementation of selection must answer, in any language.

    .venv/bin/python tests/vectors/make_selection.py

README.md beside it says how to read the file; docs/selection.md is the arithmetic. Run it only
when the arithmetic is meant to change: tests compare the library with the file as it is.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

import umbel
from umbel import _umbel, shapes

HERE = Path(__file__).parent


def number(value: Any) -> Any:
    """A float32 with as many digits as tell it from all others; null for infinity."""
    if isinstance(value, (np.floating, float)):
        return None if np.isinf(value) else float(f"{float(value):.9g}")
    return int(value)


def flat(row: Any) -> list[Any]:
    values: list[Any] = []
    for field in row.dtype.names:
        values += [number(v) for v in np.atleast_1d(row[field])]
    return values


def tables_of(lod: umbel.Lod) -> dict[str, Any]:
    return {
        "levels": [flat(row) for row in lod.levels],
        "groups": [flat(row) for row in lod.groups],
        "clusters": [flat(row) for row in lod.clusters],
        "nodes": [flat(row) for row in lod.nodes],
        "facing": [[number(v) for v in row] for row in lod.normal_cones().rows()],
    }


def view_of(view: _umbel.View) -> dict[str, Any]:
    if view.kind == "error":
        return {"kind": "error", "error": number(view.error)}
    if view.kind == "level":
        return {"kind": "level", "level": view.level}
    eye = [number(v) for v in view.eye]
    return {"kind": "camera", "eye": eye, "threshold": number(view.threshold)}


def random_camera(random: np.random.Generator, center: Any, size: float) -> umbel.Camera:
    far = size * np.exp(random.uniform(np.log(0.3), np.log(30)))
    direction = random.normal(size=3)
    eye = center + far * direction / np.linalg.norm(direction)
    return umbel.Camera(
        [float(np.float32(v)) for v in eye],
        target=[float(v) for v in center + random.normal(size=3) * size * 0.3],
        fov_y=float(np.float32(random.uniform(0.2, 2))),
        height=int(random.integers(100, 2000)),
        pixel_error=float(np.float32(np.exp(random.uniform(-2, 4)))),
    )


def make(seed: int = 1) -> dict[str, Any]:
    # Long: one stream of random numbers decides all cases, in this order.
    random = np.random.default_rng(seed)
    small = {"max_triangles": 32, "max_vertices": 64, "group_size": (4, 8)}
    lods: dict[str, umbel.Lod] = {}
    for name, scale, shift in (("blob", 1.0, 0.0), ("far", 3.0, 4096.0), ("tiny", 2.0**-100, 0.0)):
        blob = shapes.blob(4 if name == "blob" else 3, 7)
        positions = (blob.positions * np.float32(scale) + np.float32(shift)).astype(np.float32)
        lods[name] = umbel.build_lod((positions, blob.triangles), **small)

    out: dict[str, Any] = {
        "about": "Selection of levels of detail; README.md beside this file says how to read it.",
        "tables": {name: tables_of(lod) for name, lod in lods.items()},
        "cameras": [],
        "cuts": [],
        "budgets": [],
        "instances": [],
    }
    for name, lod in lods.items():
        low, high = lod.groups["center"].min(axis=0), lod.groups["center"].max(axis=0)
        center = (low.astype(float) + high) / 2
        size = float(lod.groups["radius"].max())
        tables = lod.tables
        facing = lod.normal_cones()
        for i in range(24):
            camera = random_camera(random, center, size)
            planes = camera.planes(random.uniform(0.5, 2)) if i % 3 else None
            culled = facing if i % 2 and i % 3 else None
            wish: dict[str, Any] = {"camera": camera}
            if i % 8 == 6:
                wish = {"error": float(np.float32(size * np.exp(random.uniform(-9, -1))))}
                culled = None
            if i % 8 == 7:
                wish, culled = {"level": int(random.integers(0, 8))}, None
            cut = tables.cut(**wish, planes=planes, normal_cones=culled, method="flat")
            out["cuts"].append(
                {
                    "tables": name,
                    "view": view_of(tables.view(**wish)),
                    "planes": [] if planes is None else [[number(v) for v in p] for p in planes],
                    "facing": culled is not None,
                    "cut": cut.tolist(),
                }
            )
            if "level" in wish:
                continue
            out["budgets"].append(budget_case(random, name, tables, wish, planes, culled, i))
        out["cuts"] += tight_cases(random, name, tables, center, size)
    for _ in range(20):
        camera = random_camera(random, np.zeros(3), 1.0)
        out["cameras"].append(
            {
                "eye": [number(v) for v in camera.position],
                "fov_y": number(camera.fov_y),
                "height": camera.height,
                "pixel_error": number(camera.pixel_error),
                "threshold": number(camera.view().threshold),
            }
        )
        transform = random.normal(size=(1, 12)).astype(np.float32)
        view = camera.view() if len(out["instances"]) % 4 else _umbel.view_error(0.25)
        out["instances"].append(
            {
                "transform": [number(v) for v in transform[0]],
                "view": view_of(view),
                "object": view_of(_umbel.view_in_instance(view, transform)),
            }
        )
    return out


def budget_case(
    random: np.random.Generator,
    name: str,
    tables: umbel.Tables,
    wish: dict[str, Any],
    planes: Any,
    facing: Any,
    i: int,
) -> dict[str, Any]:
    costs = tables.clusters["triangle_count"].astype(np.int64)
    kind = {"triangles": 0}
    if i % 2:
        costs = 3 * costs + 20 * tables.clusters["vertex_count"].astype(np.int64)
        kind = {"bytes": 0}
    all_of_it = int(costs[tables.cut(**wish, planes=planes, normal_cones=facing)].sum())
    budget = int(all_of_it * random.uniform(0.05, 1.05))
    (which,) = kind
    view = tables.view(
        **wish, **{which: budget}, vertex_bytes=20, planes=planes, normal_cones=facing
    )
    return {
        "tables": name,
        "view": view_of(tables.view(**wish)),
        "planes": [] if planes is None else [[number(v) for v in p] for p in planes],
        "facing": facing is not None,
        "costs": which,
        "vertex_bytes": 20,
        "triangle_bytes": 3,
        "budget": budget,
        "result": view_of(view),
    }


def tight_cases(
    random: np.random.Generator, name: str, tables: umbel.Tables, center: Any, size: float
) -> list[dict[str, Any]]:
    """Cuts at thresholds where the answer of some group turns over, and at the floats below."""
    cases = []
    for _ in range(8):
        camera = random_camera(random, center, size)
        view = tables.view(camera=camera, triangles=int(random.integers(1, 1000)))
        for threshold in (view.threshold, np.nextafter(np.float32(view.threshold), np.float32(0))):
            view.threshold = float(threshold)
            cut = _umbel.select(tables._native, view, "flat")
            cases.append(
                {
                    "tables": name,
                    "view": view_of(view),
                    "planes": [],
                    "facing": False,
                    "cut": cut.tolist(),
                }
            )
    return cases


def text(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"))


def main() -> None:
    made = make()
    lines = ",\n".join(
        f'"{key}": '
        + (
            text(value)
            if isinstance(value, str)
            else "{\n" + ",\n".join(f'"{k}": {text(v)}' for k, v in value.items()) + "\n}"
            if isinstance(value, dict)
            else "[\n" + ",\n".join(text(v) for v in value) + "\n]"
        )
        for key, value in made.items()
    )
    (HERE / "selection.json").write_text("{\n" + lines + "\n}\n")


if __name__ == "__main__":
    main()
