"""Continuous level of detail from Python, in memory and as a file."""

from __future__ import annotations

import math
import threading
from pathlib import Path

import numpy as np
import pytest
import trimesh

import umbel
from helpers.interrupts import interrupted
from helpers.meshes import is_closed, triangle_keys


@pytest.fixture(scope="module")
def blob() -> umbel.Mesh:
    return umbel.shapes.blob(5)


@pytest.fixture(scope="module")
def lod(blob: umbel.Mesh) -> umbel.Lod:
    return umbel.build_lod(blob)


def test_tables_are_views_that_agree_with_each_other(lod: umbel.Lod) -> None:
    groups, clusters, levels = lod.groups, lod.clusters, lod.levels
    assert levels["count"].sum() == len(groups)
    assert groups["cluster_count"].sum() == len(clusters)
    for index, group in enumerate(groups):
        begin = group["cluster_offset"]
        assert (clusters["group"][begin : begin + group["cluster_count"]] == index).all()
    made = clusters["generating_group"] != 0xFFFFFFFF
    assert (groups["level"][clusters["group"]] > 0)[made].all()
    assert not clusters.flags.writeable and clusters.base is not None
    assert (clusters["triangle_count"] <= 128).all() and (clusters["vertex_count"] <= 128).all()
    assert np.isinf(groups["error"]).sum() == lod.report["root_groups"] == 1
    assert lod.report["stuck_groups"] == 0
    leaves = lod.nodes["group"][lod.nodes["group"] != 0xFFFFFFFF]
    assert np.array_equal(np.sort(leaves), np.arange(len(groups)))


def test_views_outlive_their_lod(blob: umbel.Mesh) -> None:
    groups = umbel.build_lod(blob).groups
    assert groups["error"].max() == math.inf


@pytest.mark.parametrize("fraction", [0.0, 0.001, 0.01, 0.1, 1.0])
def test_cut_of_closed_mesh_is_closed(lod: umbel.Lod, fraction: float) -> None:
    cut = lod.cut(error=fraction)
    assert is_closed(lod.mesh(cut))
    assert lod.tables.cut_error(cut) <= fraction


def test_level_zero_is_the_input(blob: umbel.Mesh, lod: umbel.Lod) -> None:
    for cut in (lod.cut(level=0), lod.cut(error=0)):
        assert np.array_equal(triangle_keys(lod.mesh(cut)), triangle_keys(blob))
        assert lod.tables.cut_error(cut) == 0


def test_hierarchy_gives_the_same_cut(lod: umbel.Lod) -> None:
    for error in (0.0, 0.003, 0.05, 10.0):
        flat, through = (lod.tables.cut(error=error, method=m) for m in ("flat", "hierarchy"))
        assert np.array_equal(flat, through)


def test_triangle_budgets_are_kept(lod: umbel.Lod) -> None:
    for budget in (20_480, 10_000, 2_000, 200):
        cut = lod.cut(triangles=budget)
        count = len(lod.mesh(cut).triangles)
        assert count == lod.tables.cut_triangles(cut) <= budget
    least = lod.report["root_triangles"]
    assert lod.tables.cut_triangles(lod.cut(triangles=least)) == least
    coarsest = lod.cut(error=math.inf)
    assert lod.tables.cut_triangles(coarsest) == least
    assert np.array_equal(lod.cut(triangles=1, or_coarsest=True), coarsest)


def test_the_nearer_the_camera_the_finer_the_cut(lod: umbel.Lod) -> None:
    sizes = []
    for distance in (1e6, 100.0, 10.0, 2.0):
        camera = umbel.Camera((0, 0, distance), target=(0, 0, 0), pixel_error=4)
        cut = lod.cut(camera=camera)
        assert is_closed(lod.mesh(cut))
        sizes.append(lod.tables.cut_triangles(cut))
    assert sizes == sorted(sizes) and sizes[0] < sizes[-1]


def test_a_cut_needs_exactly_one_wish(lod: umbel.Lod) -> None:
    for wishes in ({}, {"error": 1.0, "level": 0}):
        with pytest.raises(umbel.Error, match="a cut needs one of"):
            lod.cut(**wishes)
    for wish in ({"error": -1.0}, {"error": math.nan}, {"level": -1}, {"triangles": -5}):
        with pytest.raises(umbel.Error, match=next(iter(wish))):
            lod.cut(**wish)
    with pytest.raises(umbel.Error, match="999999"):
        lod.mesh([999_999])


