"""Structs of the C interface, from declarations as its headers have them."""

from __future__ import annotations

import ctypes

_TYPES: dict[str, type] = {
    "void*": ctypes.c_void_p,
    "size_t": ctypes.c_size_t,
    "int32_t": ctypes.c_int32,
    "uint32_t": ctypes.c_uint32,
    "uint64_t": ctypes.c_uint64,
    "float": ctypes.c_float,
}


def c_fields(*declarations: str) -> tuple[tuple[str, type], ...]:
    """The `_fields_` of a ctypes.Structure, from declarations such as "float min, max"."""
    found = []
    for declaration in declarations:
        kind, _, names = declaration.partition(" ")
        found += [(name, _TYPES[kind]) for name in names.split(", ")]
    return tuple(found)
