"""Packages of arrays on a device, for tests: PyTorch, CuPy, Numba, NumPy, and none, with the same
functions on the processor. Needs nothing of the package that is compiled."""

from __future__ import annotations

import importlib
from functools import partial

import numpy as np
import pytest

from helpers.commands import BUILD
from umbel import cuda
from umbel.cuda import calls
from umbel.errors import Error

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


class Host:
    """NumPy alone, whose arrays are copied in and back: on a device where the library for one finds
    one, and otherwise on the processor."""

    works = True

    def __init__(self):
        self.options = {}
        self.library = cuda.library_path() if self._is_there_a_device() else ON_PROCESSOR

    @staticmethod
    def _is_there_a_device():
        try:
            calls.wait(0)
        except Error:
            return False
        return True

    def put(self, array):
        return array

    def get(self, array):
        return array


# How arrays come to the device, and back.
WAYS = {
    "torch": (lambda torch, array: torch.from_numpy(array).cuda(), lambda a: a.cpu().numpy()),
    "cupy": (lambda cupy, array: cupy.asarray(array), lambda a: a.get()),
    "numba": (lambda numba, array: numba.cuda.to_device(array), lambda a: a.copy_to_host()),
}


class Device:
    """A package with arrays on a device."""

    def __init__(self, name):
        package = importlib.import_module(name)
        put, self.get = WAYS[name]
        self.put = partial(put, package)
        self.options = {}
        self.library = cuda.library_path()
        self.works = importlib.import_module(f"{name}.cuda").is_available()


def packaged(name, monkeypatch):
    try:
        own = {"processor": Processor, "numpy": Host}
        package = own[name]() if name in own else Device(name)
    except ImportError:
        pytest.skip(f"there is no {name} here")
    if not package.works:
        pytest.skip(f"{name} finds no CUDA device")
    if not package.library.is_file():
        pytest.skip(f"there is no {package.library}")
    monkeypatch.setenv("UMBEL_CUDA_LIBRARY", str(package.library))
    return package


PACKAGES = ("processor", "numpy", *WAYS)
