"""Scenes of glTF: nodes, names, cameras, lights, extras and skins, through assets and back."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import umbel
from helpers.gltf_builder import GltfBuilder, one, read, skinned
from helpers.gltf_files import binary_of, json_of, validator_errors
from helpers.mesh_files import TETRA_POSITIONS, TETRA_TRIANGLES, corners
from umbel.io.gltf.attach import same_matrix
from umbel.io.gltf.reader import read_root
from umbel.io.gltf.tree import worlds
from umbel.io.scene import Instance, Scene

INDICES = TETRA_TRIANGLES.reshape(-1).astype(np.uint16)


def furnished() -> GltfBuilder:
    """Two meshes on three nodes of a tree, with a camera, a light, and notes everywhere."""
    b = GltfBuilder()
    b.root["asset"] |= {"copyright": "me, 2024", "extras": {"license": "MIT"}}
    b.root["extras"] = {"file": True}
    light = {"type": "point", "color": [1, 0.5, 0], "name": "lamp"}
    b.root["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}
    b.root["extensionsUsed"] = ["KHR_lights_punctual"]
    b.root["cameras"] = [
        {"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}},
        {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0, "zfar": 9}},
    ]
    chair = b.tetra(name="chair", extras={"legs": 4})
    table = b.tetra(name="table")
    lit = {"KHR_lights_punctual": {"light": 0}}
    left = b.node(name="left", mesh=chair, translation=[1, 2, 3], rotation=[0, 0.6, 0, 0.8])
    right = b.node(name="right", mesh=chair, scale=[2, 2, 2], extras={"broken": False})
    lamp = b.node(name="lamp", extensions=lit, translation=[0, 5, 0])
    eye = b.node(name="eye", camera=0, matrix=[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 7, 8, 9, 1])
    plan = b.node(name="plan", camera=1)
    room = b.node(name="room", children=[left, right, lamp, eye, plan], scale=[1, 3, 1])
    b.root["scenes"] = [
        {"nodes": [room, b.node(name="table", mesh=table)], "name": "flat", "extras": [1]}
    ]
    return b


def saved(tmp_path: Path, builder: GltfBuilder, name: str = "in.glb") -> Path:
    path = tmp_path / name
    path.write_bytes(builder.glb())
    return path


def without_geometry(root: dict[str, Any]) -> dict[str, Any]:
    """What of a file is not its meshes' arrays, with meshes by their names and nodes by theirs."""

    def shown(index: int) -> dict[str, Any]:
        node = dict(root["nodes"][index])
        if "mesh" in node:
            mesh = root["meshes"][node["mesh"]]
            node["mesh"] = (mesh["name"], str(mesh.get("extras")))
        node["children"] = [shown(k) for k in node.pop("children", [])]
        return node

    scene = dict(root["scenes"][0])
    scene["nodes"] = [shown(k) for k in scene["nodes"]]
    kept = {k: root.get(k) for k in ("cameras", "extensions", "extras", "extensionsUsed")}
    asset = {k: v for k, v in root["asset"].items() if k not in ("generator", "version")}
    return {"scene": scene, "asset": asset, **kept}


def places_of(mesh: umbel.Mesh) -> np.ndarray:
    """Triangles' middles, in an order that does not depend on theirs."""
    middles = corners(mesh).astype(np.float64).mean(axis=1).round(4) + 0.0
    return middles[np.lexsort(middles.T)]


def extracted(source: Path, instances: str, level: int = 0) -> Path:
    """The file built and extracted again."""
    asset = source.with_name(f"{instances}.umbel")
    umbel.build_scene(source, instances=instances).save(asset)
    opened = umbel.Asset(asset)
    out = source.with_name(f"{instances}.glb")
    umbel.save(out, opened.scene_of(opened.scene_cuts(level=level)))
    return out


@pytest.mark.parametrize("extension", [".glb", ".gltf"])
def test_a_saved_scene_is_the_loaded_one(tmp_path: Path, extension: str) -> None:
    source = saved(tmp_path, furnished())
    out = tmp_path / f"out{extension}"
    umbel.save(out, umbel.load_scene(source))
    assert without_geometry(json_of(out)) == without_geometry(json_of(source))
    assert np.array_equal(corners(umbel.load(out)), corners(umbel.load(source)))
    assert len(json_of(out)["meshes"]) == 2
    assert validator_errors(out) == []


