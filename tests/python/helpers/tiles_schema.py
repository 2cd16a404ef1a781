"""The rules of the JSON schemas of 3D Tiles 1.1 that a tileset of ours can break, and those that
its text adds (https://docs.ogc.org/cs/22-025r4/22-025r4.html). What breaks one is named by its
place."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

Json = dict[str, Any]

_TILESET = {"asset", "geometricError", "root", "extensionsUsed", "extensionsRequired", "extras"}
_ASSET = {"version", "tilesetVersion", "extras"}
_TILE = {"boundingVolume", "geometricError", "refine", "transform", "content", "children"}
_TILE |= {"implicitTiling", "extras"}
_TILING = {"subdivisionScheme", "subtreeLevels", "availableLevels", "subtrees"}
_SUBTREE = {"buffers", "bufferViews", "tileAvailability", "contentAvailability"}
_SUBTREE |= {"childSubtreeAvailability"}


def tileset_faults(tileset: Json) -> list[str]:
    """What is wrong in a tileset.json."""
    return list(_tileset(tileset))


def subtree_faults(subtree: Json) -> list[str]:
    """What is wrong in the JSON of a .subtree file."""
    return list(_subtree(subtree))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_count(value: Any, least: int = 0) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= least


def _keys(value: Any, known: set[str], required: set[str], place: str) -> Iterator[str]:
    """Keys of ours are a closed set, so a key that is spelt wrong is found."""
    if not isinstance(value, dict):
        yield f"{place} is not an object"
        return
    yield from (f"{place}.{key} is missing" for key in sorted(required - set(value)))
    yield from (f"{place}.{key} is unknown" for key in sorted(set(value) - known))


def _tileset(tileset: Json) -> Iterator[str]:
    bad = list(_keys(tileset, _TILESET, {"asset", "geometricError", "root"}, "tileset"))
    bad += _keys(tileset.get("asset"), _ASSET, {"version"}, "asset")
    yield from bad
    if bad:
        return
    if tileset["asset"]["version"] != "1.1":
        yield "asset.version is not 1.1"
    for key in ("extensionsUsed", "extensionsRequired"):
        names = tileset.get(key, ["one"])
        if not isinstance(names, list) or not names or len(set(names)) != len(names):
            yield f"{key} is not a list of different names"
    yield from _error(tileset["geometricError"], math.inf, "tileset")
    if "refine" not in tileset["root"]:
        yield "root.refine is missing"
    pending = [("root", tileset["root"], tileset["geometricError"])]
    while pending:
        place, tile, above = pending.pop()
        bad = list(_tile(place, tile, above))
        yield from bad
        if not bad:
            pending += [
                (f"{place}.children[{k}]", child, tile["geometricError"])
                for k, child in enumerate(tile.get("children", []))
            ]


def _error(value: Any, above: float, place: str) -> Iterator[str]:
    if not _is_number(value) or value < 0:
        yield f"{place}.geometricError is not a number of at least 0"
    elif _is_number(above) and value > above:
        yield f"{place}.geometricError is above its parent's"


def _tile(place: str, tile: Any, above: float) -> Iterator[str]:
    bad = list(_keys(tile, _TILE, {"boundingVolume", "geometricError"}, place))
    yield from bad
    if bad:
        return
    yield from _error(tile["geometricError"], above, place)
    yield from _box(tile["boundingVolume"], f"{place}.boundingVolume")
    if tile.get("refine", "ADD") not in ("ADD", "REPLACE"):
        yield f"{place}.refine is neither ADD nor REPLACE"
    if "transform" in tile:
        yield from _transform(tile["transform"], f"{place}.transform")
    if "content" in tile:
        yield from _keys(tile["content"], {"uri", "boundingVolume"}, {"uri"}, f"{place}.content")
        yield from _uri(tile["content"].get("uri"), "implicitTiling" in tile, f"{place}.content")
    children = tile.get("children", [None])
    if not isinstance(children, list) or not children:
        yield f"{place}.children is not a list with something in it"
    if "implicitTiling" in tile:
        if "children" in tile:
            yield f"{place} has both children and implicitTiling"
        yield from _tiling(tile["implicitTiling"], f"{place}.implicitTiling")


def _box(volume: Any, place: str) -> Iterator[str]:
    bad = list(_keys(volume, {"box"}, {"box"}, place))
    yield from bad
    if bad:
        return
    box = volume["box"]
    if not isinstance(box, list) or len(box) != 12 or not all(map(_is_number, box)):
        yield f"{place}.box is not 12 numbers"
    elif any(not any(box[k : k + 3]) for k in (3, 6, 9)):
        yield f"{place}.box has no extent along an axis"


def _transform(matrix: Any, place: str) -> Iterator[str]:
    if not isinstance(matrix, list) or len(matrix) != 16 or not all(map(_is_number, matrix)):
        yield f"{place} is not 16 numbers"
    elif [matrix[k] for k in (3, 7, 11, 15)] != [0, 0, 0, 1]:
        yield f"{place} is not affine by columns"


def _uri(uri: Any, template: bool, place: str) -> Iterator[str]:
    if not isinstance(uri, str) or not uri:
        yield f"{place}.uri is not text"
    elif template != all(f"{{{name}}}" in uri for name in ("level", "x", "y", "z")):
        yield f"{place}.uri has the variables of a template where it is none, or lacks them"
    elif uri.startswith("/") or "\\" in uri or ":" in uri:
        yield f"{place}.uri is not relative"


def _tiling(tiling: Any, place: str) -> Iterator[str]:
    bad = list(_keys(tiling, _TILING, _TILING, place))
    yield from bad
    if bad:
        return
    if tiling["subdivisionScheme"] not in ("QUADTREE", "OCTREE"):
        yield f"{place}.subdivisionScheme is neither QUADTREE nor OCTREE"
    for key in ("subtreeLevels", "availableLevels"):
        if not _is_count(tiling[key], 1):
            yield f"{place}.{key} is not a whole number of at least 1"
    yield from _keys(tiling["subtrees"], {"uri"}, {"uri"}, f"{place}.subtrees")
    yield from _uri(tiling["subtrees"].get("uri"), True, f"{place}.subtrees")


def _subtree(subtree: Json) -> Iterator[str]:
    required = {"tileAvailability", "childSubtreeAvailability"}
    bad = list(_keys(subtree, _SUBTREE, required, "subtree"))
    yield from bad
    if bad:
        return
    buffers, views = subtree.get("buffers", []), subtree.get("bufferViews", [])
    for key in ("buffers", "bufferViews", "contentAvailability"):
        if not subtree.get(key, [0]):
            yield f"{key} is empty"
    for k, buffer in enumerate(buffers):
        if not _is_count(buffer.get("byteLength"), 1):
            yield f"buffers[{k}].byteLength is not a whole number of at least 1"
    for k, view in enumerate(views):
        yield from _view(view, buffers, f"bufferViews[{k}]")
    several = [("tileAvailability", subtree["tileAvailability"])]
    several.append(("childSubtreeAvailability", subtree["childSubtreeAvailability"]))
    contents = enumerate(subtree.get("contentAvailability", []))
    several += [(f"contentAvailability[{k}]", entry) for k, entry in contents]
    for place, entry in several:
        yield from _availability(entry, len(views), place)
    if subtree["tileAvailability"].get("constant") == 0:
        yield "tileAvailability says that there is no tile"


def _view(view: Json, buffers: list[Json], place: str) -> Iterator[str]:
    keys = ("buffer", "byteOffset", "byteLength")
    if set(view) != set(keys) or not all(_is_count(view[key]) for key in keys):
        yield f"{place} is not three whole numbers"
    elif view["buffer"] >= len(buffers) or view["byteLength"] < 1:
        yield f"{place} is of no buffer, or empty"
    elif view["byteOffset"] + view["byteLength"] > buffers[view["buffer"]]["byteLength"]:
        yield f"{place} is beyond its buffer"
    elif view["byteOffset"] % 8:
        yield f"{place} does not start at a multiple of 8"


def _availability(entry: Json, views: int, place: str) -> Iterator[str]:
    yield from _keys(entry, {"bitstream", "availableCount", "constant"}, set(), place)
    if ("bitstream" in entry) == ("constant" in entry):
        yield f"{place} has both or neither of bitstream and constant"
    elif "bitstream" in entry and not _is_count(entry["bitstream"]):
        yield f"{place}.bitstream is not a number of a view"
    elif entry.get("bitstream", -1) >= views:
        yield f"{place}.bitstream is of no view"
    if entry.get("constant", 0) not in (0, 1):
        yield f"{place}.constant is neither 0 nor 1"
    if not _is_count(entry.get("availableCount", 0)):
        yield f"{place}.availableCount is not a whole number"
