"""What exports leave out of an asset is one warning."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import umbel
from helpers.gltf_builder import INDICES, GltfBuilder
from helpers.mesh_files import TETRA_POSITIONS
from umbel.errors import LoadWarning

FORMATS = ["tiles", "glb"]


def export(kind: str, asset: Path, folder: Path) -> Any:
    if kind == "tiles":
        return umbel.export_tiles(asset, folder / "out")
    return umbel.export_glb(asset, folder / "out.glb")


@pytest.mark.parametrize("kind", FORMATS)
def test_what_is_left_out_is_named(tmp_path: Path, kind: str) -> None:
    b = GltfBuilder()
    skinned = {"JOINTS_0": np.zeros((4, 4), np.uint8),
               "WEIGHTS_0": np.float32([[1, 0, 0, 0]] * 4)}  # fmt: skip
    mesh = b.mesh(b.primitive({"POSITION": TETRA_POSITIONS, **skinned}, INDICES), extras={"a": 1})
    joint = b.node(name="joint")
    b.root["skins"] = [{"joints": [joint]}]
    b.root["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}]
    b.root["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}
    b.scene(joint, b.node(mesh=mesh, skin=0), b.node(camera=0))
    (tmp_path / "a.glb").write_bytes(b.glb())
    umbel.build_scene(tmp_path / "a.glb").save(tmp_path / "a.umbel")
    says = (
        "was written without: joints and weights; names, extras and extensions of nodes; "
        "cameras; lights; extras of the scene and its meshes"
    )
    with pytest.warns(LoadWarning, match=says):
        export(kind, tmp_path / "a.umbel", tmp_path)


@pytest.mark.parametrize("kind", FORMATS)
def test_colours_that_are_too_bright_are_named(tmp_path: Path, kind: str) -> None:
    mesh = umbel.Mesh(TETRA_POSITIONS, INDICES.reshape(-1, 3).astype(np.uint32))
    mesh.colors = np.full((4, 4), 1.5, np.float32)
    umbel.build_lod(mesh).save(tmp_path / "a.umbel")
    with pytest.warns(LoadWarning, match="without: colours outside 0 to 1, which become 0 or 1"):
        export(kind, tmp_path / "a.umbel", tmp_path)


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("count", [0, 1])
def test_numbers_without_a_material_are_named(tmp_path: Path, kind: str, count: int) -> None:
    mesh = umbel.Mesh(TETRA_POSITIONS, INDICES.reshape(-1, 3).astype(np.uint32))
    mesh.material_ids = np.arange(len(mesh.triangles), dtype=np.uint32)
    mesh.materials = [umbel.Material(name="red")][:count]
    umbel.build_lod(mesh).save(tmp_path / "a.umbel")
    with pytest.warns(LoadWarning, match="without: numbers of materials that are not there"):
        export(kind, tmp_path / "a.umbel", tmp_path)


@pytest.mark.parametrize("kind", FORMATS)
def test_where_meshes_are_is_no_loss(
    tmp_path: Path, kind: str, recwarn: pytest.WarningsRecorder
) -> None:
    b = GltfBuilder()
    tetra = b.tetra()
    b.scene(b.node(mesh=tetra), b.node(mesh=tetra, translation=[3, 0, 0]))
    (tmp_path / "a.glb").write_bytes(b.glb())
    umbel.build_scene(tmp_path / "a.glb", instances="on").save(tmp_path / "a.umbel")
    export(kind, tmp_path / "a.umbel", tmp_path)
    assert not recwarn.list
