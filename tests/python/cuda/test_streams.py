"""Which streams and which memory calls get: a stand-in for the library records them, and does the
work on the processor. The package of arrays stands in for PyTorch, whose memory belongs to
streams."""

from __future__ import annotations

import contextlib
import ctypes
import types

import numpy as np
import pytest

from helpers.cuda_packages import HostArray, packaged
from umbel import cuda
from umbel.cuda import calls
from umbel.cuda.arrays import device_array

POSITIONS = np.random.default_rng(1).normal(size=(300, 3)).astype(np.float32)
TRIANGLES = np.arange(300, dtype=np.int32).reshape(100, 3)


def number(pointer):
    return getattr(pointer, "value", pointer) or 0


class Library:
    """Records calls as (name, stream, scratch address), and what is asked of streams."""

    def __init__(self, real):
        self.real, self.calls, self.waits, self.captured = real, [], [], set()
        self.more = 0

    def __getattr__(self, name):
        real = getattr(self.real, name)

        def call(*given):
            if name == "umbel_cuda_wait":
                self.waits.append(number(given[0]))
            elif name == "umbel_cuda_is_captured":
                given[2]._obj.value = number(given[0]) in self.captured
                return 0
            elif name == "umbel_cuda_put_view":
                self.calls.append((name, number(given[-1]), number(given[1])))
            elif given and isinstance(given[0], ctypes.c_void_p):
                self.calls.append((name, number(given[-1]), number(given[0])))
            result = real(*given)
            if given and given[0] is None:  # asks for the size
                given[1]._obj.value += self.more
            return result

        return call

    def scratch(self, stream):
        return [place for _, where, place in self.calls if where == stream]


class Array(HostArray):
    """Says in which stream it was made, and in which others it is used."""

    def __init__(self, array, stream):
        super().__init__(array)
        self.stream, self.recorded = stream, []

    def record_stream(self, stream):
        self.recorded.append(stream)


class Package:
    """Makes arrays in its current stream."""

    def __init__(self):
        self.current, self.made = 0, []
        self.maker = calls.Maker(
            self.make, lambda: self.current, lambda stream: stream, self.within
        )

    def make(self, shape, dtype):
        array = Array(np.full(shape, 99, dtype), self.current)
        self.made.append(array)
        return array

    @contextlib.contextmanager
    def within(self, stream):
        before, self.current = self.current, stream
        yield
        self.current = before


@pytest.fixture
def library(monkeypatch):
    packaged("processor", monkeypatch)
    stand_in = Library(calls.library())
    monkeypatch.setattr(calls, "_load", lambda path: stand_in)
    return stand_in


@pytest.fixture
def package():
    return Package()


def mesh():
    return HostArray(POSITIONS), HostArray(TRIANGLES)


def test_streams_share_no_scratch_memory(library, package):
    bvh = cuda.Bvh(*mesh(), empty=package.maker, stream=5)
    directions = HostArray(POSITIONS)
    for stream in (5, 7, 5, 7):
        bvh.intersect(mesh()[0], directions, stream=stream)
    assert len(library.scratch(7)) == 2
    assert not set(library.scratch(5)) & set(library.scratch(7))


def test_captured_scratch_memory_is_never_freed(library, package):
    clusters = cuda.FrameClusters(*mesh(), empty=package.maker, stream=5)
    library.captured.add(5)
    clusters.build(mesh()[0], stream=5)
    library.captured.clear()
    (block,) = clusters._scratch._blocks.values()
    place = calls.address(block)
    library.more = 1 << 20
    clusters.build(mesh()[0], stream=5)
    (other,) = clusters._scratch._blocks.values()
    assert calls.address(other) != place
    assert any(kept is block for kept in clusters._scratch._kept)


def test_memory_belongs_to_the_stream_of_its_call(library, package):
    bvh = cuda.Bvh(*mesh(), empty=package.maker, stream=5)
    assert package.made
    assert {array.stream for array in package.made} == {5}
    tree = list(bvh.arrays.values())
    package.made.clear()
    hits = bvh.intersect(mesh()[0], HostArray(POSITIONS), stream=7)
    assert {array.stream for array in package.made} == {7}  # scratch memory as well
    assert all(array.recorded == [] for array in hits.values())
    assert all(array.recorded == [7] for array in tree)
    assert package.current == 0


def test_what_is_read_is_waited_for_in_its_stream(library, package):
    clusters = cuda.FrameClusters(*mesh(), empty=package.maker, stream=5)
    clusters.refit(mesh()[0], stream=6)
    assert library.waits == []
    clusters.area_growth()
    assert library.waits == [6]
    bvh = cuda.Bvh(*mesh(), empty=package.maker, stream=5)
    bvh.info()
    boxes = HostArray(np.hstack([POSITIONS - 1, POSITIONS + 1]))
    bvh.overlaps(boxes, stream=8)
    assert library.waits == [6, 5, 8]


