"""Triangles that an object gives range by range, so that they are nowhere on disk."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel import _umbel
from umbel.errors import Error

#: Streams that blocks may have, in the order of the library, and values a row; 0: one a triangle.
_STREAMS = {"normals": 3, "tangents": 4, "uvs": 2, "colors": 4, "materials": 0}


def is_called(source: Any) -> bool:
    """Whether it gives any range of its triangles, as `umbel.testing.giant` does."""
    return callable(getattr(source, "block", None)) and hasattr(source, "triangle_count")


def called(source: Any) -> Any:
    """Such an object as a source. It must give the same block for the same range each time."""
    count = int(source.triangle_count)
    first = source.block(0, 1) if count else None
    streams = [getattr(first, name, None) is not None for name in _STREAMS]

    def read(begin: int, end: int) -> tuple[Any, ...]:
        block = source.block(begin, end)
        return (
            _array(block, "positions", np.float64, 3),
            _array(block, "triangles", np.uint32, 3),
            *(
                _array(block, name, np.float32 if width else np.uint32, width)
                for name, width in _STREAMS.items()
            ),
        )

    return _umbel.CalledSource(read, count, streams)


def _array(block: Any, name: str, kind: Any, width: int) -> NDArray[Any] | None:
    values = getattr(block, name, None)
    if values is None:
        return None
    array = np.asarray(values)
    wanted = (len(array), width) if width else (len(array),)
    is_whole = np.issubdtype(kind, np.integer)
    if array.shape != wanted or (is_whole and array.dtype.kind not in "iu"):
        raise Error(f"{name} has the shape {array.shape} of {array.dtype}, not {wanted}")
    if is_whole and array.size and (int(array.min()) < 0 or int(array.max()) > 0xFFFFFFFF):
        raise Error(f"{name} has {array.min()} to {array.max()}")
    return np.ascontiguousarray(array, kind)
