"""Packages of arrays on a device, for tests: PyTorch, CuPy, Numba, and none, with the same
functions on the processor. Needs nothing of the package that is compiled."""

from __future__ import annotations

import importlib
from functools import partial

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
        package = Processor() if name == "processor" else Device(name)
    except ImportError:
        pytest.skip(f"there is no {name} here")
    if not package.works:
        pytest.skip(f"{name} finds no CUDA device")
    if not package.library.is_file():
        pytest.skip(f"there is no {package.library}")
    monkeypatch.setenv("UMBEL_CUDA_LIBRARY", str(package.library))
    return package


PACKAGES = ("processor", *WAYS)
