"""Packages of arrays on a device, for tests: PyTorch, CuPy, Numba, and none, with the same
functions on the processor. Needs nothing of the package that is compiled."""

from __future__ import annotations

import importlib

import numpy as np
import pytest

from helpers.commands import BUILD
from umbel import cuda

ON_PROCESSOR = BUILD / "libumbel_cuda_on_processor.so"


class HostArray:
    """An array of the processor that says that it is on a device."""

    def __init__(self, array):
        self.array, self.shape = array, array.shape

    @property
    def __cuda_array_interface__(self):
        return self.array.__array_interface__ | {"strides": self.array.strides}

    def get(self):
        return self.array


class Processor:
    """No package, but the same functions on the processor."""

    library = ON_PROCESSOR
    works = True

    def __init__(self):
        # What is not written would be seen.
        self.options = {"empty": lambda shape, dtype: HostArray(np.full(shape, 99, dtype))}

    def put(self, array):
        return HostArray(array)

    def get(self, array):
        return array.get()


class Device:
    """A package with arrays on a device."""

    name = ""

    def __init__(self):
        self.options = {}
        self.library = cuda.library_path()
        self.package = importlib.import_module(self.name)
        self.cuda = importlib.import_module(f"{self.name}.cuda")
        self.works = self.cuda.is_available()


class Torch(Device):
    name = "torch"

    def put(self, array):
        return self.package.from_numpy(array).cuda()

    def get(self, array):
        return array.cpu().numpy()


class Cupy(Device):
    name = "cupy"

    def put(self, array):
        return self.package.asarray(array)

    def get(self, array):
        return array.get()


class Numba(Device):
    name = "numba"

    def put(self, array):
        return self.cuda.to_device(array)

    def get(self, array):
        return array.copy_to_host()


def packaged(make, monkeypatch):
    try:
        package = make()
    except ImportError:
        pytest.skip(f"there is no {make.__name__.lower()} here")
    if not package.works:
        pytest.skip(f"{make.__name__.lower()} finds no CUDA device")
    if not package.library.is_file():
        pytest.skip(f"there is no {package.library}")
    monkeypatch.setenv("UMBEL_CUDA_LIBRARY", str(package.library))
    return package


PACKAGES = {"processor": Processor, "torch": Torch, "cupy": Cupy, "numba": Numba}
