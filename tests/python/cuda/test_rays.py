"""Rays, closest points, overlaps and selection of umbel.cuda, with arrays on a device and with the
same functions on the processor, beside what umbel.Bvh and umbel.Tables answer."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.cuda_packages import PACKAGES, packaged
from umbel import cuda

umbel = pytest.importorskip("umbel._umbel") and pytest.importorskip("umbel")


@pytest.fixture(params=PACKAGES)
def package(request, monkeypatch):
    return packaged(request.param, monkeypatch)


def mesh_and_trees(package, **settings):
    mesh = umbel.shapes.blob(4, seed=3)
    positions = np.asarray(mesh.positions)
    triangles = np.asarray(mesh.triangles).astype(np.int32)
    tree = cuda.Bvh(package.put(positions), package.put(triangles), **settings, **package.options)
    return positions, triangles, tree, umbel.Bvh(mesh)


def some_rays(positions, triangles, count=4000):
    random = np.random.default_rng(4)
    origins = random.uniform(-2, 2, (count, 3)).astype(np.float32)
    targets = random.uniform(-1, 1, (count, 3)).astype(np.float32)
    # At corners, and at the middles of edges.
    corners = positions[triangles[random.integers(len(triangles), size=count)]]
    targets[::3] = corners[::3, 0]
    targets[1::3] = (corners[1::3, 0] + corners[1::3, 1]) / 2
    return origins, targets - origins


def test_rays_hit_what_they_hit_on_the_processor(package):
    positions, triangles, tree, expected = mesh_and_trees(package)
    origins, directions = some_rays(positions, triangles)
    hits = tree.intersect(package.put(origins), package.put(directions))
    t, primitive, uv = (package.get(hits[name]) for name in ("t", "primitive", "uv"))
    truth = expected.intersect(origins, directions)
    assert np.array_equal(t, truth.t)
    assert np.array_equal(primitive, truth.primitive)
    assert np.array_equal(uv, np.stack([truth.u, truth.v], axis=1))
    assert 0.2 < np.isfinite(t).mean() < 1
    any_hit = package.get(tree.occluded(package.put(origins), package.put(directions)))
    assert np.array_equal(any_hit == 1, np.isfinite(t))


def test_intervals_and_back_faces(package):
    positions, triangles, tree, expected = mesh_and_trees(package)
    origins, directions = some_rays(positions, triangles, 1000)
    t_min = np.full(1000, 0.4, np.float32)
    t_max = np.linspace(0.2, 1.4, 1000, dtype=np.float32)
    ends = {"t_min": package.put(t_min), "t_max": package.put(t_max)}
    hits = tree.intersect(
        package.put(origins), package.put(directions), cull_back_faces=True, **ends
    )
    truth = expected.intersect(origins, directions, t_min=t_min, t_max=t_max, cull_back_faces=True)
    assert np.array_equal(package.get(hits["t"]), truth.t)
    dark = tree.occluded(package.put(origins), package.put(directions), **ends)
    lit = expected.occluded(origins, directions, t_min=t_min, t_max=t_max)
    assert np.array_equal(package.get(dark) == 1, lit)


def test_rays_see_triangles_that_share_a_bit_with_their_mask(package):
    mesh = umbel.shapes.blob(3, seed=3)
    triangles = np.asarray(mesh.triangles).astype(np.int32)
    masks = (1 << np.arange(len(triangles)) % 3).astype(np.uint32)
    given = (package.put(np.asarray(mesh.positions)), package.put(triangles))
    tree = cuda.Bvh(*given, masks=package.put(masks.view(np.int32)), **package.options)
    expected = umbel.Bvh(mesh, masks=masks)
    origins, directions = some_rays(np.asarray(mesh.positions), triangles, 1000)
    rays = package.put(origins), package.put(directions)
    for mask in (0, 1, 6, 0xFFFFFFFF):
        truth = expected.intersect(origins, directions, mask=mask)
        found = package.get(tree.intersect(*rays, mask=mask)["primitive"])
        assert np.array_equal(found, truth.primitive)
        lit = package.get(tree.occluded(*rays, mask=mask))
        assert np.array_equal(lit == 1, np.isfinite(truth.t))
    with pytest.raises(umbel.Error, match="mask must have 32 bits, not -1"):
        tree.intersect(*rays, mask=-1)
    with pytest.raises(umbel.Error, match=f"there are {len(triangles)} triangles, but 5 masks"):
        cuda.Bvh(*given, masks=package.put(masks[:5].view(np.int32)), **package.options)


def test_closest_points_are_those_of_the_processor(package):
    positions, _, tree, expected = mesh_and_trees(package)
    points = np.random.default_rng(5).uniform(-2, 2, (2000, 3)).astype(np.float32)
    points[::5] = positions[: len(points[::5])]
    for reach in (np.inf, 0.2):
        found = tree.closest_point(package.put(points), max_distance=reach)
        truth = expected.closest_point(points, max_distance=reach)
        assert np.array_equal(package.get(found["distance"]), truth.distance)
        primitive = package.get(found["primitive"])
        assert np.array_equal(primitive, truth.primitive)
        assert np.array_equal(package.get(found["point"]), truth.point)


@pytest.mark.parametrize("presplit", [0.0, 0.5])
def test_overlaps_are_those_of_the_processor(package, presplit):
    _, _, tree, expected = mesh_and_trees(package, presplit=presplit)
    random = np.random.default_rng(6)
    low = random.uniform(-1.5, 1.2, (200, 3)).astype(np.float32)
    boxes = np.concatenate([low, low + random.uniform(0, 0.5, (200, 3)).astype(np.float32)], axis=1)
    offsets, found = tree.overlaps(package.put(boxes))
    offsets, found = package.get(offsets), package.get(found)
    assert offsets[-1] > 1000
    for i, box in enumerate(boxes):
        truth = expected.overlaps_box(box[:3], box[3:])
        assert np.array_equal(found[offsets[i] : offsets[i + 1]], truth)


def test_nothing_asked_and_nothing_found(package):
    _, _, tree, _ = mesh_and_trees(package)
    none = package.put(np.zeros((0, 3), np.float32))
    assert package.get(tree.intersect(none, none)["t"]).shape == (0,)
    assert package.get(tree.occluded(none, none)).shape == (0,)
    assert package.get(tree.closest_point(none)["distance"]).shape == (0,)
    away = package.put(np.tile(np.float32([9, 9, 9, 10, 10, 10]), (3, 1)))
    offsets, found = (package.get(part) for part in tree.overlaps(away))
    assert offsets.tolist() == [0, 0, 0, 0] and len(found) == 0


def test_mistakes_of_queries_are_named(package):
    _, _, tree, _ = mesh_and_trees(package)
    points = package.put(np.zeros((4, 3), np.float32))
    with pytest.raises(umbel.Error, match="there are 4 origins, but 3 directions"):
        tree.intersect(points, package.put(np.ones((3, 3), np.float32)))
    with pytest.raises(umbel.Error, match=r"t_max must have the shape \(n,\)"):
        tree.intersect(points, points, t_max=points)
    with pytest.raises(umbel.Error, match="max_distance must be at least 0"):
        tree.closest_point(points, max_distance=-1)
    with pytest.raises(umbel.Error, match=r"boxes must have the shape \(n, 6\)"):
        tree.overlaps(points)


# ---- selection


def blob_lod():
    return umbel.build_lod(
        umbel.shapes.blob(5, seed=7), max_triangles=32, max_vertices=64, group_size=(4, 8)
    )


def transforms_of(count):
    random = np.random.default_rng(8)
    rows = np.zeros((count, 3, 4), np.float32)
    rows[:, :, :3] = np.eye(3) + random.uniform(-0.2, 0.2, (count, 3, 3))
    rows[:, :, 3] = random.uniform(-10, 10, (count, 3))
    return rows


def selector_of(package, lod, like, **more):
    options = package.options
    if options:
        options = {**options, "put": package.put}
    return cuda.Selector(lod.tables, like, **options, **more)


def test_cuts_of_instances_are_those_of_the_processor(package):
    lod = blob_lod()
    rows = transforms_of(300)
    camera = umbel.Camera((1, 2, 3), target=(8, 0, 0), pixel_error=2)
    planes = camera.planes(1.5)
    facing = lod.normal_cones()
    transforms = package.put(rows.reshape(-1, 12))
    selector = selector_of(package, lod, transforms, normal_cones=facing)
    chosen = selector.select(transforms, camera.view(), planes=package.put(planes))
    truth = lod.tables.instance_cuts(rows, camera.view(), planes=planes, normal_cones=facing)
    cuts = chosen.cuts()
    assert len(cuts) == len(truth)
    assert all(np.array_equal(a, b) for a, b in zip(cuts, truth, strict=True))
    counts = chosen.counts()
    assert counts.clusters == sum(map(len, truth)) > 300
    assert counts.refused == counts.overflow == 0
    # The view may be on the device.
    words = package.put(cuda.view_words(lod.tables.view(error=0.01)))
    again = selector.select(transforms, words).cuts()
    assert len(again) == 300


def test_a_room_that_is_too_small_is_told(package):
    lod = blob_lod()
    transforms = package.put(transforms_of(50).reshape(-1, 12))
    selector = selector_of(package, lod, transforms)
    view = lod.tables.view(error=0.001)
    needed = selector.select(transforms, view).counts()
    full = selector.select(transforms, view, room=(needed.queue, needed.groups, 100))
    with pytest.raises(umbel.Error, match=f"no room for all clusters: .* {needed.clusters} are"):
        full.cuts()
    exact = selector.select(transforms, view, room=(needed.queue, needed.groups, needed.clusters))
    assert sum(map(len, exact.cuts())) == needed.clusters


def test_pages_that_are_missing_are_asked_for(package):
    lod = blob_lod()
    groups = lod.tables.groups
    pages = np.arange(len(groups)) // 4
    transforms = package.put(transforms_of(20).reshape(-1, 12))
    selector = selector_of(package, lod, transforms, page_of_group=pages)
    view = lod.tables.view(error=0.001)
    with pytest.raises(umbel.Error, match="set_resident must say"):
        selector.select(transforms, view)
    resident = np.zeros(pages.max() + 1, np.uint8)
    resident[pages[np.isinf(groups["error"])]] = 1
    steps = 0
    while True:
        selector.set_resident(package.put(resident))
        chosen = selector.select(transforms, view)
        wanted = chosen.requests()
        if len(wanted) == 0:
            break
        assert not resident[wanted].any()
        urgencies = package.get(chosen.urgencies)
        assert (urgencies[wanted] > 0).all()
        resident[wanted[np.argmax(urgencies[wanted])]] = 1
        steps += 1
    assert steps > 5
    truth = lod.tables.instance_cuts(transforms_of(20), view)
    assert all(np.array_equal(a, b) for a, b in zip(chosen.cuts(), truth, strict=True))


def test_mistakes_of_selection_are_named(package):
    lod = blob_lod()
    transforms = package.put(transforms_of(5).reshape(-1, 12))
    selector = selector_of(package, lod, transforms)
    view = lod.tables.view(error=0.1)
    with pytest.raises(umbel.Error, match="give page_of_group"):
        selector.set_resident(package.put(np.ones(3, np.uint8)))
    with pytest.raises(umbel.Error, match=r"transforms must have the shape \(n, 12\)"):
        selector.select(package.put(transforms_of(5).reshape(-1, 3)), view)
    with pytest.raises(umbel.Error, match="page_of_group must be one a group"):
        selector_of(package, lod, transforms, page_of_group=[1, 2])