def test_instances_apart_keep_the_tree(tmp_path: Path) -> None:
    source = saved(tmp_path, furnished())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        out = extracted(source, "on")
    assert without_geometry(json_of(out)) == without_geometry(json_of(source))
    scene = umbel.Asset(tmp_path / "on.umbel").scene
    shown = {n["name"]: n["instances"] for n in scene["nodes"] if "instances" in n}
    assert shown == {"left": [0, 1], "right": [1, 1], "table": [2, 1]}
    assert scene["meshes"] == [{"name": "chair", "extras": {"legs": 4}}, {"name": "table"}]
    assert scene["asset"]["copyright"] == "me, 2024"
    assert validator_errors(out) == []


def test_merged_nodes_are_one_warning_and_keep_all_but_their_meshes(tmp_path: Path) -> None:
    source = saved(tmp_path, furnished())
    with pytest.warns(umbel.LoadWarning, match="3 nodes.*'left'.*instances='on'") as said:
        out = extracted(source, "auto")
    assert len(said) == 1
    root, before = json_of(out), json_of(source)
    names = [node.get("name") for node in root["nodes"]]
    assert set(names) >= {node["name"] for node in before["nodes"]}
    assert len([node for node in root["nodes"] if "mesh" in node]) == 1
    assert root["cameras"] == before["cameras"] and root["extensions"] == before["extensions"]
    assert root["asset"]["copyright"] == "me, 2024" and root["extras"] == {"file": True}
    assert np.array_equal(places_of(umbel.load(out)), places_of(umbel.load(source)))
    assert validator_errors(out) == []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        extracted(source, "off")  # as asked for


