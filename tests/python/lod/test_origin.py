"""Assets far from zero: cuts, pages, pictures, poses and what the command says."""

import numpy as np
import pytest

import umbel
from helpers.far_away import ROUND, UTM, WKT, moved, on_grid, patch, translation, write_ply, xyz
from helpers.reference_reader import Reader
from umbel.io.scene import Instance, Scene
from umbel.trace.cut_renderer import CutRenderer


def test_a_camera_sees_the_same_far_away(tmp_path):
    near = on_grid(umbel.shapes.blob(5, 1))
    here, there = umbel.build_lod(near), umbel.build_lod(moved(near, ROUND))
    assert np.array_equal(there.origin, ROUND) and np.array_equal(there.nodes, here.nodes)
    there.save(tmp_path / "a.umbel")
    asset = umbel.Asset(tmp_path / "a.umbel")
    sizes = set()
    for eye in ([0.0, 0.0, 3.0], [1.5, 0.25, -0.5], [40.0, 1.0, 2.0]):
        camera = umbel.Camera(eye, [0.0, 0.0, 0.0], height=500, pixel_error=2.0)
        away = umbel.Camera(ROUND + eye, ROUND, height=500, pixel_error=2.0)
        truth = here.cut(camera=camera)
        sizes.add(len(truth))
        np.testing.assert_array_equal(there.cut(camera=away), truth)
        np.testing.assert_array_equal(asset.cut(camera=away), truth)
        (shown,) = asset.scene_cuts(camera=away)
        np.testing.assert_array_equal(shown.cut, truth)
        planes = away.planes(1.0)
        assert planes.dtype == np.float64
        seen = here.cut(camera=camera, planes=camera.planes(1.0))
        np.testing.assert_array_equal(there.cut(camera=away, planes=planes), seen)
        budget = here.cut(camera=camera, triangles=3000)
        np.testing.assert_array_equal(there.cut(camera=away, triangles=3000), budget)
        places = [translation(np.array([x, 0.0, 0.0])) for x in (-3.0, 0.0, 3.0)]
        cuts = here.tables.instance_cuts(places, here.tables.view(camera=camera))
        moved_cuts = there.tables.instance_cuts(places, there.tables.view(camera=away))
        for one, other in zip(cuts, moved_cuts, strict=True):
            np.testing.assert_array_equal(one, other)
    assert len(sizes) > 1


def test_the_geometry_of_an_asset_is_the_same_far_away(tmp_path):
    near = on_grid(umbel.shapes.blob(5, 1))
    for mesh, name in ((near, "here"), (moved(near, ROUND), "there")):
        umbel.build_lod(mesh).save(tmp_path / f"{name}.umbel")
    here, there = Reader(tmp_path / "here.umbel"), Reader(tmp_path / "there.umbel")
    assert "ORIG" not in here.sections and here.origin == (0.0, 0.0, 0.0)
    assert there.origin == tuple(ROUND)
    (a, size, *_), (b, *_) = here.pages[0], there.pages[0]
    assert here.data[a:] == there.data[b:] and size > 0
    assert here.meshes == there.meshes and here.roots == there.roots


def test_a_picture_from_pages_is_the_same_far_away(tmp_path):
    ball, pictures = on_grid(umbel.shapes.blob(4, 1)), []
    for at in (np.zeros(3), ROUND):
        places = [Instance(0, translation(at + xyz(x, 0.0, 0.0))) for x in (-2.0, 2.0)]
        umbel.build_scene(Scene([ball], [], places), instances="on").save(tmp_path / "a.umbel")
        asset = umbel.Asset(tmp_path / "a.umbel")
        camera = umbel.Camera(at + xyz(0.0, 1.0, 6.0), at, fov_y=0.8, height=24)
        renderer = CutRenderer(asset, camera, 1 << 24)
        film = renderer.film(camera, width=32, height=24)
        pictures.append(film.add(2).pixels)
        assert renderer.view("auto:35,15", 32, 24).target is not None
    np.testing.assert_allclose(pictures[0], pictures[1], atol=1e-3)
    assert np.ptp(pictures[0]) > 0.1


def test_instances_far_away_have_the_cuts_of_near_ones(tmp_path):
    ball = on_grid(umbel.shapes.blob(4, 1))
    places = [np.array([4.0 * k, 0.0, 0.0]) for k in range(5)]
    cuts = []
    for at in (np.zeros(3), UTM):
        scene = Scene([ball], [], [Instance(0, translation(at + p)) for p in places])
        umbel.build_scene(scene, instances="on").save(tmp_path / "a.umbel")
        asset = umbel.Asset(tmp_path / "a.umbel")
        camera = umbel.Camera(at + xyz(0.0, 0.0, 4.0), height=300, pixel_error=1.0)
        shown = asset.scene_cuts(camera=camera)
        cuts.append([len(one.cut) for one in shown])
        np.testing.assert_allclose(
            [one.transform[:, 3] for one in shown], [at + p for p in places], atol=1e-6
        )
    assert cuts[0] == cuts[1] and len(set(cuts[0])) > 1


