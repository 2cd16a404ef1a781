"""umbel.cuda with arrays of PyTorch, CuPy and Numba on a device, and with arrays of the processor:
what they hold afterwards, by NumPy. Most needs nothing of the package that is compiled, so `make
gpu` runs it from the sources."""

from __future__ import annotations

import importlib

import numpy as np
import pytest

from helpers.cuda_packages import ON_PROCESSOR, PACKAGES, HostArray, Processor, packaged
from umbel import cuda
from umbel.cluster.area_growth import RebuildPolicy

SIDE = 120


def height_field():
    """Positions (n, 3) and triangles (m, 3)."""
    y, x = np.mgrid[:SIDE, :SIDE].astype(np.float32)
    z = 9 * np.sin(0.1 * x) * np.cos(0.13 * y)
    positions = np.stack([x, y, z], axis=-1).reshape(-1, 3).astype(np.float32)
    corner = np.arange(SIDE * SIDE, dtype=np.int32).reshape(SIDE, SIDE)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    triangles = np.stack([a, b, c, b, d, c], axis=-1).reshape(-1, 3)
    return positions, triangles


def twisted(positions, turns):
    angle = turns * 2 * np.pi * positions[:, :1] / SIDE
    y, z = positions[:, 1:2] - SIDE / 2, positions[:, 2:]
    twisted = [positions[:, :1], np.cos(angle) * y - np.sin(angle) * z]
    return np.hstack([*twisted, np.sin(angle) * y + np.cos(angle) * z]).astype(np.float32)


@pytest.fixture(params=PACKAGES)
def package(request, monkeypatch):
    return packaged(request.param, monkeypatch)


@pytest.fixture
def torch_package(monkeypatch):
    return packaged("torch", monkeypatch)


def clusters_of(package, positions, triangles, *method, **settings):
    return cuda.FrameClusters(
        package.put(positions), package.put(triangles), *method, **settings, **package.options
    )


def arrays_of(package, clusters):
    found = {name: package.get(array) for name, array in clusters.arrays.items()}
    count = int(found["count"][0])
    found["offsets"], found["boxes"] = found["offsets"][: count + 1], found["boxes"][:count]
    return found


def expect_sound(package, clusters, positions, triangles):
    found = arrays_of(package, clusters)
    items, offsets = found["items"], found["offsets"]
    assert np.array_equal(np.sort(items), np.arange(len(triangles)))
    assert np.array_equal(found["triangles"], triangles[items])
    assert offsets[0] == 0
    assert offsets[-1] == len(triangles)
    sizes = np.diff(offsets)
    assert sizes.min() >= 32
    assert sizes.max() <= 128
    corners = positions[triangles[items]]
    low = np.minimum.reduceat(corners.min(axis=1), offsets[:-1])
    high = np.maximum.reduceat(corners.max(axis=1), offsets[:-1])
    assert np.array_equal(found["boxes"], np.hstack([low, high]))


def test_builds_updates_and_refits_are_sound(package):
    positions, triangles = height_field()
    clusters = clusters_of(package, positions, triangles)
    expect_sound(package, clusters, positions, triangles)
    assert clusters.area_growth().growth == 1
    moved = twisted(positions, 1.5)
    clusters.refit(package.put(moved))
    expect_sound(package, clusters, moved, triangles)
    grown = clusters.area_growth()
    assert grown.growth > 1
    clusters.update(package.put(moved))
    expect_sound(package, clusters, moved, triangles)
    assert clusters.area_growth().area_ratio < grown.area_ratio


def test_policies_rebuild_all_or_the_worst(package):
    positions, triangles = height_field()
    clusters = clusters_of(package, positions, triangles)
    moved = twisted(positions, 1.5)
    still, strict = RebuildPolicy(threshold=1.01), RebuildPolicy(threshold=1.01, budget=0.2)
    assert clusters.step(package.put(positions), still, 1) == "keep"
    assert clusters.step(package.put(moved), strict, 2) == "rebuild_worst"
    expect_sound(package, clusters, moved, triangles)
    far = twisted(positions, -1.5)
    assert clusters.step(package.put(far), still, 3) == "rebuild"
    expect_sound(package, clusters, far, triangles)


@pytest.mark.parametrize("method", ["morton", "hybrid"])
@pytest.mark.parametrize("max_vertices", [0, 64])
def test_bytes_are_those_of_the_processor(package, method, max_vertices):
    pytest.importorskip("umbel._umbel")
    umbel = importlib.import_module("umbel")
    positions, triangles = height_field()
    mesh = umbel.Mesh(positions=positions, triangles=triangles.astype(np.uint32))
    expected = umbel.FrameClusters(mesh, method, max_vertices=max_vertices)
    clusters = clusters_of(package, positions, triangles, method, max_vertices=max_vertices)
    found = arrays_of(package, clusters)
    for name in ("items", "triangles", "offsets", "boxes"):
        assert np.array_equal(found[name], getattr(expected, name)), name
    assert clusters.area_growth() == expected.area_growth


