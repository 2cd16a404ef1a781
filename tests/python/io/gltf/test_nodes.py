"""Nodes, GPU instances, skins and morph targets: where meshes stand."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from helpers.gltf_builder import INDICES, GltfBuilder, read, skinned
from helpers.mesh_files import (
    TETRA_POSITIONS,
    bumpy_sphere,
    signed_volume,
)
from umbel.errors import LoadWarning
from umbel.io import load_scene


def test_gpu_instances_stand_where_nodes_would(tmp_path: Path) -> None:
    rng = np.random.default_rng(9)
    n = 5
    translation = rng.random((n, 3)).astype(np.float32) * 10
    rotation = rng.normal(size=(n, 4))
    rotation = (rotation / np.linalg.norm(rotation, axis=1, keepdims=True)).astype(np.float32)
    scale = rng.random((n, 3)).astype(np.float32) + 0.5
    parent = {"translation": [1, 2, 3], "rotation": [0, 0, 0.6, 0.8], "scale": [2, 1, 1]}
    b = GltfBuilder()
    attributes = {"TRANSLATION": b.accessor(translation), "ROTATION": b.accessor(rotation),
                  "SCALE": b.accessor(scale)}  # fmt: skip
    b.root["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    b.scene(b.node(mesh=b.tetra(), **parent,
                   extensions={"EXT_mesh_gpu_instancing": {"attributes": attributes}}))  # fmt: skip
    got = read(tmp_path, b)
    c = GltfBuilder()
    tetra = c.tetra()
    children = [
        c.node(mesh=tetra, translation=t.tolist(), rotation=r.tolist(), scale=s.tolist())
        for t, r, s in zip(translation, rotation, scale, strict=True)
    ]
    c.scene(c.node(children=children, **parent))
    want = read(tmp_path, c)
    assert len(got.triangles) == 4 * n
    assert np.allclose(got.positions, want.positions, atol=1e-5)
    path = tmp_path / "scene.glb"
    path.write_bytes(b.glb())
    scene = load_scene(path)
    assert len(scene.meshes) == 1
    assert len(scene.instances) == n


def test_gpu_instances_without_a_place_are_as_many_as_their_attributes_say(tmp_path: Path) -> None:
    b = GltfBuilder()
    attributes = {"_COLOR": b.accessor(np.ones((3, 3), np.float32))}
    extensions = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    b.scene(b.node(mesh=b.tetra(), extensions=extensions))
    path = tmp_path / "scene.glb"
    path.write_bytes(b.glb())
    with pytest.warns(LoadWarning, match="the instances' attributes _COLOR"):
        scene = load_scene(path)
    assert [instance.transform.tolist() for instance in scene.instances] == [np.eye(4).tolist()] * 3


def test_transforms_compose_from_parent_to_child(tmp_path: Path) -> None:
    b = GltfBuilder()
    half = float(np.sqrt(0.5))
    leaf = b.node(mesh=b.tetra(), scale=[2, 2, 2])
    middle = b.node(children=[leaf], rotation=[0, 0, half, half])  # x to y
    matrix = np.eye(4)
    matrix[:3, 3] = [10, 20, 30]
    b.scene(b.node(children=[middle], matrix=matrix.T.reshape(-1).tolist()))
    mesh = read(tmp_path, b)
    assert np.allclose(
        mesh.positions, [[10, 20, 30], [10, 22, 30], [8, 20, 30], [10, 20, 32]], atol=1e-6
    )


def test_mirrored_nodes_keep_front_faces_normals_and_handedness(tmp_path: Path) -> None:
    positions, triangles = bumpy_sphere()
    normals = (positions / np.linalg.norm(positions, axis=1, keepdims=True)).astype(np.float32)
    tangents = np.zeros((len(positions), 4), np.float32)
    tangents[:, :3] = np.cross([0.3, 0.5, 0.8], normals)
    tangents[:, :3] /= np.linalg.norm(tangents[:, :3], axis=1, keepdims=True)
    tangents[:, 3] = 1
    bitangents = np.cross(normals, tangents[:, :3])
    for scale in ([-1, 2, 3], [1, 2, 3], [-1, -2, 3], [-1, -2, -3]):
        b = GltfBuilder()
        attributes = {"POSITION": positions, "NORMAL": normals, "TANGENT": tangents}
        mesh_index = b.mesh(b.primitive(attributes, triangles.reshape(-1)))
        b.scene(b.node(mesh=mesh_index, scale=scale))
        mesh = read(tmp_path, b)
        assert signed_volume(mesh) > 0
        expected = normals / np.array(scale)
        expected /= np.linalg.norm(expected, axis=1, keepdims=True)
        assert np.allclose(mesh.normals, expected, atol=1e-6)
        # Tangent and bitangent are directions on the surface, and move with it.
        along = tangents[:, :3] * scale
        assert np.allclose(
            mesh.tangents[:, :3], along / np.linalg.norm(along, axis=1, keepdims=True), atol=1e-6
        )
        moved = np.cross(mesh.normals, mesh.tangents[:, :3]) * mesh.tangents[:, 3:]
        assert ((moved * (bitangents * scale)).sum(axis=1) > 0).all()


def test_the_default_scene_is_drawn_and_nothing_else(tmp_path: Path) -> None:
    b = GltfBuilder()
    tetra = b.tetra()
    nodes = [b.node(mesh=tetra, translation=[k, 0, 0]) for k in range(4)]
    b.scene(nodes[0])
    b.scene(nodes[1], nodes[2])
    assert len(read(tmp_path, b).triangles) == 4
    b.root["scene"] = 1
    assert len(read(tmp_path, b).triangles) == 8
    del b.root["scene"], b.root["scenes"]
    assert len(read(tmp_path, b).triangles) == 16


def test_a_file_without_meshes_is_an_empty_mesh(tmp_path: Path) -> None:
    mesh = read(tmp_path, GltfBuilder())
    assert mesh.positions.shape == (0, 3)
    assert mesh.triangles.shape == (0, 3)


def test_skinned_meshes_stand_where_their_joints_put_them(tmp_path: Path) -> None:
    mesh = read(tmp_path, skinned())
    expected = TETRA_POSITIONS + np.array([2, 0, 0])
    expected[3] = [2, 0, 6]
    assert np.allclose(mesh.positions, expected, atol=1e-6)


def test_default_morph_weights_are_applied(tmp_path: Path) -> None:
    b = GltfBuilder()
    target = {"POSITION": b.accessor(np.float32([[0, 0, 0], [4, 0, 0], [0, 0, 0], [0, 0, 8]]))}
    primitive = b.primitive({"POSITION": TETRA_POSITIONS}, INDICES, targets=[target])
    mesh = b.mesh(primitive, weights=[0.5])
    b.scene(b.node(mesh=mesh), b.node(mesh=mesh, weights=[0.0]))
    positions = read(tmp_path, b).positions
    assert positions[:4].tolist() == [[0, 0, 0], [3, 0, 0], [0, 1, 0], [0, 0, 5]]
    assert np.array_equal(positions[4:], TETRA_POSITIONS)


def test_morph_targets_move_colours_and_texture_coordinates(tmp_path: Path) -> None:
    b = GltfBuilder()
    half, quarter = np.full((4, 3), 0.5, np.float32), np.full((4, 2), 0.25, np.float32)
    target = {"COLOR_0": b.accessor(half), "TEXCOORD_0": b.accessor(quarter)}
    base = {"POSITION": TETRA_POSITIONS, "COLOR_0": np.zeros((4, 4), np.float32),
            "TEXCOORD_0": quarter}  # fmt: skip
    mesh = b.mesh(b.primitive(base, INDICES, targets=[target]))
    b.scene(b.node(mesh=mesh, weights=[0.5]))
    with pytest.warns(LoadWarning, match="a morph target .default weights are applied"):
        got = read(tmp_path, b)
    assert got.colors.tolist() == [[0.25, 0.25, 0.25, 0]] * 4
    assert got.uvs.tolist() == [[0.375, 0.375]] * 4


def test_deep_chains_of_nodes_are_walked(tmp_path: Path) -> None:
    b = GltfBuilder()
    tetra = b.tetra()
    n = 5000
    b.root["nodes"] = [{"translation": [1, 0, 0], "children": [k + 1]} for k in range(n - 1)]
    b.root["nodes"].append({"mesh": tetra})
    b.scene(0)
    assert read(tmp_path, json.loads(json.dumps(b.root)) and b).positions[0, 0] == n - 1