def test_limits_and_group_sizes_are_kept(blob: umbel.Mesh) -> None:
    lod = umbel.build_lod(blob, max_triangles=64, max_vertices=48, group_size=(8, 16))
    assert lod.clusters["triangle_count"].max() <= 64
    assert lod.clusters["vertex_count"].max() <= 48
    assert lod.groups["cluster_count"].max() <= 16
    assert lod.verify(8).ok


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ({"max_triangles": 3}, "max_triangles"),
        ({"max_triangles": 257}, "max_triangles"),
        ({"max_triangles": -1}, "max_triangles"),
        ({"max_vertices": 2}, "max_vertices"),
        ({"group_size": (5, 3)}, "group"),
        ({"group_size": "ab"}, "group"),
        ({"group_size": (1, 2, 3)}, "group"),
        ({"group_size": (2.7, 8)}, "group"),
        ({"group_size": "24"}, "group"),
        ({"locked": np.zeros((4, 1))}, "locked must have shape"),
        ({"locked": np.arange(4)}, r"locked must be true or false .*, not numbers \(int"),
        ({"ratio": 0.99}, "ratio"),
        ({"attributes": "some"}, "some"),
        ({"precision": "soon"}, "precision"),
        ({"precision": "99bits"}, "bits"),
        ({"precision": "16"}, "16mm .* 16bits"),
        ({"precision": 0}, "precision"),
        ({"precision": -1.0}, "precision"),
    ],
)
def test_bad_arguments_are_named(blob: umbel.Mesh, arguments: dict, word: str) -> None:
    with pytest.raises(umbel.Error, match=word):
        umbel.build_lod(blob, **arguments)


def test_attributes_and_materials_stay(blob: umbel.Mesh) -> None:
    rng = np.random.default_rng(1)
    n = len(blob.positions)
    materials = [umbel.Material(name=str(k), roughness=k / 4) for k in range(3)]
    mesh = umbel.Mesh(
        blob.positions,
        blob.triangles,
        normals=blob.positions / np.linalg.norm(blob.positions, axis=1, keepdims=True),
        uvs=blob.positions[:, :2],
        colors=rng.random((n, 4), np.float32),
        material_ids=(blob.positions[blob.triangles[:, 0], 0] > 0).astype(np.uint32) * 2,
        materials=materials,
    )
    lod = umbel.build_lod(mesh)
    fine = lod.mesh(lod.cut(level=0))
    assert np.array_equal(triangle_keys(fine), triangle_keys(mesh))
    assert [m.name for m in fine.materials] == ["0", "1", "2"]
    coarse = lod.mesh(lod.cut(triangles=1000))
    assert coarse.normals is not None and coarse.uvs is not None and coarse.colors is not None
    assert set(coarse.material_ids) == {0, 2}
    bare = umbel.build_lod(mesh, attributes="none")
    assert bare.mesh(bare.cut(level=0)).normals is None


def test_precision_snaps_and_says_so(blob: umbel.Mesh) -> None:
    lod = umbel.build_lod(blob, precision="10bits")
    step = lod.report["grid_step"]
    longest = np.ptp(blob.positions, axis=0).max()
    assert longest / 1024 <= step <= longest / 256 and math.log2(step) % 1 == 0
    assert 0 < lod.report["largest_move"] <= step
    scaled = lod.mesh(lod.cut(level=0)).positions / np.float32(step)
    assert np.array_equal(scaled, np.round(scaled))
    assert umbel.build_lod(blob, precision="2mm").report["grid_step"] == 2**-9
    assert umbel.build_lod(blob, precision="2 mm").report["grid_step"] == 2**-9
    assert umbel.build_lod(blob, precision=0.002).report["grid_step"] == 2**-9


