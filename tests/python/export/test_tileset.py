"""tileset.json and the files of implicit tiling keep the rules of 3D Tiles 1.1."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import umbel
from helpers.tiles_schema import subtree_faults, tileset_faults

Json = dict[str, Any]


@pytest.fixture(scope="module")
def asset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("tileset") / "far.umbel"
    blob = umbel.shapes.blob(5, seed=3)
    far = np.array([4_000_000.25, 500_000.5, 4_900_000.75])
    points = blob.positions.astype(np.float64) + far
    umbel.build_lod(umbel.Mesh(points, blob.triangles)).save(path)
    return path


@pytest.fixture(scope="module")
def explicit(asset: Path) -> Json:
    umbel.export_tiles(asset, asset.parent / "explicit", tile_triangles=500)
    made: Json = json.loads((asset.parent / "explicit/tileset.json").read_text())
    return made


@pytest.fixture(scope="module")
def implicit(asset: Path) -> tuple[Json, list[Json]]:
    folder = asset.parent / "implicit"
    umbel.export_tiles(asset, folder, tile_triangles=100, implicit_above=10)
    subtrees = []
    for path in sorted(folder.rglob("*.subtree")):
        data = path.read_bytes()
        subtrees.append(json.loads(data[24 : 24 + int.from_bytes(data[8:16], "little")]))
    return json.loads((folder / "tileset.json").read_text()), subtrees


def test_explicit_tilesets_keep_the_schema(explicit: Json) -> None:
    assert tileset_faults(explicit) == []
    assert "children" in explicit["root"]
    assert "transform" in explicit["root"]


def test_implicit_tilesets_keep_the_schema(implicit: tuple[Json, list[Json]]) -> None:
    root, subtrees = implicit
    assert tileset_faults(root) == []
    assert subtrees
    assert [fault for subtree in subtrees for fault in subtree_faults(subtree)] == []


def test_tilesets_of_flat_and_single_meshes_keep_the_schema(tmp_path: Path) -> None:
    square = umbel.Mesh(
        np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
    )
    umbel.build_lod(square).save(tmp_path / "a.umbel")
    for name, above in (("explicit", 10), ("implicit", 0)):
        umbel.export_tiles(tmp_path / "a.umbel", tmp_path / name, implicit_above=above)
        assert tileset_faults(json.loads((tmp_path / name / "tileset.json").read_text())) == []


def at(place: str, value: Any) -> Callable[[Json], None]:
    """Sets what is at a place; None takes it out."""

    def change(root: Json) -> None:
        *path, last = [int(k) if k.isdigit() else k for k in place.split(".")]
        for key in path:
            root = root[key]
        if value is None:
            del root[last]
        else:
            root[last] = value

    return change


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("asset", None),
        ("asset.version", "1.0"),
        ("geometricError", None),
        ("geometricError", -1),
        ("geometricError", float("nan")),
        ("extensionsUsed", []),
        ("generator", "umbel"),
        ("root.refine", None),
        ("root.refine", "replace"),
        ("root.transform", [1.0] * 16),
        ("root.transform", [1.0] * 12),
        ("root.boundingVolume", {}),
        ("root.boundingVolume.box.3", 0),
        ("root.boundingVolume.box", [0] * 11),
        ("root.children", []),
        ("root.children.0.geometricError", 1e9),
        ("root.children.0.geometricError", "0"),
        ("root.children.0.boundingVolume", None),
        ("root.children.0.content", {}),
        ("root.children.0.content.uri", "/tiles/0.glb"),
        ("root.children.0.content.uri", "tiles/{level}/{x}_{y}_{z}.glb"),
        ("root.children.0.contents", [{"uri": "a.glb"}]),
    ],
)
def test_a_broken_tileset_is_noticed(explicit: Json, place: str, value: Any) -> None:
    broken = copy.deepcopy(explicit)
    at(place, value)(broken)
    assert tileset_faults(broken)


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("root.children", [{}]),
        ("root.content.uri", "tiles/0.glb"),
        ("root.implicitTiling.subdivisionScheme", "BINARY"),
        ("root.implicitTiling.subtreeLevels", 0),
        ("root.implicitTiling.availableLevels", None),
        ("root.implicitTiling.availableLevels", 2.5),
        ("root.implicitTiling.subtrees.uri", "subtrees/0.subtree"),
    ],
)
def test_a_broken_implicit_tiling_is_noticed(
    implicit: tuple[Json, list[Json]], place: str, value: Any
) -> None:
    broken = copy.deepcopy(implicit[0])
    at(place, value)(broken)
    assert tileset_faults(broken)


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("tileAvailability", None),
        ("tileAvailability", {"constant": 0}),
        ("tileAvailability.constant", 1),
        ("tileAvailability.bitstream", 7),
        ("tileAvailability.availableCount", -1),
        ("childSubtreeAvailability", {"constant": 2}),
        ("contentAvailability", []),
        ("buffers.0.byteLength", 1),
        ("bufferViews.0.byteOffset", 4),
        ("bufferViews.0.buffer", 1),
    ],
)
def test_a_broken_subtree_is_noticed(
    implicit: tuple[Json, list[Json]], place: str, value: Any
) -> None:
    broken = copy.deepcopy(next(s for s in implicit[1] if "bitstream" in s["tileAvailability"]))
    at(place, value)(broken)
    assert subtree_faults(broken)