def test_a_file_that_loses_nothing_says_nothing(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.root["asset"]["copyright"] = "me"
    b.scene(b.node(name="only", children=[b.node(name="inner", mesh=b.tetra(name="shape"))]))
    source = saved(tmp_path, b)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        out = extracted(source, "auto")
        umbel.save(tmp_path / "again.glb", umbel.load(source))
    for path in (out, tmp_path / "again.glb"):
        assert without_geometry(json_of(path)) == without_geometry(json_of(source))


def test_what_a_mesh_has_no_place_for_is_one_warning(tmp_path: Path) -> None:
    b = GltfBuilder()
    uvs, four = np.zeros((4, 2), np.float32), np.ones((4, 4), np.float32)
    attributes = {"POSITION": TETRA_POSITIONS, "COLOR_0": four, "COLOR_1": four, "_BATCHID": uvs}
    attributes |= {f"TEXCOORD_{k}": uvs for k in range(9)}
    target = {"POSITION": b.accessor(TETRA_POSITIONS)}
    variants = {"KHR_materials_variants": {"mappings": []}}
    mesh = b.mesh(
        b.primitive(attributes, INDICES, targets=[target], extensions=variants),
        b.primitive({"POSITION": TETRA_POSITIONS}, mode=1),
        b.primitive({"POSITION": TETRA_POSITIONS}, mode=0),
        weights=[0.5],
    )
    node = b.node(mesh=mesh, extensions={"EXT_of_mine": {"accessor": 3}})
    b.scene(node)
    b.scene(node)
    b.root["extensions"] = {"KHR_materials_variants": {"variants": [{"name": "a"}]}}
    times, moves = b.accessor(np.float32([0, 1])), b.accessor(np.zeros((2, 3), np.float32))
    b.root["animations"] = [
        {
            "channels": [{"sampler": 0, "target": {"node": node, "path": "translation"}}],
            "samplers": [{"input": times, "output": moves}],
        }
    ]
    with pytest.warns(umbel.LoadWarning) as said:
        umbel.load(saved(tmp_path, b))
    assert len(said) == 1
    sentence = str(said[0].message)
    for part in (
        "in.glb", "2 primitives of points or lines", "COLOR_1, TEXCOORD_8, _BATCHID",
        "a morph target (default weights are applied)", "an animation",
        "EXT_of_mine, KHR_materials_variants", "another scene",
    ):  # fmt: skip
        assert part in sentence


# --- skins --------------------------------------------------------------------------------------


def two_skins() -> GltfBuilder:
    """Two meshes that move with joints of skins that share one, and one mesh that does not."""
    b = GltfBuilder()
    parts = []
    hip = b.node(name="hip", rotation=[0.6, 0, 0, 0.8], translation=[0, 1, 0])
    knee = b.node(name="knee", children=[], translation=[0, 2, 0], scale=[1, 2, 1])
    b.root["nodes"][hip]["children"] = [knee]
    far = b.node(name="far", translation=[5, 0, 0])
    for joints in ([hip, knee], [knee, far]):
        inverse = np.tile(np.eye(4, dtype=np.float32).reshape(1, 16), (2, 1))
        b.add("skins", {"joints": joints, "inverseBindMatrices": b.accessor(inverse)})
        index = np.array([[0, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0], [1, 0, 0, 0]], np.uint8)
        weight = np.array([[1, 0, 0, 0], [1, 0, 0, 0], [0.5, 0.5, 0, 0], [1, 0, 0, 0]], np.float32)
        arrays = {"POSITION": TETRA_POSITIONS, "JOINTS_0": index, "WEIGHTS_0": weight}
        mesh = b.mesh(b.primitive(arrays, INDICES))
        parts.append(b.node(name=f"part {len(parts)}", mesh=mesh, skin=len(parts)))
    b.scene(hip, far, *parts, b.node(name="stone", mesh=b.tetra(), translation=[0, 0, 9]))
    return b


@pytest.mark.parametrize("instances", ["on", "off"])
def test_skins_become_one_that_shows_the_rest_pose(tmp_path: Path, instances: str) -> None:
    source = saved(tmp_path, two_skins())
    out = extracted(source, instances)
    before, after = umbel.load(source), umbel.load(out)
    assert np.allclose(places_of(before), places_of(after), atol=1e-4)
    root = json_of(out)
    (skin,) = root["skins"]
    names = [root["nodes"][k].get("name") for k in skin["joints"]]
    assert names[:3] == ["hip", "knee", "far"]  # the shared one once
    assert validator_errors(out) == []
    # Where a joint goes, its vertices go.
    root["nodes"][skin["joints"][2]]["translation"] = [5, 0, 100]
    posed = read_root(root, binary_of(out), "posed", None).flatten()
    went = posed.positions - after.positions
    assert (np.abs(went[:, 2] - 100) < 1e-3).sum() >= 2
    assert (np.abs(went) < 1e-3).all(axis=1).sum() >= 4  # the stone among them


def test_joints_without_a_skin_get_one(tmp_path: Path) -> None:
    weights = np.zeros((4, 4), np.float32)
    weights[:3, :2] = (0.25, 0.75)
    joints = np.array([[3, 5, 0, 0]] * 4, np.uint32)
    mesh = umbel.Mesh(TETRA_POSITIONS, TETRA_TRIANGLES, joints=joints, weights=weights)
    umbel.save(tmp_path / "a.glb", mesh)
    back = umbel.load(tmp_path / "a.glb")
    assert np.array_equal(back.positions, TETRA_POSITIONS)
    assert np.array_equal(back.joints[:3, :2], joints[:3, :2])
    assert np.array_equal(back.weights[:3], weights[:3])
    assert validator_errors(tmp_path / "a.glb") == []


def test_joints_without_size_are_left_out_with_a_word(tmp_path: Path) -> None:
    b = two_skins()
    b.root["nodes"][0]["scale"] = [0, 1, 1]
    source = saved(tmp_path, b)
    with pytest.warns(umbel.LoadWarning, match="joint has no size"):
        umbel.save(tmp_path / "out.glb", umbel.load(source))
    assert "skins" not in json_of(tmp_path / "out.glb")
    assert validator_errors(tmp_path / "out.glb") == []


# --- places -------------------------------------------------------------------------------------


def test_places_of_any_matrix_are_nodes(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    lods = [umbel.build_lod(umbel.shapes.blob(2))]
    matrices = []
    for k in range(6):
        matrix = np.eye(4)
        matrix[:3] = rng.normal(size=(3, 4))
        if k == 0:
            matrix[:3, :3] = np.eye(3)
        matrices.append(matrix)
    umbel.save_asset(tmp_path / "a.umbel", lods, [(0, m) for m in matrices])
    asset = umbel.Asset(tmp_path / "a.umbel")
    umbel.save(tmp_path / "a.glb", asset.scene_of(asset.scene_cuts(level=0)))
    root = json_of(tmp_path / "a.glb")
    assert len(root["meshes"]) == 1
    every = worlds(root["nodes"])
    found = [every[k] for k, node in enumerate(root["nodes"]) if "mesh" in node]
    for wanted, got in zip(matrices, found, strict=True):
        assert np.allclose(wanted, got, atol=1e-6)
    assert validator_errors(tmp_path / "a.glb") == []


def test_the_origin_is_a_translation(tmp_path: Path) -> None:
    origin = (4_500_000.25, 5_000.5, -3_900_000.125)
    mesh = umbel.Mesh(TETRA_POSITIONS, TETRA_TRIANGLES, origin=origin)
    umbel.save(tmp_path / "a.glb", mesh)
    (node,) = json_of(tmp_path / "a.glb")["nodes"]
    assert node == {"mesh": 0, "translation": list(origin)}
    back = umbel.load_scene(tmp_path / "a.glb")
    assert np.array_equal(back.meshes[0].positions, TETRA_POSITIONS)


@pytest.mark.parametrize("instances", ["on", "off"])
def test_nodes_far_from_zero_stay_where_they_are(tmp_path: Path, instances: str) -> None:
    b = GltfBuilder()
    far = [4_500_000.123, 5_000.456, -3_900_000.789]
    inner = b.node(name="inner", mesh=b.tetra(), translation=[0.1, 0, 0])
    b.scene(b.node(name="earth", translation=far, children=[inner]))
    out = extracted(saved(tmp_path, b), instances)
    root = json_of(out)
    if instances == "on":
        assert root["nodes"][0]["translation"] == far
        assert root["nodes"][1] == {"name": "inner", "mesh": 0, "translation": [0.1, 0, 0]}
    else:
        (node,) = [node for node in root["nodes"] if "mesh" in node]
        assert node["name"] == "inner" and abs(np.array(node["translation"]) - far).max() < 2
    got = np.sort(umbel.load(out).world_positions, axis=0)
    assert np.allclose(got, np.sort(TETRA_POSITIONS + far + [0.1, 0, 0], axis=0), rtol=0, atol=1e-6)
    assert validator_errors(out) == []


def test_places_differ_by_more_than_rounding() -> None:
    matrix = np.eye(4)
    matrix[:3, 3] = (1e6, 0, 0)
    near, off = matrix.copy(), matrix.copy()
    near[0, 3] += 1e-8
    off[0, 3] += 1e-3
    assert same_matrix(matrix, near) and not same_matrix(matrix, off)
    turned = matrix.copy()
    turned[0, 1] = 1e-5
    assert not same_matrix(matrix, turned)


@pytest.mark.parametrize(
    "tree",
    [
        {"nodes": [{"children": [1]}, {"children": [0]}]},
        {"nodes": [{"children": [0]}]},
        {"nodes": [{"children": [2]}, {"children": [2]}, {}]},
        {"nodes": [{"children": [7]}]},
        {"nodes": [{"children": [0.5]}, {}]},
        {"nodes": {}},
        {"nodes": [3]},
        {"nodes": [{}], "scenes": [{"nodes": [1]}]},
        {"nodes": [{}], "skins": [{"joints": [-1]}]},
        {"nodes": [{"translation": [1, 2]}]},
    ],
)
def test_trees_that_are_none_are_named(tmp_path: Path, tree: dict[str, Any]) -> None:
    lod = umbel.build_lod((TETRA_POSITIONS, TETRA_TRIANGLES))
    umbel.save_asset(tmp_path / "a.umbel", [lod], scene=tree)
    asset = umbel.Asset(tmp_path / "a.umbel")
    assert asset.scene == tree
    with pytest.raises(umbel.Error, match=r"a\.umbel|nodes\[0\] has"):
        umbel.save(tmp_path / "a.glb", asset.scene_of(asset.scene_cuts(level=0)))
    mesh = umbel.Mesh(TETRA_POSITIONS, TETRA_TRIANGLES, tree=tree, name="bad")
    with pytest.raises(umbel.Error):
        umbel.save(tmp_path / "a.glb", mesh)


def test_an_assets_cameras_are_the_files(tmp_path: Path) -> None:
    source = saved(tmp_path, furnished())
    extracted(source, "on")
    asset = umbel.Asset(tmp_path / "on.umbel")
    shown = asset.scene_mesh(asset.scene_cuts(level=0))
    assert [camera.name for camera in shown.cameras] == ["eye"]
    (wanted,) = umbel.load(source).cameras
    assert np.allclose(shown.cameras[0].position, wanted.position)
    assert shown.cameras[0].fov_y == wanted.fov_y


def _with_texture() -> GltfBuilder:
    b = GltfBuilder()
    png = io.BytesIO()
    Image.new("RGB", (4, 4)).save(png, "PNG")
    b.root["images"] = [{"bufferView": b.view(png.getvalue()), "mimeType": "image/png"}]
    b.root["textures"] = [{"source": 0}]
    return b


def test_a_lightmap_keeps_its_image(tmp_path: Path) -> None:
    b = _with_texture()
    b.root["materials"] = [{"extensions": {"MOZ_lightmap": {"index": 0, "intensity": 0.5}}}]
    arrays = {"POSITION": TETRA_POSITIONS, "TEXCOORD_0": TETRA_POSITIONS[:, :2].copy()}
    b.scene(b.node(mesh=b.mesh(b.primitive(arrays, INDICES, material=0))))
    root = json_of(extracted(saved(tmp_path, b), "off"))
    lightmap = root["materials"][0]["extensions"]["MOZ_lightmap"]
    assert lightmap == {"index": 0, "intensity": 0.5}
    assert (len(root["textures"]), len(root["images"])) == (1, 1)


def test_images_keep_the_names_of_their_files(tmp_path: Path) -> None:
    b = GltfBuilder()
    for name in ("wood", "b\u00e9ton 1"):
        Image.new("RGB", (4, 4), (len(name), 0, 0)).save(tmp_path / f"{name}.png")
    b.root["images"] = [{"uri": "wood.png"}, {"uri": "b%C3%A9ton%201.png", "name": "own"}]
    b.root["textures"] = [{"source": 0}, {"source": 1}]
    b.root["materials"] = [{"normalTexture": {"index": 0}, "emissiveTexture": {"index": 1}}]
    arrays = {"POSITION": TETRA_POSITIONS, "TEXCOORD_0": TETRA_POSITIONS[:, :2].copy()}
    b.scene(b.node(mesh=b.mesh(b.primitive(arrays, INDICES, material=0))))
    images = json_of(extracted(saved(tmp_path, b), "off"))["images"]
    assert [image["name"] for image in images] == ["wood", "own"]


def test_textures_of_meshes_without_uvs_are_lost_with_a_warning(tmp_path: Path) -> None:
    b = _with_texture()
    b.root["materials"] = [{"name": "a", "normalTexture": {"index": 0}}]
    b.scene(b.node(mesh=b.mesh(b.primitive({"POSITION": TETRA_POSITIONS}, INDICES, material=0))))
    mesh = umbel.load(saved(tmp_path, b))
    umbel.build_lod(mesh).save(tmp_path / "a.umbel")
    asset = umbel.Asset(tmp_path / "a.umbel")
    says = "textures of meshes that lack their texture coordinates$"
    with pytest.warns(umbel.LoadWarning, match=f"out.glb was written without: {says}"):
        umbel.save(tmp_path / "out.glb", mesh)
    with pytest.warns(umbel.LoadWarning, match=f"lod.glb has not all textures: {says}"):
        umbel.export_glb(asset, tmp_path / "lod.glb")
    with pytest.warns(umbel.LoadWarning, match=f"tiles was written without: {says}"):
        umbel.export_tiles(asset, tmp_path / "tiles")


def test_packets_of_materials_need_those_of_the_file(tmp_path: Path) -> None:
    b = GltfBuilder()
    packet = {"KHR_xmp_json_ld": {"packet": 0}}
    b.root["extensions"] = {"KHR_xmp_json_ld": {"packets": [{"dc:title": "a"}]}}
    b.root["materials"] = [{"name": "wall", "extensions": packet}]
    b.scene(b.node(mesh=b.mesh(b.primitive({"POSITION": TETRA_POSITIONS}, INDICES, material=0))))
    mesh = umbel.load(saved(tmp_path, b))
    umbel.save(tmp_path / "with.glb", mesh)
    assert json_of(tmp_path / "with.glb")["materials"][0]["extensions"] == packet
    mesh.tree = {}
    umbel.save(tmp_path / "without.glb", mesh)
    assert "extensions" not in json_of(tmp_path / "without.glb")["materials"][0]
    assert mesh.materials[0].extensions == packet


def test_extras_of_a_single_skin_are_kept(tmp_path: Path) -> None:
    b = skinned()
    b.root["skins"][0]["extras"] = {"rig": 1}
    assert json_of(extracted(saved(tmp_path, b), "on"))["skins"][0]["extras"] == {"rig": 1}
    b = two_skins()
    for skin in b.root["skins"]:
        skin["extras"] = {"rig": 1}
    with pytest.warns(umbel.LoadWarning, match="the extras of skins, as they become one"):
        extracted(saved(tmp_path, b), "on")


def test_the_skeleton_of_skins_is_kept_or_lost_with_a_word(tmp_path: Path) -> None:
    b = skinned()
    b.root["skins"][0]["skeleton"] = b.root["skins"][0]["joints"][0]
    root = json_of(extracted(saved(tmp_path, b), "on"))
    skin = root["skins"][0]
    assert skin["skeleton"] == skin["joints"][0] and root["nodes"][skin["skeleton"]]["children"]
    b.root["skins"][0]["skeleton"] = b.root["skins"][0]["joints"][1]  # which is below the other
    with pytest.warns(umbel.LoadWarning, match="written without: the skeleton of skins"):
        out = extracted(saved(tmp_path, b), "on")
    assert "skeleton" not in json_of(out)["skins"][0]


def test_names_of_skins_that_become_one_are_lost_with_a_word(tmp_path: Path) -> None:
    b = two_skins()
    for skin, name in zip(b.root["skins"], ("left", "right"), strict=True):
        skin["name"] = name
    with pytest.warns(umbel.LoadWarning, match="the names of skins but the first, as they become"):
        out = extracted(saved(tmp_path, b), "on")
    assert json_of(out)["skins"][0]["name"] == "left"


def test_names_of_skins_that_are_no_text_are_left_out(tmp_path: Path) -> None:
    b = two_skins()
    for skin, name in zip(b.root["skins"], (["left"], "right"), strict=True):
        skin["name"] = name
    out = extracted(saved(tmp_path, b), "on")
    assert json_of(out)["skins"][0]["name"] == "right"


def test_colours_outside_are_clamped_with_a_word(tmp_path: Path) -> None:
    colors = np.ones((4, 4), np.float32)
    colors[2, 0] = 2.5
    mesh = umbel.Mesh(TETRA_POSITIONS, TETRA_TRIANGLES, colors=colors)
    with pytest.warns(umbel.LoadWarning, match="colours outside 0 to 1, which become 0 or 1"):
        umbel.save(tmp_path / "a.glb", mesh)
    assert umbel.load(tmp_path / "a.glb").colors.max() == 1


def test_missing_tangents_follow_the_uvs(tmp_path: Path) -> None:
    flat = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    turned = np.float32([[1, 0], [1, 1], [0, 1], [0, 0]])  # u grows towards -y, v to +x
    faces = np.uint16([0, 1, 2, 0, 2, 3])
    up = np.tile(np.float32([0, 0, 1]), (4, 1))
    tangents = np.tile(np.float32([1, 0, 0, 1]), (4, 1))
    b = GltfBuilder()
    arrays = {"POSITION": flat, "NORMAL": up, "TEXCOORD_0": flat[:, :2] * [1, -1]}
    arrays["TEXCOORD_0"] = arrays["TEXCOORD_0"].astype(np.float32)
    primitives = [
        b.primitive({**arrays, "TANGENT": tangents}, faces),
        b.primitive(arrays, faces),
        b.primitive({**arrays, "TEXCOORD_0": turned}, faces),
    ]
    mesh = read(tmp_path, one(*primitives, builder=b))
    assert np.allclose(mesh.tangents[4:8], tangents)
    assert np.allclose(mesh.tangents[8:], [0, -1, 0, -1])


def test_meshes_without_an_instance_are_named(tmp_path: Path) -> None:
    meshes = [umbel.shapes.grid(1, 1), umbel.shapes.grid(2, 2)]
    with pytest.warns(umbel.LoadWarning, match="written without: meshes without an instance"):
        umbel.save(tmp_path / "a.glb", Scene(meshes, instances=[Instance(1)]))
    assert len(json_of(tmp_path / "a.glb")["meshes"]) == 1


@pytest.mark.parametrize(
    ("instance", "says"),
    [
        (Instance(1), "instance 0 is of mesh 1, there are 1"),
        (Instance(0, np.full((4, 4), np.nan)), "instance 0 has a transform that is not fin"),
    ],
)
def test_instances_that_are_none_are_named(tmp_path: Path, instance: Instance, says: str) -> None:
    scene = Scene([umbel.shapes.grid(1, 1)], instances=[instance])
    with pytest.raises(umbel.Error, match=f"cannot write .*a.glb: {says}"):
        umbel.save(tmp_path / "a.glb", scene)
    assert not list(tmp_path.iterdir())
