"""Primitives compressed by KHR_draco_mesh_compression, decoded with DracoPy.

Attributes that the extension does not name are read from their accessors.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error, LoadWarning
from umbel.geometry.mesh import UInt32Array, to_unit_floats
from umbel.io.gltf.buffers import Buffers, Json


def read_draco(
    primitive: Json, extension: Json, buffers: Buffers, name: str
) -> tuple[dict[str, NDArray[Any]], UInt32Array]:
    """The attributes that are compressed and the corners (3 a triangle)."""
    where = buffers.where
    try:
        import DracoPy
    except ImportError:
        raise Error(f"{where} is Draco-compressed; install DracoPy to read it") from None
    data, _ = buffers.view(extension.get("bufferView"), name)
    try:
        decoded = DracoPy.decode(data)
        by_id = {a["unique_id"]: a for a in decoded.attributes}
        faces = np.asarray(decoded.faces)
    except Exception as error:  # DracoPy raises several of its own
        raise Error(f"{where}: {name} has Draco data that cannot be decoded: {error}") from None
    out: dict[str, NDArray[Any]] = {}
    for semantic, unique_id in (extension.get("attributes") or {}).items():
        if unique_id not in by_id:
            raise Error(f"{where}: {name} has no Draco attribute {unique_id} for {semantic}")
        values = np.asarray(by_id[unique_id]["data"])
        values = values.reshape(len(values), -1)
        out[semantic] = _as_declared(values, semantic, primitive, buffers, name)
    if "POSITION" not in out:
        raise Error(f"{where}: {name} has no Draco attribute for POSITION")
    _check_counts(
        primitive, {**{k: len(v) for k, v in out.items()}, "indices": faces.size}, buffers
    )
    return out, np.ascontiguousarray(faces.reshape(-1), np.uint32)


def _check_counts(primitive: Json, counts: dict[str, int], buffers: Buffers) -> None:
    """Warns of accessors that say other counts than the decoded data have."""
    used = {**primitive["attributes"], **{k: primitive[k] for k in ("indices",) if k in primitive}}
    for key, index in used.items():
        entry = buffers.item("accessors", index, key)
        if key in counts and entry.get("count") != counts[key]:
            warnings.warn(
                f"{buffers.where}: accessors[{index}] says {entry.get('count')} elements, its "
                f"Draco data hold {counts[key]}",
                LoadWarning,
                stacklevel=2,
            )


def _as_declared(
    values: NDArray[Any], semantic: str, primitive: Json, buffers: Buffers, name: str
) -> NDArray[Any]:
    if semantic.startswith("JOINTS_"):
        return values
    if values.dtype.kind == "f":
        return values.astype(np.float32)
    accessor = buffers.item("accessors", primitive["attributes"].get(semantic), name)
    if accessor.get("normalized") or semantic == "COLOR_0":
        return to_unit_floats(values)
    return values.astype(np.float32)
