"""Arrays of other packages on a CUDA device, as addresses: CuPy, PyTorch, Numba and JAX by
`__cuda_array_interface__`, anything else by DLPack. Nothing is copied, but arrays of the host."""

from __future__ import annotations

import ctypes
import math
import sys
from dataclasses import dataclass, replace
from typing import Any

from umbel.errors import Error

DLPACK_CUDA = (2, 13)
"""Device types of DLPack: device memory, and managed memory."""


class _DLTensor(ctypes.Structure):
    _fields_ = (
        ("data", ctypes.c_void_p),
        ("device_type", ctypes.c_int32),
        ("device_id", ctypes.c_int32),
        ("ndim", ctypes.c_int32),
        ("code", ctypes.c_uint8),
        ("bits", ctypes.c_uint8),
        ("lanes", ctypes.c_uint16),
        ("shape", ctypes.POINTER(ctypes.c_int64)),
        ("strides", ctypes.POINTER(ctypes.c_int64)),
        ("byte_offset", ctypes.c_uint64),
    )


_DLPACK_KINDS = {0: "i", 1: "u", 2: "f"}


@dataclass(frozen=True)
class DeviceArray:
    """Where an array lies on the device."""

    pointer: int
    shape: tuple[int, ...]
    kind: str
    """As in NumPy's type strings, without the byte order: "f4", "i4", "u4", "i8"."""
    strides: tuple[int, ...]
    """In bytes."""
    owner: Any
    """Keeps the memory alive."""


def _contiguous(shape: tuple[int, ...], size: int) -> tuple[int, ...]:
    return tuple(size * math.prod(shape[k + 1 :]) for k in range(len(shape)))


def _from_interface(array: Any, what: dict[str, Any], stream: int) -> DeviceArray:
    shape = tuple(int(n) for n in what["shape"])
    kind = what["typestr"][1:]
    strides = what.get("strides") or _contiguous(shape, int(kind[1:]))
    pointer, writer = int(what["data"][0] or 0), what.get("stream")
    # 1 is the default stream. Who writes the array in another one has to be waited for.
    if writer is not None and writer != (stream or 1):
        from umbel.cuda import calls

        calls.wait(0 if writer == 1 else int(writer), pointer)
    return DeviceArray(pointer, shape, kind, tuple(strides), array)


def _from_dlpack(array: Any, name: str, stream: int) -> DeviceArray:
    device_type, _ = array.__dlpack_device__()
    if device_type not in DLPACK_CUDA:
        raise Error(f"{name} must be in the memory of a CUDA device")
    # DLPack's numbers for streams: 1 is the default stream.
    capsule = array.__dlpack__(stream=stream or 1)
    get = ctypes.pythonapi.PyCapsule_GetPointer
    get.restype = ctypes.c_void_p
    get.argtypes = [ctypes.py_object, ctypes.c_char_p]
    tensor = _DLTensor.from_address(get(capsule, b"dltensor"))
    if tensor.lanes != 1 or tensor.code not in _DLPACK_KINDS or tensor.bits % 8:
        raise Error(f"{name} has elements of a type that is not supported")
    size = tensor.bits // 8
    shape = tuple(tensor.shape[k] for k in range(tensor.ndim))
    strides = (
        tuple(tensor.strides[k] * size for k in range(tensor.ndim))
        if tensor.strides
        else _contiguous(shape, size)
    )
    pointer = (tensor.data or 0) + tensor.byte_offset
    return DeviceArray(
        pointer, shape, f"{_DLPACK_KINDS[tensor.code]}{size}", strides, (array, capsule)
    )


def device_array(
    array: Any, name: str, kinds: tuple[str, ...], columns: int = 0, stream: int = 0
) -> DeviceArray:
    """The array's address, if it is (n, columns), or (n,) where columns is 0, of one of these
    kinds, and its rows are contiguous (of an array of several columns, rows may be
    apart from each other). What is on the host is copied; `owner` keeps the copy."""
    interface = getattr(array, "__cuda_array_interface__", None)
    if interface is not None:
        found = _from_interface(array, interface, stream)
    elif is_on_host(array):
        import numpy as np

        values = np.asarray(array)
        kind = values.dtype.str[1:]
        found = DeviceArray(
            0, values.shape, kind, _contiguous(values.shape, values.itemsize), values
        )
    elif hasattr(array, "__dlpack_device__"):
        found = _from_dlpack(array, name, stream)
    else:
        raise Error(
            f"{name} must be an array of NumPy, or one on a CUDA device (CuPy, PyTorch, Numba, or "
            f"anything with __cuda_array_interface__ or __dlpack__), not {type(array).__name__}"
        )
    wanted = f"(n, {columns})" if columns else "(n,)"
    if len(found.shape) != (2 if columns else 1) or (columns and found.shape[1] != columns):
        raise Error(f"{name} must have the shape {wanted}, not {found.shape}")
    if found.kind not in kinds:
        raise Error(f"{name} must have elements of {' or '.join(kinds)}, not {found.kind}")
    size = int(found.kind[1:])
    if interface is None and is_on_host(array):
        from umbel.cuda.memory import DeviceMemory

        copied = DeviceMemory.of(found.owner, stream)
        return replace(found, pointer=copied.__cuda_array_interface__["data"][0], owner=copied)
    if found.shape[0] == 0:  # whose strides may be anything
        return replace(found, strides=_contiguous(found.shape, size))
    if found.strides[-1] != size and found.shape[-1] > 1:
        raise Error(f"{name} must have contiguous rows; its strides are {found.strides}")
    return found


def is_on_host(array: Any) -> bool:
    """Whether it is an array of NumPy, or of a package that lends its memory to NumPy."""
    return not hasattr(array, "__cuda_array_interface__") and (
        hasattr(array, "__array_interface__")
        or (type(array).__module__.partition(".")[0] == "torch" and hasattr(array, "numpy"))
    )


def current_stream(array: Any) -> int:
    """The current stream of the package that the array belongs to; 0, the default stream, where
    that has none of its own."""
    if is_on_host(array):
        return 0
    package = type(array).__module__.partition(".")[0]
    module = sys.modules.get(package)
    if package == "torch" and module is not None:
        return int(module.cuda.current_stream(array.device).cuda_stream)
    if package == "cupy" and module is not None:
        return int(module.cuda.get_current_stream().ptr)
    return 0
