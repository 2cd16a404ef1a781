"""What a glTF file holds and a scene cannot is named in one warning."""

from __future__ import annotations

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import umbel
from helpers.gltf_builder import INDICES, GltfBuilder, one, read
from helpers.mesh_files import TETRA_POSITIONS
from umbel.errors import LoadWarning
from umbel.io import load_scene
from umbel.io.blocks import open_source


def lost(tmp_path: Path, builder: GltfBuilder) -> str:
    """What the warning says."""
    with pytest.warns(LoadWarning, match="left out: ") as caught:
        read(tmp_path, builder)
    [warning] = caught
    return str(warning.message).partition("left out: ")[2]


def test_extras_and_extensions_of_primitives_meshes_and_colours(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.root["materials"] = [
        {"pbrMetallicRoughness": {"extras": {"a": 1}, "extensions": {"EXT_b": {"c": "d"}}}}
    ]
    primitive = b.primitive({"POSITION": TETRA_POSITIONS}, INDICES, material=0, extras={"e": 2})
    mesh = b.mesh(primitive, extensions={"EXT_a": {"f": 3}})
    b.scene(b.node(mesh=mesh))
    assert lost(tmp_path, b) == (
        "EXT_a, EXT_b; the extras of primitives; the extras of pbrMetallicRoughness"
    )


def test_an_unknown_alpha_mode_becomes_opaque(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.root["materials"] = [{"alphaMode": "HASHED"}, {"alphaMode": "BLEND"}]
    b.scene(b.node(mesh=b.tetra()))
    assert lost(tmp_path, b) == "the alphaMode 'HASHED', which is none of glTF's"
    with pytest.warns(LoadWarning):
        materials = load_scene(tmp_path / "mesh.glb").materials
    assert [m.alpha_mode for m in materials[:2]] == ["OPAQUE", "BLEND"]


@pytest.mark.parametrize("table", ["accessors", "bufferViews", "buffers"])
def test_extras_and_extensions_of_data(tmp_path: Path, table: str) -> None:
    b = GltfBuilder()
    b.scene(b.node(mesh=b.tetra()))
    root = json.loads(b.gltf())
    root[table][0] |= {"extras": {"a": 1}, "extensions": {"EXT_a": {}}}
    (tmp_path / "a.gltf").write_text(json.dumps(root))
    says = "left out: EXT_a; the extras of accessors and buffers$"
    with pytest.warns(LoadWarning, match=says):
        load_scene(tmp_path / "a.gltf")
    with pytest.warns(LoadWarning, match=says):
        open_source(tmp_path / "a.gltf", tmp_path)


def test_attributes_of_instances(tmp_path: Path) -> None:
    b = GltfBuilder()
    moved = np.float32([[0, 0, 0], [2, 0, 0]])
    attributes = {"TRANSLATION": b.accessor(moved), "_ID": b.accessor(np.float32([7, 8]))}
    instancing = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    b.scene(b.node(mesh=b.tetra(), extensions=instancing))
    assert lost(tmp_path, b) == "the instances' attributes _ID"


def test_meshes_that_no_node_of_the_scene_has(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.scene(b.node(mesh=b.tetra()))
    b.node(mesh=b.tetra())
    node = "a node that the scene does not have"
    assert lost(tmp_path, b) == f"a mesh that is not drawn; {node}"
    b.tetra()
    assert lost(tmp_path, b) == f"2 meshes that are not drawn; {node}"


def test_nodes_that_the_scene_does_not_have(tmp_path: Path) -> None:
    b = GltfBuilder()
    mesh = b.tetra()
    b.scene(b.node(mesh=mesh))
    b.node(mesh=mesh, name="another instance")
    assert lost(tmp_path, b) == "a node that the scene does not have"
    b.node(camera=0, children=[b.node(name="below")])
    b.root["cameras"] = [{"type": "orthographic"}]
    assert lost(tmp_path, b) == "3 nodes that the scene does not have"
    with pytest.warns(LoadWarning, match="3 nodes that the scene does not have"):
        open_source(tmp_path / "mesh.glb", tmp_path)


def test_extras_within_extensions_and_sparse_accessors(tmp_path: Path) -> None:
    b = GltfBuilder()
    moved = {"attributes": {"TRANSLATION": b.accessor(np.float32([[0, 0, 0], [2, 0, 0]]))}}
    instancing = {"EXT_mesh_gpu_instancing": {**moved, "extras": {"seed": 7}}}
    pixels = io.BytesIO()
    Image.new("RGB", (2, 2)).save(pixels, "WEBP")
    b.root["images"] = [{"bufferView": b.view(pixels.getvalue())}]
    b.root["textures"] = [{"extensions": {"EXT_texture_webp": {"source": 0, "extras": {"a": 1}}}}]
    b.root["materials"] = [{"normalTexture": {"index": 0}}]
    b.scene(b.node(mesh=b.tetra(), extensions=instancing))
    indices = {"bufferView": b.view(bytes(4)), "componentType": 5125, "extras": {"b": 2}}
    values = {"bufferView": b.view(bytes(12))}
    b.root["accessors"][1]["sparse"] = {"count": 1, "indices": indices, "values": values}
    assert lost(tmp_path, b) == (
        "the extras of accessors and buffers; "
        "extras of EXT_mesh_gpu_instancing, extras of EXT_texture_webp"
    )


def test_names_where_gltf_has_none(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.root["materials"] = [{"name": "m", "pbrMetallicRoughness": {"name": "p"}}]
    primitive = b.primitive({"POSITION": TETRA_POSITIONS}, INDICES, material=0, name="q")
    b.scene(b.node(mesh=b.mesh(primitive, name="mesh"), name="n"))
    names = "materials[0].pbrMetallicRoughness.name, meshes[0].primitives[0].name"
    assert lost(tmp_path, b) == f"{names}, which glTF does not have"


def test_numbers_that_json_does_not_have(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.scene(b.node(mesh=b.tetra(), extras={"a": float("nan"), "b": [-float("inf"), 1]}))
    with pytest.warns(LoadWarning, match="NaN, -Infinity, which JSON does not have, become null"):
        mesh = read(tmp_path, b)
    umbel.save(tmp_path / "out.glb", mesh)
    assert load_scene(tmp_path / "out.glb").tree["nodes"][0]["extras"] == {
        "a": None,
        "b": [None, 1],
    }


def test_names_that_an_object_has_twice(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.scene(b.node(mesh=b.tetra(name="m"), name="a", extras={"k": 1}))
    path = tmp_path / "a.gltf"
    path.write_bytes(b.gltf().replace(b'"name": "a"', b'"name": "z", "name": "a"'))
    with pytest.warns(LoadWarning, match="all but the last of 'name', which .* are left out"):
        scene = load_scene(path)
    assert scene.instances[0].name == "a"


def test_images_that_no_material_uses(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.root["images"] = [{"uri": "a.png"}]
    b.root["textures"] = [{"source": 0}]
    b.scene(b.node(mesh=b.tetra()))
    assert lost(tmp_path, b) == "an image that is not used"


def test_variants(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.root["extensions"] = {"KHR_materials_variants": {"variants": [{"name": "red"}]}}
    b.scene(b.node(mesh=b.tetra()))
    assert lost(tmp_path, b) == "KHR_materials_variants"
    with pytest.warns(LoadWarning):
        assert "extensions" not in read(tmp_path, b).tree


@pytest.mark.parametrize(
    ("sets", "names"),
    [
        ({"WEIGHTS_0": "f4"}, "WEIGHTS_0"),
        ({"JOINTS_0": "f4", "WEIGHTS_0": "f4"}, "JOINTS_0, WEIGHTS_0"),
        ({"JOINTS_0": "u1", "WEIGHTS_0": "f4", "JOINTS_1": "u1"}, "JOINTS_1"),
        ({"JOINTS_1": "u1", "WEIGHTS_1": "f4"}, "JOINTS_1, WEIGHTS_1"),
    ],
)
def test_joints_and_weights_without_each_other(
    tmp_path: Path, sets: dict[str, str], names: str
) -> None:
    b = GltfBuilder()
    arrays: dict[str, Any] = {name: np.zeros((4, 4), kind) for name, kind in sets.items()}
    b = one(b.primitive({"POSITION": TETRA_POSITIONS, **arrays}, INDICES), builder=b)
    assert lost(tmp_path, b) == f"the attributes {names}"


@pytest.mark.parametrize("kind", [b"ABCD", b"BIN\0"])
def test_chunks_that_gltf_does_not_have(tmp_path: Path, kind: bytes) -> None:
    b = GltfBuilder()
    b.scene(b.node(mesh=b.tetra()))
    data = bytearray(b.glb())
    place = len(data)
    data += struct.pack("<I4s4x", 4, kind)
    data[8:12] = struct.pack("<I", len(data))
    with pytest.warns(LoadWarning, match=f"1 chunks that glTF does not have, from byte {place} "):
        assert len(read(tmp_path, bytes(data)).triangles) == 4
