"""Memory of a device that belongs to Umbel: what arrays of the host are copied to and back from."""

from __future__ import annotations

import contextlib
import ctypes
import math
from typing import Any

from umbel.cuda import calls


class DeviceMemory:
    """An array on the current device, without a value at first."""

    def __init__(self, shape: tuple[int, ...], dtype: str) -> None:
        import numpy as np

        self.shape, self.dtype = tuple(shape), np.dtype(dtype)
        self.nbytes = math.prod(self.shape) * self.dtype.itemsize
        self._library = calls.library()
        memory = ctypes.c_void_p()
        self._pointer: int | None = None
        calls.check(
            self._library.umbel_cuda_allocate(ctypes.c_size_t(self.nbytes), ctypes.byref(memory))
        )
        self._pointer = memory.value

    @classmethod
    def of(cls, array: Any, stream: int) -> DeviceMemory:
        """A copy of a NumPy array, made behind what is in the stream. Waits for it."""
        import numpy as np

        values = np.ascontiguousarray(array)
        made = cls(values.shape, values.dtype.str)
        made._copy(made._pointer, values.ctypes.data, stream)
        return made

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        return {
            "shape": self.shape,
            "typestr": self.dtype.str,
            "data": (self._pointer or 0, False),
            "version": 2,
        }

    def get(self, stream: int = 0) -> Any:
        """The values as a NumPy array, once what is in the stream is done."""
        import numpy as np

        values = np.empty(self.shape, self.dtype)
        self._copy(values.ctypes.data, self._pointer, stream)
        return values

    def _copy(self, to: int | None, start: int | None, stream: int) -> None:
        calls.check(
            self._library.umbel_cuda_copy(
                ctypes.c_void_p(to),
                ctypes.c_void_p(start),
                ctypes.c_size_t(self.nbytes),
                ctypes.c_void_p(stream),
            )
        )

    def __del__(self) -> None:
        if getattr(self, "_pointer", None) is not None:
            with contextlib.suppress(Exception):  # while the interpreter ends
                self._library.umbel_cuda_free(ctypes.c_void_p(self._pointer))


def given_back(array: Any, stream: int) -> Any:
    """An array as the caller gets it: those of Umbel are copied to the host, after a wait."""
    return array.get(stream) if isinstance(array, DeviceMemory) else array
