"""Meshes far from zero, as on maps: nothing of their positions is lost, in memory and in files."""

import json
import struct
import warnings

import numpy as np
import pytest

import umbel
from helpers.far_away import (
    EARTH,
    UTM,
    WKT,
    degenerate,
    distinct,
    patch,
    sphere,
    translation,
    write_gltf,
    write_obj,
    write_ply,
    write_stl,
    xyz,
)
from umbel.geometry.origin import is_far, localize
from umbel.io.scene import Instance, Scene


def test_points_near_zero_have_no_origin():
    rng = np.random.default_rng(1)
    points = rng.normal(size=(100, 3)) + 5.0
    origin, local = localize(points)
    assert not origin.any()
    np.testing.assert_array_equal(local, points.astype(np.float32))


def test_points_are_checked():
    origin, positions = umbel.localize([[1, 2, 3]])
    assert not origin.any() and positions.tolist() == [[1, 2, 3]]
    for wrong in ("abc", [1, 2, 3], [[1, 2]], [[1, 2, 3], [1, 2]]):
        with pytest.raises(umbel.Error, match="points must"):
            umbel.localize(wrong)


def test_points_that_float32_holds_have_no_origin():
    points = np.array([[500000.0, 4649776.0, 0.0], [500000.5, 4649776.5, 1.0]])
    origin, local = localize(points)
    assert not origin.any() and is_far(points)
    np.testing.assert_array_equal(local, points)


def test_points_far_away_have_a_round_origin_near_them():
    points, _ = patch()
    origin, local = localize(points)
    extent = np.ptp(points, axis=0).max()
    np.testing.assert_array_equal(origin, np.round(origin * 1024) / 1024)
    assert np.abs(local).max() <= extent
    assert np.abs(origin + local - points).max() < 1e-6


@pytest.mark.parametrize("rows", [0, 1])
def test_few_points_are_no_trouble(rows):
    points = np.full((rows, 3), 1e7 + 0.123)
    origin, local = localize(points)
    np.testing.assert_array_equal(origin + local, points)


def test_points_that_are_not_finite_count_for_nothing():
    points, _ = patch()
    points[7] = np.nan
    points[9, 1] = np.inf
    origin, local = localize(points)
    rest = np.delete(np.arange(len(points)), [7, 9])
    assert np.abs(origin + local[rest] - points[rest]).max() < 1e-6
    assert np.isnan(local[7]).all() and np.isinf(local[9, 1])
    assert not localize(np.full((3, 3), np.nan))[0].any()


def test_a_mesh_says_where_it_is():
    points, faces = patch()
    mesh = umbel.Mesh(points, faces)
    assert mesh.positions.dtype == np.float32 and mesh.origin.any()
    np.testing.assert_allclose(mesh.world_positions, points, rtol=0, atol=1e-6)
    np.testing.assert_allclose(mesh.vertices, points, rtol=0, atol=1e-6)
    np.testing.assert_allclose(mesh.bounds, [points.min(0), points.max(0)], rtol=0, atol=1e-6)
    assert 0 < mesh.rounding.largest_move < 1e-6 and mesh.rounding.degenerate == 0


@pytest.mark.parametrize(
    ("extension", "write"), [("obj", write_obj), ("ply", write_ply), ("stl", write_stl)]
)
@pytest.mark.parametrize("back", ["ply", "obj"])
def test_a_map_comes_back_from_an_asset(tmp_path, extension, write, back):
    points, faces = patch()
    assert len(faces) == 19602
    source = tmp_path / f"map.{extension}"
    write(source, points, faces)
    mesh = umbel.load(source)
    corners = mesh.world_positions[mesh.triangles.astype(np.int64)]
    np.testing.assert_allclose(corners, points[faces], rtol=0, atol=1e-3)

    built = umbel.build_scene(source)
    assert 0 < built.report["largest_move"] < 1e-6
    built.save(tmp_path / "map.umbel")
    asset = umbel.Asset(tmp_path / "map.umbel")
    assert asset.origin.any() and umbel.verify(tmp_path / "map.umbel", 4).ok
    np.testing.assert_allclose(
        asset.info["bounds"], [points.min(0), points.max(0)], rtol=0, atol=1e-3
    )
    whole = asset.scene_mesh(asset.scene_cuts(level=0))
    umbel.save(tmp_path / f"back.{back}", whole)
    again = umbel.load(tmp_path / f"back.{back}")
    assert len(again.triangles) == len(faces)
    assert degenerate(again.world_positions, again.triangles) == 0

    def ordered(triangles):
        rotated = [np.roll(t, -np.lexsort(t.T)[0], axis=0).reshape(-1) for t in triangles]
        keys = np.round(np.array(rotated) - np.tile(UTM, 3), 3)
        return np.array(rotated)[np.lexsort(keys.T)]

    found = ordered(again.world_positions[again.triangles.astype(np.int64)])
    assert np.abs(found - ordered(points[faces])).max() < 1e-3


@pytest.mark.parametrize("instances", ["on", "off"])
def test_a_gltf_on_the_earth_keeps_its_vertices(tmp_path, instances):
    ball = sphere()
    path = tmp_path / "ball.glb"
    beside = (EARTH + xyz(3.0, 0.0, 0.0)).tolist()
    nodes = [{"translation": EARTH.tolist()}, {"translation": beside, "scale": [0.5, 0.5, 0.5]}]
    write_gltf(path, ball.positions, ball.triangles, nodes)
    truth = np.concatenate([ball.positions + EARTH, 0.5 * ball.positions.astype(float) + beside])
    assert distinct(umbel.load(path).world_positions) == 2 * 2562

    built = umbel.build_scene(path, instances=instances)
    assert built.report["largest_move"] < 1e-5
    built.save(tmp_path / "ball.umbel")
    asset = umbel.Asset(tmp_path / "ball.umbel")
    assert (len(asset.instances) == 2) == (instances == "on")
    whole = asset.scene_mesh(asset.scene_cuts(level=0))
    points = whole.world_positions
    assert distinct(points) == 2 * 2562
    order = [np.lexsort(np.round(p - EARTH, 4).T) for p in (points, truth)]
    assert np.abs(points[order[0]] - truth[order[1]]).max() < 1e-5
    assert asset.coordinates == {"unit": "metre", "up": "y"}


