"""The binary part of a glTF file that is written: buffer views and accessors."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Json = dict[str, Any]

FLOAT, UINT16, UINT32 = 5126, 5123, 5125
VERTICES, INDICES = 34962, 34963
_TYPES = {FLOAT: "<f4", UINT16: "<u2", UINT32: "<u4"}


class Arrays:
    """Grows as arrays are added; each method gives the index of what it made."""

    def __init__(self) -> None:
        self.views: list[Json] = []
        self.accessors: list[Json] = []
        self.chunks: list[bytes] = []
        self.size = 0
        self._blobs: dict[bytes, int] = {}

    def view(self, raw: bytes, target: int = 0) -> int:
        """Bytes at a multiple of four."""
        entry = {"buffer": 0, "byteOffset": self.size, "byteLength": len(raw)}
        self.views.append({**entry, "target": target} if target else entry)
        padded = raw + b"\0" * (-len(raw) % 4)
        self.chunks.append(padded)
        self.size += len(padded)
        return len(self.views) - 1

    def blob(self, raw: bytes) -> int:
        """A view of bytes that are no array, the same one for equal bytes."""
        if raw not in self._blobs:
            self._blobs[raw] = self.view(raw)
        return self._blobs[raw]

    def accessor(self, view: int, kind: int, width: str, count: int, offset: int = 0) -> int:
        entry: Json = {"bufferView": view, "componentType": kind, "type": width, "count": count}
        if offset:
            entry["byteOffset"] = offset
        self.accessors.append(entry)
        return len(self.accessors) - 1

    def array(self, values: NDArray[Any], width: str, kind: int = FLOAT, target: int = 0) -> int:
        """An accessor of a row each, alone in its view."""
        raw = np.ascontiguousarray(values).astype(_TYPES[kind]).tobytes()
        return self.accessor(self.view(raw, target), kind, width, len(values))

    def attribute(self, values: NDArray[Any], width: str, kind: int = FLOAT) -> int:
        """The same, of vertices."""
        return self.array(values, width, kind, VERTICES)

    def indices(self, values: NDArray[Any], vertices: int) -> tuple[int, int, int]:
        """A view of indices as small as they may be: the view, their type, and bytes of each."""
        kind = UINT16 if vertices <= 0xFFFF else UINT32
        raw = values.astype(_TYPES[kind]).tobytes()
        return self.view(raw, INDICES), kind, 2 if kind == UINT16 else 4
