"""examples/cuda/frames.py with a stand-in for CuPy: as on a device, what is captured does not run
then, but each time the graph is launched, in the memory that it was captured with."""

from __future__ import annotations

import contextlib
import runpy
import sys
import types

import numpy as np
import pytest

from helpers.commands import ROOT
from helpers.cuda_packages import Processor
from umbel import cuda
from umbel.cuda import calls

umbel = pytest.importorskip("umbel._umbel") and pytest.importorskip("umbel")

FRAMES = 4


class Capture:
    """What streams are asked to do while they are captured."""

    work: list | None = None

    def do(self, work):
        if self.work is None:
            return work()
        self.work.append(work)
        return None


capture = Capture()


class Array(np.ndarray):
    """An array of the processor that looks like one of CuPy."""

    @property
    def __cuda_array_interface__(self):
        return self.__array_interface__ | {"strides": self.strides}

    def __array_ufunc__(self, ufunc, method, *inputs, out=(), **options):
        plain = [np.asarray(array) if isinstance(array, Array) else array for array in inputs]
        if not out:
            # Its memory is needed now; what is in it is rubbish until the graph is launched.
            made = getattr(ufunc, method)(*plain, **options)
            if capture.work is None or method != "__call__":
                return made.view(Array) if isinstance(made, np.ndarray) else made
            made = np.full_like(made, 99)
            out = (np.asarray(made).view(Array),)
        into = np.asarray(out[0])
        capture.do(lambda: getattr(ufunc, method)(*plain, out=into, **options))
        return out[0]

    def __getitem__(self, key):
        return super().__getitem__((key, ...) if isinstance(key, int) else key)

    def __setitem__(self, key, value):
        into = np.asarray(self)[key]
        capture.do(lambda: np.copyto(into, value))

    def get(self):
        return np.asarray(self)


Array.__module__ = "cupy"


class Library:
    """Calls the library, or lets a graph do it; sizes of scratch memory are told at once."""

    def __init__(self, real):
        self.real = real
        self.captured = []

    def __getattr__(self, name):
        function = getattr(self.real, name)

        def call(*given):
            if name == "umbel_cuda_is_captured":
                given[2]._obj.value = capture.work is not None
                return 0
            assert name != "umbel_cuda_wait" or capture.work is None, "waits while it is captured"
            if capture.work is None or given[0] is None:
                return function(*given)
            self.captured.append(name)
            capture.do(lambda: function(*given))
            return 0

        return call


class Graph:
    def __init__(self, work):
        self.work = work

    def launch(self):
        for work in self.work:
            work()


class Stream(contextlib.nullcontext):
    ptr = 5

    def __init__(self, non_blocking=False):
        super().__init__()

    def synchronize(self):
        assert capture.work is None

    def begin_capture(self):
        capture.work = []

    def end_capture(self):
        work, capture.work = capture.work, None
        return Graph(work)


class Event:
    def record(self):
        pass

    def synchronize(self):
        pass


@pytest.fixture
def library(monkeypatch):
    """The library, and CuPy over it."""
    if not Processor.library.is_file():
        pytest.skip(f"{Processor.library.name} is not built")
    monkeypatch.setenv("UMBEL_CUDA_LIBRARY", str(Processor.library))
    stand_in = Library(calls.library())
    monkeypatch.setattr(calls, "_load", lambda path: stand_in)
    module = types.ModuleType("cupy")
    module.asarray = lambda values, dtype=None: np.array(values, dtype).view(Array)
    module.empty = lambda shape, dtype: np.full(shape, 99, dtype).view(Array)
    module.empty_like = lambda array: module.empty(array.shape, array.dtype)
    module.zeros = lambda shape, dtype: np.zeros(shape, dtype).view(Array)
    module.broadcast_to = lambda array, shape: np.broadcast_to(array, shape, subok=True)
    module.cos, module.sin = np.cos, np.sin
    module.cuda = types.SimpleNamespace(
        Stream=Stream,
        Event=Event,
        ExternalStream=lambda address: Stream(),
        get_current_stream=Stream,
        get_elapsed_time=lambda begin, end: 1.0,
    )
    monkeypatch.setitem(sys.modules, "cupy", module)
    return stand_in


def test_a_frame_is_one_graph(library, monkeypatch, tmp_path, capsys):
    umbel.save(tmp_path / "mesh.ply", umbel.shapes.blob(3, seed=5))
    linspace = np.linspace
    monkeypatch.setattr(np, "linspace", lambda low, high, n: linspace(low, high, n // 40))
    monkeypatch.setattr(sys, "argv", ["frames.py", str(tmp_path / "mesh.ply"), str(FRAMES)])
    names = runpy.run_path(str(ROOT / "examples/cuda/frames.py"), run_name="__main__")
    assert library.captured == [
        "umbel_cuda_build_frame_clusters",
        "umbel_cuda_measure_frame_clusters",
        "umbel_cuda_build_cluster_bvh",
        "umbel_cuda_intersect",
    ]
    # One frame before the graph was captured, and those that it was launched for.
    assert names["time"][0] == pytest.approx(0.02 * (1 + FRAMES))
    angle = names["time"].get() * names["x"].get() / names["size"]
    y, z = names["y"].get(), names["z"].get()
    positions = names["positions"].get()
    assert np.allclose(positions[:, 1], y * np.cos(angle) - z * np.sin(angle), atol=1e-6)
    tree = cuda.Bvh(positions, names["clusters"].arrays["triangles"].get())
    expected = tree.intersect(names["origins"].get(), names["directions"].get())
    hits = names["hits"]
    assert np.isfinite(expected["t"]).sum() > 100
    assert np.array_equal(hits["t"].get(), expected["t"])
    assert f"{len(names['directions'])} rays" in capsys.readouterr().out