def test_a_skin_on_the_earth_keeps_its_vertices(tmp_path, data):
    raw = (data / "CesiumMan.glb").read_bytes()
    (size,) = struct.unpack_from("<I", raw, 12)
    root, rest = json.loads(raw[20 : 20 + size]), raw[20 + size :]
    root["nodes"].append({"translation": EARTH.tolist(), "children": root["scenes"][0]["nodes"]})
    root["scenes"][0]["nodes"] = [len(root["nodes"]) - 1]
    text = json.dumps(root).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<III4s", 2, 20 + len(text) + len(rest), len(text), b"JSON")
    (tmp_path / "man.glb").write_bytes(b"glTF" + head + text + rest)
    here, there = umbel.load(data / "CesiumMan.glb"), umbel.load(tmp_path / "man.glb")
    assert not here.origin.any() and there.origin.any()
    assert np.abs(there.world_positions - EARTH - here.positions).max() < 1e-6
    assert distinct(there.world_positions) == distinct(here.positions)


def test_a_double_ply_keeps_its_vertices(data):
    path = data / "nasty_synth_dragon_ecef_f64.ply"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mesh = umbel.load(path)
    raw = path.read_bytes()
    body = raw[raw.index(b"end_header\n") + 11 :]
    truth = np.frombuffer(body, "<f8", 3 * len(mesh.positions)).reshape(-1, 3)
    used = np.unique(mesh.triangles)
    assert distinct(mesh.world_positions[used]) == distinct(truth[used])
    assert np.abs(mesh.world_positions - truth).max() < 1e-7 * np.ptp(truth, axis=0).max()


def test_what_is_collapsed_in_the_file_is_no_fault_of_ours(data):
    lod = umbel.build_lod(data / "nasty_synth_dragon_ecef_f32.ply")
    assert lod.report["largest_move"] == 0.0 and not lod.origin.any()


def far_apart():
    """One patch on the map and one at zero: no origin serves both."""
    points, faces = patch(20)
    both = np.concatenate([points, points - UTM])
    return both, np.concatenate([faces, faces + np.uint32(len(points))])


def test_a_build_refuses_what_float32_cannot_hold(tmp_path):
    points, faces = far_apart()
    with pytest.raises(umbel.Error, match=r"\d+ of 1600 triangles lost their area.*force"):
        umbel.build_lod((points, faces))
    forced = umbel.build_lod((points, faces), force=True)
    assert forced.report["largest_move"] > 0.1


def test_a_build_refuses_a_grid_that_is_too_coarse():
    mesh = umbel.shapes.blob(4, 1)
    with pytest.raises(umbel.Error, match=r"grid of 0\.5 would take the area of \d+ of 5120"):
        umbel.build_lod(mesh, precision=0.5)
    forced = umbel.build_lod(mesh, precision=0.5, force=True)
    assert forced.report["degenerate_triangles"] > 51
    with pytest.raises(umbel.Error, match="force"):
        umbel.build_scene(mesh, precision=0.5)
    assert umbel.build_scene(mesh, precision=0.5, force=True).report["largest_move"] > 0.1


def test_parts_far_apart_can_stay_whole_as_instances(tmp_path):
    points, faces = patch(20)
    mesh = umbel.Mesh(points - UTM, faces)
    scene = Scene([mesh], [], [Instance(0), Instance(0, translation(UTM))])
    with pytest.raises(umbel.Error, match="instances apart"):
        umbel.build_scene(scene, instances="off")
    assert umbel.build_scene(scene, instances="on").report["degenerate_triangles"] == 0


def test_a_place_that_is_flat_is_kept_far_away():
    points, faces = patch(20)
    mesh = umbel.Mesh(points - UTM, faces)
    flat = translation(UTM)
    flat[2, 2] = 0.0
    scene = Scene([mesh], [], [Instance(0, translation(UTM)), Instance(0, flat)])
    built = umbel.build_scene(scene, instances="on")
    assert built.report["largest_move"] < 1e-5
    assert np.abs(built.origin - UTM).max() < 4.0
    for lod in built.lods:
        assert np.ptp(lod.mesh(lod.cut(level=0)).positions, axis=0)[:2].min() > 0.9


def test_a_prj_beside_a_file_is_kept(tmp_path):
    points, faces = patch(10)
    write_ply(tmp_path / "map.ply", points, faces)
    assert umbel.load(tmp_path / "map.ply").coordinates == {}
    (tmp_path / "map.prj").write_text("settings of another program")
    assert umbel.load(tmp_path / "map.ply").coordinates == {}
    (tmp_path / "map.prj").write_text(WKT)
    assert umbel.load(tmp_path / "map.ply").coordinates == {"crs": WKT}
    umbel.build_scene(tmp_path / "map.ply").save(tmp_path / "map.umbel")
    asset = umbel.Asset(tmp_path / "map.umbel")
    assert asset.coordinates == {"crs": WKT}
    assert asset.scene_mesh(asset.scene_cuts(level=0)).coordinates == {"crs": WKT}
