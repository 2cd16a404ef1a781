"""Cuts, culling, instances and budgets: the library against the shared vectors, and both against
an implementation that shares no code with it."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

import umbel
from helpers.commands import ROOT
from helpers.reference_select import Selector
from umbel import _umbel
from umbel.lod.tables import CLUSTER, GROUP, LEVEL, NODE, Tables

VECTORS = json.loads((ROOT / "tests" / "vectors" / "selection.json").read_text())


def structured(rows: list[list[Any]], dtype: np.dtype[Any]) -> np.ndarray[Any, Any]:
    out = np.zeros(len(rows), dtype)
    columns = list(zip(*[[math.inf if v is None else v for v in row] for row in rows], strict=True))
    at = 0
    for name in dtype.names or ():
        width = dtype[name].shape[0] if dtype[name].shape else 1
        values = np.array(columns[at : at + width]).T
        out[name] = values if width > 1 else values[:, 0]
        at += width
    return out


@pytest.fixture(scope="module")
def tables() -> dict[str, Tables]:
    return {
        name: Tables.of_arrays(
            structured(t["levels"], LEVEL),
            structured(t["groups"], GROUP),
            structured(t["clusters"], CLUSTER),
            structured(t["nodes"], NODE),
        )
        for name, t in VECTORS["tables"].items()
    }


def native_view(view: dict[str, Any]) -> _umbel.View:
    if view["kind"] == "error":
        return _umbel.view_error(view["error"])
    if view["kind"] == "level":
        return _umbel.view_level(view["level"])
    native = _umbel.view_camera(view["eye"], 1.0, 100, 1.0)
    native.threshold = view["threshold"]
    return native


def culling(case: dict[str, Any]) -> dict[str, Any]:
    facing = VECTORS["tables"][case["tables"]]["facing"]
    return {
        "planes": np.array(case["planes"], np.float32).reshape(-1, 4),
        "normal_cones": np.array(facing, np.float32) if case["facing"] else None,
    }


@pytest.mark.parametrize("method", ["flat", "hierarchy", "breadth_first"])
def test_library_gives_the_cuts_of_the_vectors(tables: dict[str, Tables], method: str) -> None:
    sizes = set()
    for case in VECTORS["cuts"]:
        cut = _umbel.select(
            tables[case["tables"]]._native, native_view(case["view"]), method, **culling(case)
        )
        assert cut.tolist() == case["cut"]
        sizes.add(len(cut))
    assert len(sizes) > 30


def test_reference_gives_the_cuts_of_the_vectors() -> None:
    with np.errstate(all="ignore"):
        for case in VECTORS["cuts"]:
            selector = Selector(VECTORS["tables"][case["tables"]], case)
            assert selector.flat() == case["cut"]
            assert selector.hierarchy() == case["cut"]


def test_budgets_of_the_vectors(tables: dict[str, Tables]) -> None:
    for case in VECTORS["budgets"]:
        t = tables[case["tables"]]
        costs = np.ascontiguousarray(t.clusters["triangle_count"])
        if case["costs"] == "bytes":
            costs = costs * case["triangle_bytes"] + t.clusters["vertex_count"] * np.uint32(
                case["vertex_bytes"]
            )
        arguments = native_view(case["view"]), costs, case["budget"]
        made = _umbel.view_for_budget(t._native, *arguments, **culling(case))
        which = "error" if case["view"]["kind"] == "error" else "threshold"
        # With the eye inside no threshold may fit; an infinite error does.
        is_beyond = which == "threshold" and np.isinf(made.error)
        if not is_beyond:
            assert np.float32(getattr(made, which)) == np.float32(case["result"][which])
        whole = VECTORS["tables"][case["tables"]]
        coarsest = {**case["result"], which: 1e30}
        with np.errstate(all="ignore"):
            cut, least = (
                Selector(whole, {**case, "view": view}).flat()
                for view in (case["result"], coarsest)
            )
        assert costs[cut].sum() <= case["budget"] or cut == least
        if is_beyond:
            assert costs[cut].sum() > case["budget"]


def test_cameras_and_instances_of_the_vectors() -> None:
    for case in VECTORS["cameras"]:
        view = _umbel.view_camera(case["eye"], case["fov_y"], case["height"], case["pixel_error"])
        assert view.threshold == pytest.approx(case["threshold"], rel=1e-6)
    for case in VECTORS["instances"]:
        transform = np.array([case["transform"]], np.float32)
        made = _umbel.view_in_instance(native_view(case["view"]), transform)
        if case["view"]["kind"] == "error":
            assert made.error == pytest.approx(case["object"]["error"], rel=1e-4)
        else:
            assert made.threshold == pytest.approx(case["object"]["threshold"], rel=1e-4)
            assert made.eye == pytest.approx(case["object"]["eye"], rel=1e-4, abs=1e-4)


@pytest.fixture(scope="module")
def lod() -> umbel.Lod:
    return umbel.build_lod(umbel.shapes.blob(4, 3), max_triangles=32, group_size=(4, 8))


def test_a_frustum_leaves_out_what_is_behind(lod: umbel.Lod) -> None:
    camera = umbel.Camera((0, 0, 3), target=(0, 0, 0), pixel_error=0.5)
    away = umbel.Camera((0, 0, 3), target=(0, 0, 6), pixel_error=0.5)
    everything = lod.cut(camera=camera)
    assert len(lod.cut(camera=camera, planes=away.planes())) == 0
    seen = lod.cut(camera=camera, planes=camera.planes(aspect=2.0))
    front = lod.cut(
        camera=camera, planes=camera.planes(aspect=2.0), normal_cones=lod.normal_cones()
    )
    assert set(front) < set(seen) <= set(everything)
    assert len(camera.planes(far=10.0)) == 6
    with pytest.raises(umbel.Error, match="target"):
        umbel.Camera((0, 0, 1)).planes()
    for wrong in ((0, 0, 3, 1), "abc", 5, (0, None, 1)):
        with pytest.raises(umbel.Error, match="must be three numbers, not"):
            umbel.Camera(wrong).view()
        with pytest.raises(umbel.Error, match="must be three numbers, not"):
            umbel.Camera((0, 0, 3), target=wrong).planes()
    for settings in ({"height": 540.5}, {"height": -1}, {"fov_y": "1"}, {"pixel_error": None}):
        (name,) = settings
        with pytest.raises(umbel.Error, match=f"a camera's {name} must be"):
            umbel.Camera((0, 0, 1), **settings).view()


def test_budgets_bound_what_is_drawn(lod: umbel.Lod) -> None:
    camera = umbel.Camera((0, 0, 3), target=(0, 0, 0), pixel_error=0.01)
    planes = umbel.Camera((0, 0, 3), target=(1, 0, 0), fov_y=0.3).planes()
    free = lod.tables.cut_triangles(lod.cut(camera=camera, planes=planes))
    cut = lod.cut(camera=camera, planes=planes, triangles=free // 3)
    assert 0 < lod.tables.cut_triangles(cut) <= free // 3
    cut = lod.cut(camera=camera, bytes=20_000, vertex_bytes=12)
    counts = lod.clusters[cut]
    assert counts["vertex_count"].sum() * 12 + counts["triangle_count"].sum() * 3 <= 20_000
    assert len(lod.cut(error=0.5, triangles=10**9)) == len(lod.cut(error=0.5))


def test_instances_have_cuts_of_their_own(lod: umbel.Lod) -> None:
    transforms = np.tile(np.eye(4, dtype=np.float32), (3, 1, 1))
    transforms[1, 2, 3] = -50.0
    transforms[2, :3, :3] *= 0.1
    camera = umbel.Camera((0, 0, 2), target=(0, 0, 0), pixel_error=1)
    view = lod.tables.view(camera=camera)
    near, far, small = lod.tables.instance_cuts(transforms, view)
    assert np.array_equal(near, lod.cut(camera=camera))
    assert len(far) < len(near) and len(small) < len(near)
    shared = lod.tables.view(camera=camera, triangles=1000, transforms=transforms)
    cuts = lod.tables.instance_cuts(transforms, shared)
    assert sum(lod.tables.cut_triangles(cut) for cut in cuts) <= 1000
    assert lod.tables.instance_cuts(np.empty((0, 3, 4)), view) == []
    with pytest.raises(umbel.Error, match="transforms"):
        lod.tables.instance_cuts(np.eye(4), view)
    with pytest.raises(umbel.Error, match="invertible"):
        lod.tables.instance_cuts(np.zeros((1, 3, 4)), view)


def test_errors_as_angles_and_pixels(lod: umbel.Lod) -> None:
    assert umbel.angular_error(1, 2) == pytest.approx(math.asin(0.5))
    assert umbel.angular_error(3, 2) == pytest.approx(math.pi / 2)
    assert umbel.pixel_error(0.01, 10, math.pi / 2, 1000) == pytest.approx(0.5)
    assert umbel.pixel_error(0.01, 0, 1, 1000) == math.inf


def test_tables_that_lead_nowhere_are_refused(lod: umbel.Lod) -> None:
    parts = [lod.levels, lod.groups, lod.clusters, lod.nodes]
    assert np.array_equal(Tables.of_arrays(*parts).cut(error=0.1), lod.cut(error=0.1))
    clusters = lod.clusters.copy()
    clusters["generating_group"][-1] = 10**6
    with pytest.raises(umbel.Error, match="1000000"):
        Tables.of_arrays(lod.levels, lod.groups, clusters, lod.nodes)
    nodes = lod.nodes.copy()
    nodes["child_offset"][0] = 0
    with pytest.raises(umbel.Error, match="ode"):
        Tables.of_arrays(lod.levels, lod.groups, lod.clusters, nodes)


def test_impossible_selections_are_refused(lod: umbel.Lod) -> None:
    with pytest.raises(umbel.Error, match="method"):
        lod.cut(error=0.1, method="guess")
    last = len(lod.levels) - 1
    for wrong in (last + 1, 99, -1, 1.5, math.nan):
        with pytest.raises(umbel.Error, match="level"):
            lod.cut(level=wrong)
    for wrong in (-1.0, math.nan):
        with pytest.raises(umbel.Error, match="error must be 0 or more"):
            lod.cut(error=wrong)
    for name in ("triangles", "bytes"):
        for wrong in (0, -5, 0.5, math.nan):
            with pytest.raises(umbel.Error, match=name):
                lod.cut(**{name: wrong})
        with pytest.raises(umbel.Error, match=f"{name} is 1, but the coarsest cut has"):
            lod.cut(**{name: 1})
    with pytest.raises(umbel.Error, match="planes"):
        lod.cut(error=0.1, planes=[[1, 2, 3]])
    with pytest.raises(umbel.Error, match="planes"):
        lod.cut(error=0.1, planes=[[1, 2, 3, 4]])
    with pytest.raises(umbel.Error, match="camera"):
        lod.cut(error=0.1, normal_cones=lod.normal_cones())
    with pytest.raises(umbel.Error, match="at most one of triangles"):
        lod.cut(triangles=5, bytes=5)
    with pytest.raises(umbel.Error, match="vertex_bytes must be"):
        lod.cut(bytes=10**6, vertex_bytes=-1)
    with pytest.raises(umbel.Error, match="level"):
        lod.cut(level=1, triangles=5)