def test_invalid_triangles_can_be_dropped(blob: umbel.Mesh) -> None:
    positions = blob.positions.copy()
    positions[9] = np.inf
    mesh = umbel.Mesh(positions, blob.triangles)
    with pytest.raises(umbel.Error, match=r"\b9\b"):
        umbel.build_lod(mesh)
    lod = umbel.build_lod(mesh, drop_invalid=True)
    touched = int((blob.triangles == 9).any(axis=1).sum())
    assert lod.report["dropped_triangles"] == touched
    assert lod.report["input_triangles"] == len(blob.triangles) - touched
    assert lod.verify(8).ok


def test_trimesh_goes_in(blob: umbel.Mesh) -> None:
    given = trimesh.Trimesh(blob.positions, blob.triangles, process=False)
    lod = umbel.build_lod(given)
    assert np.array_equal(triangle_keys(lod.mesh(lod.cut(level=0))), triangle_keys(blob))


def test_progress_rises_and_can_cancel(blob: umbel.Mesh) -> None:
    seen: list[tuple[float, str]] = []
    umbel.build_lod(blob, progress=lambda fraction, stage: seen.append((fraction, stage)))
    fractions = [fraction for fraction, _ in seen]
    assert fractions == sorted(fractions) and fractions[0] >= 0 and fractions[-1] <= 1
    assert all(stage for _, stage in seen)
    with pytest.raises(umbel.Cancelled) as raised:
        umbel.build_lod(blob, progress=lambda fraction, stage: False)
    assert raised.value.code == "cancelled"


def test_exceptions_pass_through_a_build(blob: umbel.Mesh) -> None:
    def fails(fraction: float, stage: str) -> None:
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        umbel.build_lod(blob, progress=fails)


def test_ctrl_c_stops_a_build() -> None:
    mesh = umbel.shapes.blob(7)
    with interrupted(within=10):
        while True:
            umbel.build_lod(mesh)


def test_ctrl_c_stops_the_reading_of_a_cut(blob: umbel.Mesh, tmp_path: Path) -> None:
    umbel.build_lod(blob).save(tmp_path / "a.umbel")
    asset = umbel.Asset(tmp_path / "a.umbel")
    # One call that takes seconds.
    once = asset.cut(level=0)
    cut = np.tile(once, 8_000_000 // len(asset.mesh(once).triangles))
    with interrupted(within=1.5):
        asset.mesh(cut)


def test_other_threads_run_during_a_build(blob: umbel.Mesh) -> None:
    ticks = 0
    stop = threading.Event()

    def tick() -> None:
        nonlocal ticks
        while not stop.wait(0.001):
            ticks += 1

    thread = threading.Thread(target=tick)
    thread.start()
    umbel.build_lod(umbel.shapes.blob(6))
    stop.set()
    thread.join()
    assert ticks > 5


def test_asset_gives_what_the_lod_gives(lod: umbel.Lod, tmp_path: Path) -> None:
    path = tmp_path / "blob.umbel"
    assert lod.save(path) == path.stat().st_size
    asset = umbel.Asset(path)
    for name in ("levels", "groups", "nodes"):
        assert np.array_equal(getattr(asset.tables, name), getattr(lod, name))
    stored, built = asset.tables.clusters, lod.clusters
    for name in ("group", "generating_group", "material", "vertex_count", "triangle_count"):
        assert np.array_equal(stored[name], built[name])
    assert np.all(stored["box_min"] <= built["box_min"])
    assert np.all(stored["box_max"] >= built["box_max"])
    for wish in ({"level": 0}, {"error": 0.01}, {"triangles": 3000}):
        cut = asset.cut(**wish)
        assert np.array_equal(cut, lod.cut(**wish))
        assert np.array_equal(triangle_keys(asset.mesh(cut)), triangle_keys(lod.mesh(cut)))
    info = asset.info
    assert info["source_triangles"] == 20_480
    assert info["metadata"]["config"]["max_triangles"] == 128
    assert "seconds" not in info["metadata"]["report"]
    assert info["file_bytes"] == path.stat().st_size
    one = asset.cluster(0)
    assert len(one.triangles) == asset.tables.clusters["triangle_count"][0]
    report = umbel.verify(path, cuts=16)
    assert report and report.ok and report.cuts == 16 and not report.problems
    assert asset.verify(4).cuts == 4


def test_saving_twice_gives_the_same_bytes(blob: umbel.Mesh, tmp_path: Path) -> None:
    written = set()
    for threads in (1, 2, 1):
        umbel.build_lod(blob, threads=threads).save(tmp_path / "a.umbel")
        written.add((tmp_path / "a.umbel").read_bytes())
    assert len(written) == 1


def test_a_missing_or_foreign_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(umbel.Error, match=r"missing\.umbel") as raised:
        umbel.Asset(tmp_path / "missing.umbel")
    assert raised.value.code == "io"
    (tmp_path / "text.umbel").write_text("not an asset at all\n" * 100)
    with pytest.raises(umbel.Error) as raised:
        umbel.Asset(tmp_path / "text.umbel")
    assert raised.value.code in ("corrupt", "unsupported")
    with pytest.raises(umbel.Error, match="http"):
        umbel.Asset("http://localhost/x.umbel")


@pytest.mark.parametrize(
    "mesh",
    [
        umbel.Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.uint32)),
        umbel.Mesh(np.eye(3), [[0, 1, 2]]),
        umbel.Mesh(np.vstack([np.eye(3), np.eye(3) + 9]), [[0, 1, 2], [3, 4, 5]]),
        umbel.Mesh(np.zeros((3, 3)), [[0, 1, 2]] * 100),
        umbel.shapes.tetrahedra(1000),
        umbel.shapes.moebius(200, 10),
        umbel.shapes.fan(5000),
        umbel.shapes.soup(3000),
        umbel.shapes.grid(60, 60),
        umbel.shapes.torus(60, 40),
        umbel.shapes.terrain(60, 60),
    ],
    ids=lambda mesh: f"{len(mesh.triangles)}_triangles",
)
def test_odd_meshes_build_and_verify(mesh: umbel.Mesh, tmp_path: Path) -> None:
    lod = umbel.build_lod(mesh)
    lod.save(tmp_path / "odd.umbel")
    report = umbel.verify(tmp_path / "odd.umbel", cuts=16)
    assert report.ok, report.problems
    asset = umbel.Asset(tmp_path / "odd.umbel")
    fine = asset.mesh(asset.cut(level=0))
    assert np.array_equal(triangle_keys(fine), triangle_keys(mesh))


