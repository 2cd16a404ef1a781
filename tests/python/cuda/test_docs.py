"""The examples of docs/cuda.md and umbel_cuda_trace.h: those of Python run on the processor, with
a stand-in for PyTorch; those of C++ and C compile."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import types

import numpy as np
import pytest

from helpers.commands import ROOT
from helpers.cuda_packages import Processor
from umbel import cuda

umbel = pytest.importorskip("umbel._umbel") and pytest.importorskip("umbel")


def examples(language):
    text = (ROOT / "docs/cuda.md").read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


# ---- Python


class Tensor(np.ndarray):
    """An array of the processor that looks like a tensor of PyTorch on a device."""

    device = "cuda"

    @property
    def __cuda_array_interface__(self):
        return self.__array_interface__ | {"strides": self.strides}

    def cpu(self):
        return self

    def cuda(self):
        return self

    def to(self, device):
        assert device == "cuda"
        return self

    def numpy(self):
        return np.asarray(self)


Tensor.__module__ = "torch"


def tensor(values, dtype=None, device="cuda"):
    return np.array(values, dtype).view(Tensor)


@pytest.fixture
def torch(monkeypatch):
    if not Processor.library.is_file():
        pytest.skip(f"{Processor.library.name} is not built")
    monkeypatch.setenv("UMBEL_CUDA_LIBRARY", str(Processor.library))
    module = types.ModuleType("torch")
    for name in ("float32", "int32", "int64", "uint8"):
        setattr(module, name, np.dtype(name))
    module.tensor = tensor
    module.from_numpy = lambda array: array.view(Tensor)
    module.empty = lambda shape, dtype, device: tensor(np.full(shape, 99, dtype))
    stream = types.SimpleNamespace(cuda_stream=0)
    module.cuda = types.SimpleNamespace(current_stream=lambda device: stream)
    monkeypatch.setitem(sys.modules, "torch", module)
    return module


def on_device(mesh):
    return {
        "positions": tensor(mesh.positions, np.float32),
        "new_positions": tensor(np.asarray(mesh.positions) * 1.5, np.float32),
        "triangles": tensor(mesh.triangles, np.int32),
    }


def run_example(word, names):
    (example,) = [text for text in examples("python") if word in text]
    exec(compile(example, "docs/cuda.md", "exec"), names)
    return names


def test_clusters_of_frames(torch):
    names = run_example("clusters.refit", on_device(umbel.shapes.blob(3, seed=1)))
    arrays = names["clusters"].arrays
    count = int(arrays["count"][0])
    assert 1 < count < 200
    assert arrays["offsets"][count] == len(names["triangles"])


def test_a_tree_over_clusters(torch):
    names = on_device(umbel.shapes.sphere(3)) | {"cuda": cuda}
    directions = np.random.default_rng(1).normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    names |= {"origins": tensor(np.zeros((200, 3)), np.float32)}
    names |= {"directions": tensor(directions, np.float32)}
    t = run_example("clusters.bvh", names)["hits"]["t"]
    assert np.allclose(t, 1.5, atol=0.03)


def test_hierarchies(torch):
    names = on_device(umbel.shapes.blob(3, seed=1))
    bvh = run_example("bvh.refit", names | {"cuda": cuda})["bvh"]
    assert np.allclose(bvh.info().bounds[1], names["new_positions"].max(axis=0))


def test_rays_by_tensors(torch, monkeypatch):
    mesh = umbel.shapes.sphere(3)
    trimesh = types.ModuleType("trimesh")
    trimesh.load = lambda path: types.SimpleNamespace(
        vertices=np.asarray(mesh.positions, np.float64), faces=np.asarray(mesh.triangles)
    )
    monkeypatch.setitem(sys.modules, "trimesh", trimesh)
    directions = tensor(np.random.default_rng(1).normal(size=(500, 3)), np.float32)
    origins = tensor(np.zeros((500, 3)), np.float32)
    points = run_example("trimesh", {"origins": origins, "directions": directions})["points"]
    assert np.allclose(np.linalg.norm(points, axis=1), 1, atol=0.02)


def test_selection(torch):
    lod = umbel.build_lod(umbel.shapes.blob(4, seed=7), max_triangles=32, group_size=(4, 8))
    rows = np.zeros((20, 3, 4), np.float32)
    rows[:, :, :3] = np.eye(3)
    pages = np.arange(len(lod.tables.groups)) // 4
    camera = umbel.Camera((1, 2, 3), target=(0, 0, 0), pixel_error=2)
    names = {
        "cuda": cuda,
        "asset": lod,
        "pages": pages,
        "resident": tensor(np.ones(pages.max() + 1), np.uint8),
        "transforms": tensor(rows.reshape(-1, 12), np.float32),
        "camera": camera,
        "planes": tensor(camera.planes(1.0), np.float32),
    }
    chosen = run_example("Selector", names)["chosen"]
    offsets = np.asarray(chosen.offsets)
    assert offsets[0] == 0
    assert (np.diff(offsets) == len(chosen.cuts()[0])).all()


# ---- C++ and C

CPP = """
#include "umbel/cuda.hpp"
int cudaMalloc(void** memory, size_t bytes);
namespace {
umbel::Vec3 *positions, *origins, *directions;
uint32_t *indices, *primitives;
float *t, *uvs;
uint32_t triangles, count;
umbel::cuda::DeviceMesh mesh;
umbel::cuda::DeviceClusters clusters;
umbel::cuda::DeviceBvh bvh;
void* scratch;
size_t bytes;
umbel::cuda::Stream stream;
}
void example() {
%s
}
"""
C = """
#include <stddef.h>
#include "umbel/umbel_cuda_trace.h"
int cudaMalloc(void** memory, size_t bytes);
void example(const float* origins, const float* directions, uint64_t ray_count, float* t,
             uint32_t* primitives, umbel_cuda_bvh bvh, void* stream) {
  void* scratch;
  size_t bytes;
%s
}
"""


def compiles(text, tmp_path, suffix, *options):
    compiler = shutil.which("c++")
    if compiler is None:
        pytest.skip("there is no C++ compiler here")
    source = tmp_path / f"example{suffix}"
    source.write_text(text)
    done = subprocess.run(
        [compiler, *options, "-fsyntax-only", f"-I{ROOT}/include", source],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_examples_of_cpp_compile(tmp_path):
    found = examples("cpp")
    assert len(found) == 3
    for example in found:
        compiles(CPP % example, tmp_path, ".cpp", "-std=c++20")


def test_the_example_of_c_compiles(tmp_path):
    head = (ROOT / "include/umbel/umbel_cuda_trace.h").read_text(encoding="utf-8")
    lines = re.findall(r"^//   (.*)$", head.split("#ifndef")[0], re.MULTILINE)
    assert len(lines) == 5
    compiles(C % "\n".join(lines), tmp_path, ".c", "-x", "c", "-std=c11")