def test_rows_may_be_apart(package):
    positions, triangles = height_field()
    vertices = np.full((len(positions), 8), np.nan, np.float32)
    vertices[:, 2:5] = positions
    if isinstance(package, Processor):
        inside = HostArray(vertices[:, 2:5])
    else:
        inside = package.put(vertices)[:, 2:5]
    clusters = cuda.FrameClusters(inside, package.put(triangles), **package.options)
    expect_sound(package, clusters, positions, triangles)


class OnlyDlpack:
    """An array of a package that knows nothing but DLPack."""

    def __init__(self, tensor):
        self.tensor = tensor

    def __dlpack_device__(self):
        return self.tensor.__dlpack_device__()

    def __dlpack__(self, stream=None):
        return self.tensor.__dlpack__(stream=stream)


def test_dlpack_is_enough(torch_package):
    torch = importlib.import_module("torch")
    positions, triangles = height_field()

    def empty(shape, dtype):
        return torch.empty(shape, dtype=getattr(torch, dtype), device="cuda")

    lent = [OnlyDlpack(torch_package.put(array)) for array in (positions, triangles)]
    torch.cuda.synchronize()
    clusters = cuda.FrameClusters(*lent, empty=empty)
    torch.cuda.synchronize()
    expect_sound(torch_package, clusters, positions, triangles)


def test_the_current_stream_is_used(torch_package):
    torch = importlib.import_module("torch")
    positions, triangles = height_field()
    moved = twisted(positions, 1.0)
    indices, target = torch_package.put(triangles), torch_package.put(moved)
    torch.cuda.synchronize()
    with torch.cuda.stream(torch.cuda.Stream()):
        # What comes late in this stream: were another one used, these would be zeros.
        late = torch.zeros_like(target)
        torch.cuda._sleep(50_000_000)
        late.copy_(target)
        clusters = cuda.FrameClusters(late, indices)
        expect_sound(torch_package, clusters, moved, triangles)


def test_graphs_follow_new_positions(torch_package):
    torch = importlib.import_module("torch")
    positions, triangles = height_field()
    place = torch_package.put(positions)
    clusters = cuda.FrameClusters(place, torch_package.put(triangles))
    clusters.build(place)
    clusters.refit(place)  # so that there is scratch memory for both
    torch.cuda.synchronize()
    graph = torch.cuda.CUDAGraph()
    with torch.cuda.graph(graph):
        clusters.build(place)
    for turns in (0.5, 1.5):
        moved = twisted(positions, turns)
        place.copy_(torch_package.put(moved))
        graph.replay()
        torch.cuda.synchronize()
        expect_sound(torch_package, clusters, moved, triangles)


NODE = np.dtype(
    [
        ("origin", "<f4", 3),
        ("exponent", "u1", 3),
        ("inner", "u1"),
        ("first_child", "<u4"),
        ("first_triangle", "<u4"),
        ("meta", "u1", 8),
        ("low", "u1", (3, 8)),
        ("high", "u1", (3, 8)),
    ]
)
TRIANGLE = np.dtype(
    [
        ("p0", "<f4", 3),
        ("primitive", "<u4"),
        ("p1", "<f4", 3),
        ("reserved1", "<u4"),
        ("p2", "<f4", 3),
        ("reserved2", "<u4"),
    ]
)
BUILDERS = ["lbvh", "hlbvh", "atrbvh", "ploc", "hploc", "kmeans", "sweep"]


def tree_of(package, bvh):
    info = bvh.info()
    nodes = package.get(bvh.arrays["nodes"]).reshape(-1).view(NODE)[: info.nodes]
    triangles = package.get(bvh.arrays["triangles"]).reshape(-1).view(TRIANGLE)
    return nodes, triangles[: info.triangles], info


def expect_tree(package, bvh, positions, triangles):
    """Every triangle in one leaf, within the boxes of all slots above it."""
    nodes, found, info = tree_of(package, bvh)
    assert np.array_equal(np.sort(found["primitive"]), np.arange(len(triangles)))
    corners = positions[triangles[found["primitive"]]]
    assert np.array_equal(np.stack([found[p] for p in ("p0", "p1", "p2")], axis=1), corners)
    low, high = corners.min(axis=1), corners.max(axis=1)
    assert info.bounds == (tuple(low.min(axis=0)), tuple(high.max(axis=0)))
    cells = np.ldexp(np.float32(1), nodes["exponent"].astype(int) - 127)
    planes = [
        nodes["origin"][:, :, None] + nodes[name] * cells[:, :, None] for name in ("low", "high")
    ]
    seen = np.zeros(len(triangles), int)

    def visit(index):
        """Ranges of triangles below a node."""
        node, child = nodes[index], int(nodes[index]["first_child"])
        first, all_below = int(node["first_triangle"]), []
        for slot, meta in enumerate(node["meta"]):
            if meta == 0:
                continue
            if meta == 0x80:
                below, child = visit(child), child + 1
            else:
                below, first = [np.arange(first, first + int(meta))], first + int(meta)
                seen[below[0]] += 1
            inside = np.concatenate(below)
            assert (low[inside] >= planes[0][index, :, slot]).all()
            assert (high[inside] <= planes[1][index, :, slot]).all()
            all_below += below
        return all_below

    visit(0)
    assert (seen == 1).all()


