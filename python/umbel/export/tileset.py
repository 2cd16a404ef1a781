"""The tree of tiles as JSON of 3D Tiles 1.1: every tile by itself, or implicitly, with files that
say which tiles of an octree there are."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.export.piece import Doubles
from umbel.export.plan import Plan, Tile
from umbel.plain_json import encode

Json = dict[str, Any]

SUBTREE_LEVELS = 5
_TEMPLATE = "{level}/{x}_{y}_{z}"


def tileset(plan: Plan, origin: Doubles, implicit: bool) -> bytes:
    """tileset.json."""
    low, high = plan.grid.cell(plan.root)
    root = _implicit_root(plan) if implicit else _tree(plan)
    root["refine"] = "REPLACE"
    if origin.any():
        matrix = np.eye(4)
        matrix[3, :3] = origin
        root["transform"] = matrix.reshape(-1).tolist()
    # How wrong it is to show nothing: the size of what is not shown.
    size = float(np.linalg.norm(high - low))
    text = {
        "asset": {"version": "1.1", "extras": {"generator": "umbel"}},
        "geometricError": max(size, root["geometricError"]),
        "root": root,
    }
    return encode(text).encode()


def _tree(plan: Plan) -> Json:
    """All tiles, each with the box of what is in it and below."""
    entries: dict[int, Json] = {}
    boxes: dict[int, NDArray[np.float64]] = {}
    smallest = plan.grid.side * 2.0**-40
    for tile in reversed(list(plan.tiles())):
        own = [boxes[id(child)] for child in tile.children]
        if tile.box is not None:
            own.append(tile.box)
        corners = np.stack(own)
        boxes[id(tile)] = np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])
        entry: Json = {
            "boundingVolume": {"box": _box(boxes[id(tile)], smallest)},
            "geometricError": tile.error,
        }
        if tile.box is not None:
            entry["content"] = {"uri": f"tiles/{tile.name}.glb"}
        if tile.children:
            entry["children"] = [entries.pop(id(child)) for child in tile.children]
        entries[id(tile)] = entry
    return entries[id(plan.root)]


def _box(corners: Doubles, smallest: float) -> list[float]:
    low, high = corners
    center, half = (low + high) / 2, np.maximum((high - low) / 2, smallest)
    return [*center.tolist(), half[0], 0, 0, 0, half[1], 0, 0, 0, half[2]]


def implicit_error(plan: Plan) -> float:
    """The root's error of an implicit tiling. Each depth has half the error of the one before, so
    the root's is the least with which none is below its own."""
    return max((error * 2.0**depth for depth, error in enumerate(plan.errors)), default=0.0)


def _implicit_root(plan: Plan) -> Json:
    return {
        "boundingVolume": {"box": _box(np.stack(plan.grid.cell(plan.root)), 0.0)},
        "geometricError": implicit_error(plan),
        "content": {"uri": f"tiles/{_TEMPLATE}.glb"},
        "implicitTiling": {
            "subdivisionScheme": "OCTREE",
            "subtreeLevels": SUBTREE_LEVELS,
            "availableLevels": 1 + max(tile.depth for tile in plan.tiles()),
            "subtrees": {"uri": f"subtrees/{_TEMPLATE}.subtree"},
        },
    }


def subtrees(plan: Plan) -> dict[str, bytes]:
    """The files that say which tiles there are, by their names."""
    made: dict[str, bytes] = {}
    roots = [plan.root]
    while roots:
        root = roots.pop()
        below: list[Tile] = []
        made[f"subtrees/{root.name}.subtree"] = _subtree(root, below)
        roots += below
    return made


def _subtree(root: Tile, below: list[Tile]) -> bytes:
    """One of these files; `below` gets the roots of those under it."""
    count = (8**SUBTREE_LEVELS - 1) // 7
    tiles, contents = np.zeros(count, bool), np.zeros(count, bool)
    children = np.zeros(8**SUBTREE_LEVELS, bool)
    layer = [(root, 0)]
    for level in range(SUBTREE_LEVELS + 1):
        following = []
        for tile, morton in layer:
            if level == SUBTREE_LEVELS:
                children[morton] = True
                below.append(tile)
                continue
            index = (8**level - 1) // 7 + morton
            tiles[index], contents[index] = True, tile.box is not None
            for child in tile.children:
                x, y, z = (v & 1 for v in child.place)
                following.append((child, morton * 8 + x + 2 * y + 4 * z))
        layer = following
    return _subtree_bytes([tiles, contents, children])


def _subtree_bytes(bits: list[NDArray[np.bool_]]) -> bytes:
    views: list[Json] = []
    entries: list[Json] = []
    binary = b""
    for flags in bits:
        available = int(flags.sum())
        if available in (0, len(flags)):
            entries.append({"constant": int(available > 0), "availableCount": available})
            continue
        data = np.packbits(flags, bitorder="little").tobytes()
        entries.append({"bitstream": len(views), "availableCount": available})
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(data)})
        binary += data + b"\0" * (-len(data) % 8)
    text: Json = {
        "tileAvailability": entries[0],
        "contentAvailability": [entries[1]],
        "childSubtreeAvailability": entries[2],
    }
    if views:
        text |= {"buffers": [{"byteLength": len(binary)}], "bufferViews": views}
    head = encode(text).encode()
    head += b" " * (-len(head) % 8)
    return struct.pack("<4sIQQ", b"subt", 1, len(head), len(binary)) + head + binary
