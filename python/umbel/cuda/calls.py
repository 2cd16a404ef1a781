"""The library of device functions, and what all calls of it share."""

from __future__ import annotations

import ctypes
import os
from functools import cache
from pathlib import Path
from typing import Any

from umbel.cuda.arrays import DeviceArray, device_array
from umbel.cuda.c_structs import c_fields
from umbel.errors import Error

INTEGERS = ("u4", "i4")
"""Signed 32-bit integers are taken for indices as well: PyTorch knows few operations on others."""


class MeshStruct(ctypes.Structure):
    """umbel_cuda_mesh."""

    _fields_ = c_fields(
        "void* positions",
        "size_t position_stride",
        "void* indices, items",
        "uint32_t triangles",
    )


def library_path() -> Path:
    """Where the library is looked for."""
    return Path(
        os.environ.get("UMBEL_CUDA_LIBRARY", Path(__file__).parents[1] / "libumbel_cuda_c.so")
    )


@cache
def _load(path: str) -> ctypes.CDLL:
    try:
        loaded = ctypes.CDLL(path)
    except OSError as error:
        raise Error(
            f"umbel.cuda needs the library umbel_cuda_c, and {path} cannot be loaded ({error}); "
            "`make cuda` builds it, and UMBEL_CUDA_LIBRARY says where it is"
        ) from None
    loaded.umbel_last_error.restype = ctypes.c_char_p
    return loaded


def library() -> ctypes.CDLL:
    """The library, loaded on first use."""
    return _load(str(library_path()))


def check(result: int) -> None:
    """Raises what a call has reported."""
    if result != 0:
        raise Error(library().umbel_last_error().decode())


class Scratch:
    """Scratch memory that grows with what calls ask for."""

    def __init__(self, empty: Any) -> None:
        self._empty = empty
        self._memory: Any = None

    def call(self, name: str, *arguments: Any, stream: int) -> None:
        """Calls a function that asks for scratch memory."""
        function = getattr(library(), name)
        rest = [*arguments, ctypes.c_void_p(stream)]
        needed = ctypes.c_size_t(0)
        check(function(None, ctypes.byref(needed), *rest))
        if self._memory is None or self._memory.shape[0] < needed.value + 256:
            self._memory = self._empty((needed.value + 256,), "uint8")
        aligned = (address(self._memory) + 255) // 256 * 256
        check(function(ctypes.c_void_p(aligned), ctypes.byref(needed), *rest))


def triangles_array(triangles: Any, stream: int) -> DeviceArray:
    """(m, 3) contiguous indices on a device."""
    found = device_array(triangles, "triangles", INTEGERS, 3, stream)
    if found.strides[0] != 12 and found.shape[0] > 1:
        raise Error("triangles must be contiguous")
    return found


def mesh_struct(positions: Any, triangles: DeviceArray, stream: int) -> MeshStruct:
    """A mesh with (n, 3) float32 positions on a device."""
    found = device_array(positions, "positions", ("f4",), 3, stream)
    return MeshStruct(found.pointer, found.strides[0], triangles.pointer, None, triangles.shape[0])


def address(array: Any) -> int:
    """Where an array of a device begins."""
    return int(array.__cuda_array_interface__["data"][0] or 0)


def on_host(array: Any) -> Any:
    """The values of an array of a device, once they are there."""
    for copy in ("get", "copy_to_host"):  # of CuPy, of Numba
        if hasattr(array, copy):
            return getattr(array, copy)()
    return array.cpu().numpy()


def maker(positions: Any) -> Any:
    """A function that makes arrays of the package of an array."""
    package = type(positions).__module__.partition(".")[0]
    if package == "torch":
        import torch  # type: ignore[import-not-found,unused-ignore]

        device = positions.device
        return lambda shape, dtype: torch.empty(shape, dtype=getattr(torch, dtype), device=device)
    if package == "cupy":
        import cupy  # type: ignore[import-not-found,unused-ignore]

        return cupy.empty
    if package in ("numba", "numba_cuda"):
        from numba import cuda  # type: ignore[import-not-found,unused-ignore]

        return cuda.device_array
    raise Error(
        f"positions are of {package}, which makes no arrays here: give `empty`, a function of a "
        "shape and the name of a type"
    )