def test_pages_load_for_a_camera_in_the_world(tmp_path):
    lod = umbel.build_lod(moved(umbel.shapes.blob(5, 1), UTM))
    lod.save(tmp_path / "a.umbel")
    asset = umbel.Asset(tmp_path / "a.umbel")
    residency = umbel.Residency(asset)
    camera = umbel.Camera(UTM + xyz(0.0, 0.0, 3.0), UTM, height=300)
    for _ in range(2000):
        if not residency.step([camera], aspect=None)["missing_groups"]:
            break
    assert np.array_equal(residency.cut(), asset.cut(camera=camera))
    residency.close()


@pytest.mark.parametrize("ground", [False, True])
def test_a_picture_is_the_same_far_away(ground):
    near = on_grid(umbel.shapes.blob(3, 1))
    by = ROUND
    far = moved(near, by)
    assert np.array_equal(far.positions, near.positions) and np.array_equal(far.origin, by)
    size = {"width": 48, "height": 32, "samples": 2, "ground": ground}
    np.testing.assert_array_equal(umbel.render(near, **size), umbel.render(far, **size))
    eye, target = np.array([2.0, 1.0, 2.5]), np.zeros(3)
    here = umbel.render(near, camera=umbel.Camera(eye, target, fov_y=0.7), **size)
    there = umbel.render(far, camera=umbel.Camera(by + eye, by + target, fov_y=0.7), **size)
    np.testing.assert_array_equal(here, there)


def test_bounds_of_poses_far_away():
    near = on_grid(umbel.shapes.sphere(4))
    far = moved(near, UTM)
    options = {"keep_area": False}
    here, there = umbel.build_lod(near, **options), umbel.build_lod(far, **options)
    pose = near.positions * [1.5, 1.0, 1.0]
    a = umbel.deforming_tables(here, near, [pose])
    b = umbel.deforming_tables(there, far, [pose + UTM, umbel.Mesh(pose + UTM, near.triangles)])
    assert np.array_equal(b.origin, there.origin)
    np.testing.assert_allclose(
        b.clusters["box_max"].max(axis=0) + b.origin, a.clusters["box_max"].max(axis=0) + UTM
    )
    assert len(b.cut(camera=umbel.Camera(UTM + xyz(0, 0, 3), height=200))) > 0


def test_clusters_of_frames_are_relative_to_the_first():
    points, faces = patch(40)
    clusters = umbel.FrameClusters(umbel.Mesh(points, faces))
    sizes = np.ptp(clusters.boxes.reshape(-1, 2, 3), axis=1)
    assert sizes.max() < 2.0
    clusters.update(points + xyz(0.0, 0.0, 1.0))
    low = clusters.boxes[:, :3].min(axis=0) + clusters.origin
    np.testing.assert_allclose(low, points.min(axis=0) + xyz(0.0, 0.0, 1.0), atol=1e-5)


def test_the_command_speaks_of_the_world(umbel_command, tmp_path):
    points, faces = patch(30)
    write_ply(tmp_path / "map.ply", points, faces)
    (tmp_path / "map.prj").write_text(WKT)
    asset, back = tmp_path / "map.umbel", tmp_path / "back.ply"
    assert umbel_command("build", tmp_path / "map.ply", "-o", asset, "--json").json["largest_move"]
    for path in (tmp_path / "map.ply", asset):
        said = umbel_command("info", path, "--json").json
        np.testing.assert_allclose(said["bounds"], [points.min(0), points.max(0)], atol=1e-6)
        assert np.abs(np.array(said["origin"]) - UTM).max() < 4.0
        assert said["coordinates"] == {"crs": WKT}
    assert umbel_command("extract", asset, "--level", 0, "-o", back).status == 0
    assert b"property double x" in back.read_bytes()[:200]
    middle = points.mean(axis=0)
    ends = [",".join(map(repr, end.tolist())) for end in (middle + xyz(0.5, 0.5, 3.0), middle)]
    view = ["--camera", f"{ends[0]}:{ends[1]}:40", "--up", "z", "--width", 32, "--height", 24]
    for source in (asset, tmp_path / "map.ply"):
        said = umbel_command(
            "render", source, "-o", tmp_path / "a.png", *view, "--spp", 1, "--json"
        ).json
        np.testing.assert_allclose(said["position"], middle + xyz(0.5, 0.5, 3.0), atol=1e-5)
        assert said["triangles"] > 0


def test_moving_a_mesh_moves_nothing_that_was_made_of_it():
    mesh = moved(on_grid(umbel.shapes.sphere(2)), UTM)
    lod, scene = umbel.build_lod(mesh), umbel.build_scene(mesh, instances="off")
    frames, renderer = umbel.FrameClusters(mesh), umbel.Renderer(mesh)
    welded = umbel.weld(mesh)
    before = mesh.origin.copy()
    mesh.origin += 1000
    for made in (lod, scene, frames, renderer, welded):
        np.testing.assert_array_equal(made.origin, before)
    lod.mesh(lod.cut(level=0)).origin += 1000
    np.testing.assert_array_equal(lod.origin, before)
