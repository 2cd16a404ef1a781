"""The library of device functions, and what all calls of it share."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from umbel.cuda.arrays import DeviceArray, device_array, is_on_host
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


LIBRARY = "libumbel_cuda_c.so"


def library_path() -> Path:
    """Where the library is looked for: what UMBEL_CUDA_LIBRARY names, or beside the package, or in
    the package umbel_cuda, which `pip install umbel-cuda` puts there."""
    if named := os.environ.get("UMBEL_CUDA_LIBRARY"):
        return Path(named)
    beside = Path(__file__).parents[1] / LIBRARY
    if not beside.is_file():
        installed = find_spec("umbel_cuda")
        for folder in (installed and installed.submodule_search_locations) or ():
            return Path(folder) / LIBRARY
    return beside


@cache
def _load(path: str) -> ctypes.CDLL:
    try:
        loaded = ctypes.CDLL(path)
    except OSError as error:
        raise Error(
            f"umbel.cuda needs the library umbel_cuda_c, and {path} cannot be loaded ({error}); "
            "`pip install umbel-cuda` installs it, or `make cuda` builds it and UMBEL_CUDA_LIBRARY "
            "says where it is"
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


def wait(stream: int, place: int = 0) -> None:
    """Waits for a stream of the device that holds the memory at `place`."""
    check(library().umbel_cuda_wait(ctypes.c_void_p(stream), ctypes.c_void_p(place or None)))


@dataclass(frozen=True)
class Maker:
    """Makes arrays of a shape and the name of a NumPy type."""

    make: Callable[[tuple[int, ...], str], Any]
    current: Callable[[], int] = lambda: 0
    """The address of the package's current stream."""
    stream_of: Callable[[int], Any] | None = None
    """The package's stream at an address, if its arrays belong to streams."""
    within: Callable[[Any], Any] | None = None
    """Makes a stream of the package the current one, in a `with`."""

    def __call__(self, shape: tuple[int, ...], dtype: str, stream: int | None = None) -> Any:
        """An array that belongs to the stream: its package gives the memory to others only behind
        the work that is there."""
        if stream is None or not self.stream_of or not self.within or stream == self.current():
            return self.make(shape, dtype)
        with self.within(self.stream_of(stream)):
            return self.make(shape, dtype)


class Scratch:
    """The arrays of an object, and scratch memory for its calls: a block a stream, since calls in
    different streams run at the same time. A block that a captured graph has is kept for good."""

    def __init__(self, empty: Callable[..., Any], stream: int) -> None:
        self._empty = empty if isinstance(empty, Maker) else Maker(empty)
        self._blocks: dict[int, Any] = {}
        self._captured: set[int] = set()
        self._kept: list[Any] = []
        self._made: list[tuple[Any, set[int]]] = []
        self.last = stream
        """The stream of the last call, which is waited for before anything is read."""

    def make(self, shape: tuple[int, ...], dtype: str, stream: int | None = None) -> Any:
        """An array of the object, which calls in any stream may use."""
        where = self.last if stream is None else stream
        array = self._empty(shape, dtype, where)
        if hasattr(array, "record_stream"):
            self._made.append((array, {where}))
        return array

    def answer(self, shape: tuple[int, ...], dtype: str, stream: int) -> Any:
        """An array for the caller, which belongs to the stream of the call."""
        return self._empty(shape, dtype, stream)

    def call(self, name: str, *arguments: Any, stream: int) -> None:
        """Calls a function that asks for scratch memory."""
        function = getattr(library(), name)
        rest = [*arguments, ctypes.c_void_p(stream)]
        needed = ctypes.c_size_t(0)
        check(function(None, ctypes.byref(needed), *rest))
        block = self._block(needed.value + 256, stream)
        self._record(stream)
        aligned = (address(block) + 255) // 256 * 256
        check(function(ctypes.c_void_p(aligned), ctypes.byref(needed), *rest))

    def _block(self, size: int, stream: int) -> Any:
        block = self._blocks.get(stream)
        if block is None or block.shape[0] < size:
            if stream in self._captured:
                self._kept.append(block)
                self._captured.discard(stream)
            block = self._blocks[stream] = self._empty((size,), "uint8", stream)
        if stream not in self._captured:
            captured = ctypes.c_int()
            check(
                library().umbel_cuda_is_captured(
                    ctypes.c_void_p(stream), ctypes.c_void_p(address(block)), ctypes.byref(captured)
                )
            )
            if captured.value:
                self._captured.add(stream)
        return block

    def _record(self, stream: int) -> None:
        """Tells the package of arrays that they are used in a stream they do not belong to."""
        self.last = stream
        for array, streams in self._made:
            if stream not in streams and self._empty.stream_of:
                streams.add(stream)
                array.record_stream(self._empty.stream_of(stream))


def triangles_array(triangles: Any, stream: int) -> DeviceArray:
    """(m, 3) contiguous indices on a device."""
    found = device_array(triangles, "triangles", INTEGERS, 3, stream)
    if found.strides[0] != 12 and found.shape[0] > 1:
        raise Error("triangles must be contiguous")
    return found


def mesh_struct(positions: Any, triangles: DeviceArray, stream: int) -> MeshStruct:
    """A mesh with (n, 3) float32 positions on a device."""
    found = device_array(positions, "positions", ("f4",), 3, stream)
    mesh = MeshStruct(found.pointer, found.strides[0], triangles.pointer, None, triangles.shape[0])
    mesh.owner = found  # a copy of what is on the host lives as long as this
    return mesh


def address(array: Any) -> int:
    """Where an array of a device begins."""
    return int(array.__cuda_array_interface__["data"][0] or 0)


def on_host(array: Any, stream: int | None = None) -> Any:
    """The values of an array of a device, once they are there: written in this stream, and copied
    by its package in the package's own."""
    if is_on_host(array):  # has been copied
        return array
    if stream is not None:
        wait(stream, address(array))
    for copy in ("get", "copy_to_host"):  # of CuPy, of Numba
        if hasattr(array, copy):
            return getattr(array, copy)()
    return array.cpu().numpy()


def maker(positions: Any) -> Maker:
    """Makes arrays of the package of an array; memory of Umbel for arrays of the host."""
    if is_on_host(positions):
        from umbel.cuda.memory import DeviceMemory

        return Maker(DeviceMemory)
    package = type(positions).__module__.partition(".")[0]
    if package == "torch":
        import torch  # type: ignore[import-not-found,unused-ignore]

        device = positions.device
        return Maker(
            lambda shape, dtype: torch.empty(shape, dtype=getattr(torch, dtype), device=device),
            lambda: int(torch.cuda.current_stream(device).cuda_stream),
            lambda stream: (
                torch.cuda.ExternalStream(stream, device=device)
                if stream
                else torch.cuda.default_stream(device)
            ),
            lambda stream: torch.cuda.stream(stream),
        )
    if package == "cupy":
        import cupy  # type: ignore[import-not-found,unused-ignore]

        return Maker(
            cupy.empty,
            lambda: int(cupy.cuda.get_current_stream().ptr),
            lambda stream: cupy.cuda.ExternalStream(stream) if stream else cupy.cuda.Stream.null,
            lambda stream: stream,
        )
    if package in ("numba", "numba_cuda"):
        from numba import cuda  # type: ignore[import-not-found,unused-ignore]

        return Maker(cuda.device_array)
    raise Error(
        f"positions are of {package}, which makes no arrays here: give `empty`, a function of a "
        "shape and the name of a type"
    )