def test_who_writes_an_array_in_another_stream_is_waited_for(library):
    array = types.SimpleNamespace(
        __cuda_array_interface__={
            "shape": (2, 3),
            "typestr": "<f4",
            "data": (4096, False),
            "version": 3,
            "stream": 9,
        }
    )
    device_array(array, "positions", ("f4",), 3, stream=9)
    assert library.waits == []
    device_array(array, "positions", ("f4",), 3, stream=5)
    assert library.waits == [9]
    array.__cuda_array_interface__["stream"] = 1  # the default stream
    device_array(array, "positions", ("f4",), 3)
    assert library.waits == [9]
    array.__cuda_array_interface__["stream"] = None  # nobody writes it
    device_array(array, "positions", ("f4",), 3, stream=5)
    assert library.waits == [9]


def test_arrays_of_the_host_are_copied_in_and_back(library):
    clusters = cuda.FrameClusters(POSITIONS, TRIANGLES)
    found = clusters.arrays
    assert type(found["items"]) is np.ndarray
    assert np.array_equal(np.sort(found["items"]), np.arange(100))
    assert np.array_equal(found["triangles"], TRIANGLES[found["items"]])
    clusters.refit(POSITIONS * 2)
    count = int(clusters.arrays["count"][0])
    assert clusters.arrays["boxes"][:count].max() == (POSITIONS * 2).max()
    bvh = cuda.Bvh(POSITIONS, TRIANGLES)
    middles = POSITIONS[TRIANGLES].mean(axis=1, dtype=np.float32)
    near = bvh.closest_point(middles)
    assert np.allclose(near["point"], middles, atol=1e-5)
    assert bvh.intersect(middles, middles)["t"].shape == (100,)
    offsets, primitives = bvh.overlaps(np.hstack([middles - 9, middles + 9]))
    assert (np.diff(offsets) == 100).all()
    assert primitives.shape == (10000,)


def test_a_view_is_put_into_the_stream_without_a_copy(library, package):
    umbel = pytest.importorskip("umbel._umbel") and pytest.importorskip("umbel")
    lod = umbel.build_lod(umbel.shapes.blob(3, seed=7), max_triangles=32, group_size=(4, 8))
    rows = np.zeros((20, 3, 4), np.float32)
    rows[:, :, :3] = np.eye(3)
    transforms = HostArray(rows.reshape(-1, 12))
    puts = []

    def put(array):
        puts.append(array)
        return HostArray(array)

    selector = cuda.Selector(lod.tables, transforms, empty=package.maker, put=put, stream=5)
    puts.clear()
    view = umbel.Camera((1, 2, 3), target=(0, 0, 0), pixel_error=2).view()
    chosen = [selector.select(transforms, view, stream=5) for _ in range(2)]
    assert puts == []
    put_views = [call for call in library.calls if call[0] == "umbel_cuda_put_view"]
    assert [call[1] for call in put_views] == [5, 5]
    assert put_views[0][2] == put_views[1][2]  # a captured graph writes there again
    assert library.waits == []
    assert len(chosen[0].cuts()) == 20
    assert set(library.waits) == {5}


def test_a_whole_frame_is_in_one_stream_and_waits_for_nothing(library, package):
    clusters = cuda.FrameClusters(*mesh(), max_triangles=16, empty=package.maker, stream=5)
    bvh = clusters.bvh(mesh()[0], empty=package.maker, stream=5)
    origins = HostArray(POSITIONS[TRIANGLES].mean(axis=1, dtype=np.float32) * 2)
    directions = HostArray(-origins.array)
    addresses = []
    for turn in range(3):
        library.calls.clear()
        positions = HostArray(POSITIONS + np.float32(turn) * POSITIONS[:, ::-1])
        clusters.build(positions, stream=5)
        bvh.build(positions, stream=5)
        hits = bvh.intersect(origins, directions, stream=5)
        names = [name for name, _, _ in library.calls]
        assert names == [
            "umbel_cuda_build_frame_clusters",
            "umbel_cuda_measure_frame_clusters",
            "umbel_cuda_build_cluster_bvh",
            "umbel_cuda_intersect",
        ]
        assert {stream for _, stream, _ in library.calls} == {5}
        addresses.append([place for _, _, place in library.calls])
        whole = cuda.Bvh(positions, mesh()[1], empty=package.maker, stream=5)
        expected = whole.intersect(origins, directions, stream=5)
        for name in ("t", "primitive", "uv"):
            assert np.array_equal(hits[name].array, expected[name].array)
        assert np.isfinite(hits["t"].array).any()
    assert library.waits == []
    assert addresses[1] == addresses[2]  # so a captured graph may be replayed
