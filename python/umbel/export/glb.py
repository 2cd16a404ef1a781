"""A .glb of quantised surfaces and their materials."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from umbel.errors import Error
from umbel.export.packed import EXTENSIONS, INSTANCING, Json, PackedArrays
from umbel.export.piece import Doubles
from umbel.io.gltf.material_table import MaterialTable
from umbel.io.gltf.materials import extensions_in
from umbel.io.gltf.tree import known_packets
from umbel.plain_json import plain

_MOST_BYTES = 0xFFFFFFFF


def grid_node(low: Doubles, step: float, **more: Any) -> Json:
    """A node that takes positions on a grid, in glTF's axes, to where they are."""
    return {"translation": np.asarray(low).tolist(), "scale": [float(step)] * 3, **more}


def glb_bytes(
    arrays: PackedArrays, materials: MaterialTable, scene: Json, *, name: str
) -> list[bytes]:
    """The file, in chunks. `scene` has `asset`, `nodes`, `meshes`, and the roots of the scene as
    `roots`. Raises where it is too large."""
    given = dict(scene)
    root: Json = {
        "asset": {**given.pop("asset", {}), "version": "2.0", "generator": "umbel"},
        "scene": 0,
        "scenes": [{"nodes": given.pop("roots")}],
        **given,
        "materials": materials.entries,
        **materials.table.root,
        "accessors": arrays.accessors,
        "bufferViews": arrays.views,
        "buffers": arrays.buffers(),
    }
    root = known_packets(root)
    used = {*extensions_in(root), *EXTENSIONS}
    root["extensionsUsed"] = sorted(used)
    # A reader without instances would show one of each, and as large as its grid.
    needed = {*EXTENSIONS, *used.intersection([INSTANCING])}
    root["extensionsRequired"] = sorted({*materials.table.required, *needed})
    root = {key: value for key, value in root.items() if value not in ([], {})}
    text = json.dumps(plain(root), separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + 8 + arrays.size
    if total > _MOST_BYTES:
        raise Error(f"{name}: {total} bytes are more than a .glb can hold")

    def word(*values: int) -> bytes:
        return b"".join(v.to_bytes(4, "little") for v in values)

    head = [b"glTF", word(2, total), word(len(text)), b"JSON", text]
    return [*head, word(arrays.size), b"BIN\0", *arrays.chunks]
