"""Meshes far from zero, as on maps: nothing of their positions is lost."""

import json
import struct
import warnings

import numpy as np
import pytest

import umbel
from reference_reader import Reader
from umbel.geometry.origin import is_far, localize
from umbel.io.scene import Instance, Scene
from umbel.trace.cut_renderer import CutRenderer

UTM = np.array([500000.0, 4649776.0, 312.5])
EARTH = np.array([4027893.75, 307045.5, 4919474.125])


def patch(cells=99, step=0.05, at=UTM):
    """A wavy height field around a place on a map: float64 points, and triangles."""
    x, y = np.meshgrid(np.arange(cells + 1) * step, np.arange(cells + 1) * step)
    points = np.stack([x, y, 0.3 * np.sin(3 * x) * np.cos(2 * y)], axis=-1).reshape(-1, 3) + at
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).reshape(-1)
    a, b, c, d = corner, corner + 1, corner + cells + 1, corner + cells + 2
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)]).astype(np.uint32)
    return points, faces


def degenerate(points, faces):
    p = np.asarray(points, np.float64)
    a, b, c = (p[faces[:, k]] for k in range(3))
    return int((~np.cross(b - a, c - a).any(axis=1)).sum())


def write_ply(path, points, faces):
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(points)}",
        *(f"property double {axis}" for axis in "xyz"),
        f"element face {len(faces)}",
        "property list uchar uint vertex_indices",
        "end_header\n",
    ]
    rows = np.empty(len(faces), [("n", "u1"), ("v", "<u4", 3)])
    rows["n"], rows["v"] = 3, faces
    path.write_bytes("\n".join(header).encode() + points.astype("<f8").tobytes() + rows.tobytes())


def write_obj(path, points, faces):
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
    path.write_text("\n".join(lines) + "\n")


def write_stl(path, points, faces):
    lines = ["solid patch"]
    for face in faces.tolist():
        lines.append("facet normal 0 0 0\nouter loop")
        lines += ["vertex {!r} {!r} {!r}".format(*points[i].tolist()) for i in face]
        lines.append("endloop\nendfacet")
    path.write_text("\n".join([*lines, "endsolid patch", ""]))


def write_gltf(path, positions, faces, nodes):
    """Nodes that all show one mesh."""
    indices = faces.astype("<u4").tobytes()
    data = positions.astype("<f4").tobytes() + indices
    low, high = positions.min(axis=0).tolist(), positions.max(axis=0).tolist()
    root = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": [{"mesh": 0, **node} for node in nodes],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": [
            {"buffer": 0, "byteLength": len(data) - len(indices)},
            {"buffer": 0, "byteOffset": len(data) - len(indices), "byteLength": len(indices)},
        ],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": len(positions),
                "type": "VEC3",
                "min": low,
                "max": high,
            },
            {"bufferView": 1, "componentType": 5125, "count": faces.size, "type": "SCALAR"},
        ],
    }
    text = json.dumps(root).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    chunks += struct.pack("<II", len(data), 0x004E4942) + data
    path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)


def sphere():
    ball = umbel.shapes.sphere(4)
    assert len(ball.positions) == 2562
    return ball


def xyz(*values):
    return np.array(values, np.float64)


def moved(mesh, by):
    """The mesh elsewhere: the same positions, and an origin."""
    return umbel.Mesh(mesh.positions.astype(np.float64) + by, mesh.triangles)


def distinct(points):
    return len(np.unique(points, axis=0))


def on_grid(mesh, step=2.0**-12):
    """Positions that float64 still holds exactly when they are moved far away."""
    return umbel.Mesh((np.round(mesh.positions / step) * step).astype(np.float32), mesh.triangles)


# --- choosing an origin -------------------------------------------------------------------------


def test_points_near_zero_have_no_origin():
    rng = np.random.default_rng(1)
    points = rng.normal(size=(100, 3)) + 5.0
    origin, local = localize(points)
    assert not origin.any()
    np.testing.assert_array_equal(local, points.astype(np.float32))


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


# --- files --------------------------------------------------------------------------------------


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


# --- losses that cannot be kept out -------------------------------------------------------------


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


def translation(by):
    matrix = np.eye(4)
    matrix[:3, 3] = by
    return matrix


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


# --- cuts and pictures --------------------------------------------------------------------------


#: Round enough to be the origin of what is moved by it.
ROUND = np.array([2.0**19, 2.0**22, -(2.0**16)])


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


# --- rays, distances, overlaps ------------------------------------------------------------------

