"""STL, binary and ASCII: three corners a triangle and nothing shared.

The facet normals repeat what the corners say, so they are left out. Vertices are not merged:
`umbel.weld` does that.
"""

from __future__ import annotations

import numpy as np

from umbel.errors import Error
from umbel.io.files import numbers
from umbel.io.scene import Instance, Scene
from umbel.mesh import Float32Array, Float64Array, Mesh

_HEADER = 84
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(data: bytes, where: str) -> Scene:
    """The scene in an STL file's bytes; `where` names the file in errors."""
    corners = _ascii(data, where) if _is_ascii(data) else _binary(data, where)
    mesh = Mesh(corners, np.arange(len(corners), dtype=np.uint32).reshape(-1, 3))
    return Scene([mesh], [], [Instance(0)])


def _is_ascii(data: bytes) -> bool:
    # Binary files may begin with "solid" too; their length gives them away.
    if len(data) >= _HEADER:
        count = int.from_bytes(data[80:84], "little")
        if len(data) == _HEADER + count * _RECORD.itemsize:
            return False
    head = data[:1024].lstrip().lower()
    return head.startswith(b"solid") and (b"facet" in data[:4096].lower() or b"endsolid" in head)


def _binary(data: bytes, where: str) -> Float32Array:
    if len(data) < _HEADER:
        raise Error(
            f"{where} is cut short: a binary STL has at least {_HEADER} bytes, this has {len(data)}"
        )
    count = int.from_bytes(data[80:84], "little")
    have = (len(data) - _HEADER) // _RECORD.itemsize
    if count > have:
        raise Error(
            f"{where} is cut short or no STL: the header says {count} triangles, there "
            f"are bytes for {have}"
        )
    records = np.frombuffer(data, _RECORD, count, _HEADER)
    return np.ascontiguousarray(records["corners"]).reshape(-1, 3)


def _ascii(data: bytes, where: str) -> Float64Array:
    text = np.frombuffer(data.lower() + b"\n", np.uint8)
    space = text <= 32
    starts = np.flatnonzero(space[:-1] & ~space[1:]) + 1
    if not space[0]:
        starts = np.concatenate([[0], starts])
    ends = np.flatnonzero(~space[:-1] & space[1:]) + 1
    padded = np.concatenate([text, np.zeros(8, np.uint8)])
    word = np.frombuffer(b"vertex", np.uint8)
    is_vertex = ends - starts == len(word)
    for k, letter in enumerate(word):
        is_vertex &= padded[starts + k] == letter
    at = np.flatnonzero(is_vertex)
    if len(at) % 3:
        raise Error(f"{where} is cut short or corrupt: {len(at)} vertices are no whole triangles")
    loops = data.lower().count(b"outer loop")
    if loops and loops * 3 != len(at):
        raise Error(f"{where}: {loops} loops have {len(at)} vertices; every loop needs three")
    if len(at) and at[-1] + 3 >= len(starts):
        raise Error(f"{where} is cut short after vertex {len(at) - 1}")
    mask = np.zeros(len(text) + 1, np.int8)
    np.add.at(mask, starts[at + 1] if len(at) else at, 1)
    np.add.at(mask, ends[at + 3] + 1 if len(at) else at, -1)
    chosen = text[np.cumsum(mask[:-1], dtype=np.int8).astype(bool)].tobytes()
    values = numbers(chosen, len(at) * 3, f"{where}, vertex coordinates")
    points: Float64Array = values.reshape(-1, 3)
    return points