def bvh_of(package, positions, triangles, *builder, **settings):
    return cuda.Bvh(
        package.put(positions), package.put(triangles), *builder, **settings, **package.options
    )


@pytest.mark.parametrize("builder", BUILDERS)
def test_trees_are_sound_and_follow_new_positions(package, builder):
    positions, triangles = height_field()
    bvh = bvh_of(package, positions, triangles, builder)
    expect_tree(package, bvh, positions, triangles)
    assert 10 < bvh.info().sah_cost < 100
    moved = twisted(positions, 1.5)
    bvh.refit(package.put(moved))
    expect_tree(package, bvh, moved, triangles)
    bvh.build(package.put(moved))
    expect_tree(package, bvh, moved, triangles)


def test_queries_of_a_height_field(package):
    positions, triangles = height_field()
    masks = np.arange(len(triangles), dtype=np.int32) % 2 + 1
    bvh = bvh_of(package, positions, triangles, masks=package.put(masks))
    middles = positions[triangles].mean(axis=1, dtype=np.float32)
    above = np.array([0, 0, 100], np.float32)
    origins = package.put((middles + above).astype(np.float32))
    down = np.zeros_like(middles)
    down[:, 2] = -2
    directions = package.put(down)
    # A line straight down meets one triangle.
    hits = {name: package.get(a) for name, a in bvh.intersect(origins, directions).items()}
    assert np.array_equal(hits["primitive"], np.arange(len(triangles)))
    assert np.allclose(hits["t"], 50, atol=1e-4)
    assert np.allclose(hits["uv"], 1 / 3, atol=1e-3)
    seen = package.get(bvh.intersect(origins, directions, mask=2)["primitive"])
    assert np.array_equal(seen, np.where(masks == 2, np.arange(len(triangles)), -1))
    dark = package.get(bvh.occluded(origins, directions, mask=1))
    assert np.array_equal(dark, masks == 1)
    near = bvh.closest_point(package.put(positions), max_distance=1)
    assert np.allclose(package.get(near["point"]), positions, atol=1e-4)
    assert np.allclose(package.get(near["distance"]), 0, atol=1e-4)
    boxes = np.hstack([middles - 0.01, middles + 0.01]).astype(np.float32)
    offsets, touching = map(package.get, bvh.overlaps(package.put(boxes)))
    assert np.array_equal(offsets, np.arange(len(triangles) + 1))
    assert np.array_equal(touching, np.arange(len(triangles)))


def test_settings_of_trees(package):
    positions, triangles = height_field()
    single = bvh_of(package, positions, triangles, "lbvh", max_leaf_size=1)
    nodes, _, _ = tree_of(package, single)
    assert set(np.unique(nodes["meta"])) <= {0, 1, 0x80}
    split = bvh_of(package, positions, triangles, "hploc", presplit=0.5)
    _, found, info = tree_of(package, split)
    assert info.triangles == len(triangles) + len(triangles) // 2
    assert np.array_equal(np.unique(found["primitive"]), np.arange(len(triangles)))
    for settings, message in (
        ({"builder": "sah"}, "there is no builder"),
        ({"max_leaf_size": 9}, "must be from 1 to 8"),
        ({"max_leaf_size": -1}, "out of range"),
        ({"max_leaf_size": "8"}, "must be a number"),
        ({"leaf": 3}, "there is no setting 'leaf'"),
    ):
        with pytest.raises(umbel_error(), match=message):
            bvh_of(package, positions, triangles, **settings)


def umbel_error():
    return importlib.import_module("umbel.errors").Error


def test_trees_are_those_of_the_processor(package):
    """Of any device, byte for byte."""
    if not ON_PROCESSOR.is_file():
        pytest.skip(f"there is no {ON_PROCESSOR}")
    positions, triangles = height_field()
    for builder in BUILDERS:
        nodes, found, info = tree_of(package, bvh_of(package, positions, triangles, builder))
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("UMBEL_CUDA_LIBRARY", str(ON_PROCESSOR))
            other = Processor()
            expected = tree_of(other, bvh_of(other, positions, triangles, builder))
        assert info == expected[2]
        assert nodes.tobytes() == expected[0].tobytes()
        assert found.tobytes() == expected[1].tobytes()