STRUCTURES = [umbel.Bvh, umbel.KdTree, umbel.TwoLevelGrid, umbel.IntervalHierarchy]


def nearest_hits(points, faces, origins, directions):
    """t of the nearest hit of each ray in doubles (Moeller & Trumbore 1997), or infinity."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    out = np.full(len(origins), np.inf)
    for i, (o, d) in enumerate(zip(origins, directions, strict=True)):
        with np.errstate(all="ignore"):
            p = np.cross(d, c - a)
            inverse = 1 / np.einsum("ij,ij->i", b - a, p)
            s = o - a
            u = np.einsum("ij,ij->i", s, p) * inverse
            q = np.cross(s, b - a)
            v = (q @ d) * inverse
            t = np.einsum("ij,ij->i", c - a, q) * inverse
            hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0)
        out[i] = t[hit].min(initial=np.inf)
    return out


@pytest.mark.parametrize("structure", STRUCTURES)
def test_rays_hit_where_doubles_say(structure):
    points, faces = patch(30)
    rng = np.random.default_rng(2)
    size = np.ptp(points, axis=0).max()
    targets = points.min(axis=0) + rng.random((200, 3)) * np.ptp(points, axis=0)
    origins = targets + rng.normal(size=(200, 3)) * size
    directions = targets - origins
    truth = nearest_hits(points, faces, origins, directions)
    found = structure(points, faces).intersect(origins, directions)
    assert np.isfinite(truth).any()
    assert (np.isfinite(found.t) != np.isfinite(truth)).sum() <= 1
    both = np.isfinite(truth) & np.isfinite(found.t)
    np.testing.assert_allclose(found.t[both], truth[both], atol=1e-4)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_distances_and_overlaps_are_in_the_world(structure):
    near = on_grid(umbel.shapes.sphere(3))
    here, there = structure(near), structure(moved(near, UTM))
    rng = np.random.default_rng(3)
    points = np.round(rng.normal(size=(100, 3)) * 4096) / 4096
    a, b = here.closest_point(points), there.closest_point(points + UTM)
    assert b.point.dtype == np.float64
    np.testing.assert_allclose(b.point - UTM, a.point, atol=2e-6)
    np.testing.assert_allclose(b.distance, a.distance, atol=2e-6)
    np.testing.assert_array_equal(there.contains(points + UTM), here.contains(points))
    np.testing.assert_allclose(
        there.signed_distance(points + UTM), here.signed_distance(points), atol=2e-6
    )
    np.testing.assert_allclose(there.bounds, here.bounds + UTM, atol=1e-6)
    low, high = np.array([0.1, 0.2, 0.3]), np.array([0.9, 0.8, 0.7])
    np.testing.assert_array_equal(
        there.overlaps_box(low + UTM, high + UTM), here.overlaps_box(low, high)
    )
    np.testing.assert_array_equal(
        there.overlaps_sphere(low + UTM, 0.9), here.overlaps_sphere(low, 0.9)
    )
    planes = umbel.Camera([0, 0, 3], [0, 0, 0]).planes(1.0, far=10.0)
    away = umbel.Camera(UTM + xyz(0, 0, 3), UTM).planes(1.0, far=10.0)
    np.testing.assert_array_equal(there.overlaps_frustum(away), here.overlaps_frustum(planes))


def test_a_hierarchy_follows_moved_vertices_in_the_world():
    points, faces = patch(20)
    bvh = umbel.Bvh(points, faces)
    bvh.refit(points + xyz(0.0, 0.0, 2.0))
    np.testing.assert_allclose(
        bvh.bounds[:, 2], points[:, 2].min() + 2 + np.array([0, np.ptp(points[:, 2])])
    )


def test_files_of_hierarchies_say_that_they_hold_no_origin(tmp_path):
    points, faces = patch(20)
    for structure, name in ((umbel.Bvh, "a.umbvh"), (umbel.KdTree, "a.umkd")):
        made = structure(points, faces)
        with pytest.warns(UserWarning, match="does not hold the origin"):
            made.save(tmp_path / name)
        again = structure.load(tmp_path / name, origin=made.origin)
        np.testing.assert_array_equal(again.bounds, made.bounds)


# --- meshes that move ---------------------------------------------------------------------------


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


# --- what files say of their coordinates --------------------------------------------------------

WKT = 'PROJCS["WGS 84 / UTM zone 33N",GEOGCS["WGS 84"],UNIT["metre",1]]'


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


# --- the command --------------------------------------------------------------------------------


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