def test_decimation_of_ones_own_may_add_vertices(blob: umbel.Mesh) -> None:
    calls = []

    def fan(group: umbel.Mesh, locked: np.ndarray, target: int) -> object:
        calls.append((len(group.triangles), target))
        edges = np.concatenate([group.triangles[:, [i, (i + 1) % 3]] for i in range(3)])
        known = {tuple(edge) for edge in edges.tolist()}
        border = [(a, b) for a, b in known if (b, a) not in known]
        if not border or len(border) > target or not locked[[a for a, _ in border]].all():
            return None
        new = len(group.positions)
        triangles = np.array([(a, b, new) for a, b in sorted(border)], np.uint32)
        middle = group.positions[[a for a, _ in border]].mean(axis=0, keepdims=True)
        return triangles, 0.5, umbel.Mesh(middle, np.empty((0, 3), np.uint32))

    built = umbel.build_lod(
        blob, max_triangles=64, group_size=(4, 8), decimate=fan, progress=None, threads=2
    )
    assert len(calls) > 5 and all(target < triangles for triangles, target in calls)
    assert built.verify(cuts=8).ok
    assert is_closed(built.mesh(built.cut(level=2)))

    def broken(*_: object) -> object:
        raise RuntimeError("mine")

    with pytest.raises(RuntimeError, match="mine"):
        umbel.build_lod(blob, decimate=broken)
    with pytest.raises(umbel.Error, match="decimate"):
        umbel.build_lod(blob, decimate=lambda group, *_: ([[0, 1, 10**6]], 0.0))


def test_building_stops_where_it_is_asked_to(blob: umbel.Mesh) -> None:
    small = {"max_triangles": 32, "group_size": (4, 8)}
    assert len(umbel.build_lod(blob, **small, max_levels=2).levels) == 2
    assert umbel.build_lod(blob, **small, stop_triangles=2000).report["root_triangles"] <= 2000
    errors = umbel.build_lod(blob, **small, max_error=0.02).groups["error"]
    assert errors[np.isfinite(errors)].max() <= 0.02
    with pytest.raises(umbel.Error, match="max_error"):
        umbel.build_lod(blob, max_error=-1)


def test_measured_errors_say_how_far_estimates_were_off(blob: umbel.Mesh) -> None:
    built = umbel.build_lod(blob, max_triangles=32, group_size=(4, 8), measured_error=True)
    assert built.report["measured_groups"] > 10
    assert 0.1 < built.report["mean_overestimate"] < 100
    assert built.report["underestimated_groups"] <= built.report["measured_groups"]


def test_every_vertex_is_the_meshs_or_new() -> None:
    blob = umbel.shapes.blob(4, 3)
    lod = umbel.build_lod(blob, max_triangles=32, group_size=(4, 8), refit_attributes=False)
    vertices = lod.source_vertices
    assert len(vertices) == int(lod.clusters["vertex_count"].sum())
    offsets = [0, *np.cumsum(lod.clusters["vertex_count"]).tolist()]
    for cluster in (0, 7, len(lod.clusters) - 1):
        own = vertices[offsets[cluster] : offsets[cluster + 1]]
        shown = lod.mesh([cluster]).positions
        assert {tuple(p) for p in blob.positions[own].tolist()} == {
            tuple(p) for p in shown.tolist()
        }


def test_locked_borders_and_vertices_stay() -> None:
    grid = umbel.shapes.grid(30, 30)
    small = {"max_triangles": 32, "group_size": (4, 8)}
    free = umbel.build_lod(grid, **small)
    tile = umbel.build_lod(grid, **small, lock_borders=True)
    assert free.report["root_triangles"] <= 32 < 118 <= tile.report["root_triangles"]
    x, y = grid.positions[:, 0], grid.positions[:, 1]
    outline = {tuple(p) for p in grid.positions[(x % 1 == 0) | (y % 1 == 0)].tolist()}
    coarsest = tile.mesh(tile.cut(error=math.inf)).positions
    assert outline <= {tuple(p) for p in coarsest.tolist()}
    corner = umbel.build_lod(grid, **small, locked=np.arange(len(grid.positions)) < 100)
    shown = {tuple(p) for p in corner.mesh(corner.cut(error=math.inf)).positions.tolist()}
    assert {tuple(p) for p in grid.positions[:100].tolist()} <= shown
    with pytest.raises(umbel.Error, match="locked"):
        umbel.build_lod(grid, locked=[True])


def test_a_decimation_is_told_why_it_was_refused() -> None:
    told: list[str | None] = []

    def keep_all(mesh: umbel.Mesh, locked: object, target: int, refused: str | None) -> object:
        told.append(refused)
        return None if refused else (mesh.triangles, 0.0)

    umbel.build_lod(
        umbel.shapes.blob(3, 3), max_triangles=32, group_size=(4, 8), decimate=keep_all, threads=1
    )
    assert told.count(None) == len(told) // 2
    assert "too many triangles are left" in told


def test_budgets_count_clusters_and_groups_and_are_filled() -> None:
    lod = umbel.build_lod(umbel.shapes.blob(5, 3), max_triangles=32, group_size=(4, 8))
    for most in (10, 60, 300):
        cut = lod.cut(clusters=most)
        assert len(cut) <= most
        shown = lod.cut(groups=most)
        assert len(np.unique(lod.clusters["group"][shown])) <= most
    plain = lod.tables.view(triangles=5000)
    assert lod.tables.cut_triangles(lod.cut(triangles=5000)) >= lod.tables.cut_triangles(
        lod.cut(error=plain.error)
    )
    with pytest.raises(umbel.Error, match="triangles is 1, but the coarsest cut has"):
        lod.cut(triangles=1)


def test_tables_need_no_nodes() -> None:
    lod = umbel.build_lod(umbel.shapes.blob(4, 3), max_triangles=32, group_size=(4, 8))
    bare = umbel.Tables.of_arrays(lod.levels, lod.groups, lod.clusters)
    assert np.array_equal(bare.nodes, lod.nodes)
    barer = umbel.Tables.of_arrays(lod.levels[:0], lod.groups, lod.clusters)
    assert np.array_equal(barer.levels, lod.levels)
