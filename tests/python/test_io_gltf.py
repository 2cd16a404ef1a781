"""Reading glTF: primitives, accessors, extensions, nodes, skins, and what is wrong with files."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from io_helpers import (
    TETRA_POSITIONS,
    TETRA_TRIANGLES,
    GltfBuilder,
    bumpy_sphere,
    corners,
    signed_volume,
)
from umbel.errors import Error, LoadWarning
from umbel.io import load, load_scene

INDICES = TETRA_TRIANGLES.astype(np.uint16).reshape(-1)


def read(tmp_path: Path, data: bytes | GltfBuilder, name: str = "mesh.glb") -> Any:
    path = tmp_path / name
    path.write_bytes(data.glb() if isinstance(data, GltfBuilder) else data)
    return load(path)


def one(*primitives: Any, builder: GltfBuilder, **mesh: Any) -> GltfBuilder:
    builder.scene(builder.node(mesh=builder.mesh(*primitives, **mesh)))
    return builder


# --- primitives -------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.uint32])
def test_triangles_of_every_index_type(tmp_path: Path, kind: Any) -> None:
    b = GltfBuilder()
    one(b.primitive({"POSITION": TETRA_POSITIONS}, INDICES.astype(kind)), builder=b)
    mesh = read(tmp_path, b)
    assert np.array_equal(mesh.positions, TETRA_POSITIONS)
    assert np.array_equal(mesh.triangles, TETRA_TRIANGLES)
    assert mesh.material_ids is None


@pytest.mark.parametrize("indexed", [True, False])
def test_strips_and_fans_make_the_triangles_that_the_specification_says(
    tmp_path: Path, indexed: bool
) -> None:
    points = np.random.default_rng(1).random((7, 3)).astype(np.float32)
    order = np.array([3, 1, 4, 0, 5, 2, 6], np.uint8) if indexed else np.arange(7)
    for mode in (4, 5, 6):
        b = GltfBuilder()
        indices = order.astype(np.uint8) if indexed else None
        one(b.primitive({"POSITION": points}, indices, mode=mode), builder=b)
        if mode == 4:
            with pytest.warns(LoadWarning, match="last whole triangle"):
                got = corners(read(tmp_path, b))
            want = [(3 * i, 3 * i + 1, 3 * i + 2) for i in range(2)]
        else:
            got = corners(read(tmp_path, b))
            want = [
                (i, i + 1 + i % 2, i + 2 - i % 2) if mode == 5 else (i + 1, i + 2, 0)
                for i in range(5)
            ]
        assert len(got) == len(want)
        for triangle, places in zip(got, want, strict=True):
            expected = points[order[list(places)]]
            assert any(np.array_equal(np.roll(triangle, k, axis=0), expected) for k in range(3))


def test_points_and_lines_are_left_out_with_a_warning(tmp_path: Path) -> None:
    b = GltfBuilder()
    lines = [b.primitive({"POSITION": TETRA_POSITIONS}, mode=m) for m in (0, 1, 2, 3)]
    one(*lines, b.primitive({"POSITION": TETRA_POSITIONS}, INDICES), builder=b)
    with pytest.warns(LoadWarning, match="4 primitives of points or lines"):
        assert len(read(tmp_path, b).triangles) == 4


def test_primitives_that_share_vertices_share_them_still(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.root["materials"] = [{"name": "a"}, {"name": "b"}]
    position = b.accessor(TETRA_POSITIONS)
    first = b.primitive({"POSITION": position}, INDICES[:6], material=1)
    other = b.primitive({"POSITION": TETRA_POSITIONS + 5}, INDICES[:3])
    second = b.primitive({"POSITION": position}, INDICES[6:], material=0)
    mesh = read(tmp_path, one(first, other, second, builder=b))
    assert len(mesh.positions) == 8
    assert np.array_equal(mesh.triangles[[0, 1, 3, 4]], TETRA_TRIANGLES)
    assert mesh.material_ids.tolist() == [1, 1, 2, 0, 0]
    assert [m.name for m in mesh.materials] == ["a", "b", "default"]


def test_attributes_that_some_primitives_lack_are_filled_in(tmp_path: Path) -> None:
    b = GltfBuilder()
    n = np.tile(np.float32([[0, 0, 1]]), (4, 1))
    t = np.tile(np.float32([[1, 0, 0, -1]]), (4, 1))
    uv = np.random.default_rng(2).random((4, 2)).astype(np.float32)
    full = {"POSITION": TETRA_POSITIONS, "NORMAL": n, "TANGENT": t, "TEXCOORD_0": uv,
            "COLOR_0": np.full((4, 3), 0.5, np.float32)}  # fmt: skip
    bare = {"POSITION": TETRA_POSITIONS + 3}
    mesh = read(tmp_path, one(b.primitive(full, INDICES), b.primitive(bare, INDICES), builder=b))
    assert np.array_equal(mesh.normals[:4], n)
    assert np.array_equal(mesh.tangents[:4], t)
    assert np.array_equal(mesh.uvs, np.concatenate([uv, np.zeros((4, 2))]))
    assert mesh.colors.tolist() == [[0.5, 0.5, 0.5, 1]] * 4 + [[1, 1, 1, 1]] * 4
    # The corner at the origin sees three right triangles of equal area.
    assert np.allclose(mesh.normals[4], -1 / np.sqrt(3), atol=1e-6)
    assert np.allclose(np.linalg.norm(mesh.tangents[4:, :3], axis=1), 1, atol=1e-6)
    assert np.abs((mesh.tangents[4:, :3] * mesh.normals[4:]).sum(axis=1)).max() < 1e-6


# --- accessors --------------------------------------------------------------------------------


def test_interleaved_vertices(tmp_path: Path) -> None:
    table = np.zeros(4, [("p", "<f4", 3), ("n", "i1", 4), ("uv", "<u2", 2)])
    table["p"] = TETRA_POSITIONS
    table["n"] = [[127, 0, 0, 9], [0, -128, 0, 9], [0, 0, -127, 9], [90, 0, 90, 9]]
    table["uv"] = [[0, 65535], [65535, 0], [32768, 1], [2, 3]]
    b = GltfBuilder()
    view = b.view(table.tobytes(), byteStride=table.itemsize)
    common = {"bufferView": view, "count": 4}
    p = b.add("accessors", {**common, "componentType": 5126, "type": "VEC3"})
    n = b.add("accessors", {**common, "componentType": 5120, "type": "VEC3", "byteOffset": 12,
                            "normalized": True})  # fmt: skip
    uv = b.add("accessors", {**common, "componentType": 5123, "type": "VEC2", "byteOffset": 16,
                             "normalized": True})  # fmt: skip
    mesh = read(
        tmp_path,
        one(b.primitive({"POSITION": p, "NORMAL": n, "TEXCOORD_0": uv}, INDICES), builder=b),
    )
    assert np.array_equal(mesh.positions, TETRA_POSITIONS)
    expected = np.float32([[127, 0, 0], [0, -127, 0], [0, 0, -127], [90, 0, 90]]) / np.float32(127)
    assert np.array_equal(mesh.normals, expected)
    assert np.array_equal(mesh.uvs, (table["uv"] / 65535).astype(np.float32))


@pytest.mark.parametrize(
    ("kind", "scale"), [("i1", 127), ("u1", 255), ("i2", 32767), ("u2", 65535)]
)
def test_quantised_positions_normalised_and_not(tmp_path: Path, kind: str, scale: int) -> None:
    stored = np.array([[0, 1, 2], [100, 3, 4], [5, 120, 6], [7, 8, 127]], kind)
    padded = np.zeros((4, 4), kind)
    padded[:, :3] = stored
    for normalized in (False, True):
        b = GltfBuilder()
        b.root["extensionsRequired"] = b.root["extensionsUsed"] = ["KHR_mesh_quantization"]
        view = b.view(padded.tobytes(), byteStride=padded.itemsize * 4)
        component = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123}[kind]
        p = b.add("accessors", {"bufferView": view, "componentType": component, "count": 4,
                                "type": "VEC3", "normalized": normalized})  # fmt: skip
        mesh = read(tmp_path, one(b.primitive({"POSITION": p}, INDICES), builder=b))
        expected = stored.astype(np.float32) / np.float32(scale if normalized else 1)
        assert np.array_equal(mesh.positions, expected)


@pytest.mark.parametrize("based", [True, False])
def test_sparse_accessors_replace_elements(tmp_path: Path, based: bool) -> None:
    b = GltfBuilder()
    base = b.accessor(TETRA_POSITIONS)
    places, values = np.array([1, 3], np.uint16), np.float32([[9, 8, 7], [6, 5, 4]])
    b.root["accessors"][base]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": b.view(places.tobytes()), "componentType": 5123},
        "values": {"bufferView": b.view(values.tobytes())},
    }
    expected = TETRA_POSITIONS.copy()
    if not based:
        del b.root["accessors"][base]["bufferView"]
        expected[:] = 0
    expected[[1, 3]] = values
    mesh = read(tmp_path, one(b.primitive({"POSITION": base}, INDICES), builder=b))
    assert np.array_equal(mesh.positions, expected)


@pytest.mark.parametrize("width", [3, 4])
@pytest.mark.parametrize("kind", ["u1", "u2", "f4"])
def test_colours_of_every_kind(tmp_path: Path, width: int, kind: str) -> None:
    largest = {"u1": 255, "u2": 65535, "f4": 1}[kind]
    rng = np.random.default_rng(4)
    values = (rng.random((4, width)) * largest).astype(kind)
    b = GltfBuilder()
    color = b.accessor(values, normalized=kind != "f4")
    mesh = read(
        tmp_path,
        one(b.primitive({"POSITION": TETRA_POSITIONS, "COLOR_0": color}, INDICES), builder=b),
    )
    assert mesh.colors.shape == (4, 4)
    assert np.allclose(mesh.colors[:, :width], values / np.float32(largest), rtol=1e-7)
    if width == 3:
        assert (mesh.colors[:, 3] == 1).all()


# --- where the bytes are ----------------------------------------------------------------------


def test_data_uris_files_beside_and_names_with_spaces(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.scene(b.node(mesh=b.tetra()))
    (tmp_path / "the data.bin").write_bytes(b.data)
    for text in (b.gltf(), b.gltf("the%20data.bin"), b.gltf("./the data.bin")):
        mesh = read(tmp_path, text, "mesh.gltf")
        assert np.array_equal(corners(mesh), TETRA_POSITIONS[TETRA_TRIANGLES])


def test_content_wins_over_the_extension(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.scene(b.node(mesh=b.tetra()))
    assert len(read(tmp_path, b.glb(), "mesh.gltf").triangles) == 4
    assert len(read(tmp_path, b.gltf(), "mesh.glb").triangles) == 4
    assert len(read(tmp_path, b.glb(), "mesh.ply").triangles) == 4


# --- extensions -------------------------------------------------------------------------------


@pytest.mark.parametrize("keep_order", [True, False])
def test_draco_gives_the_mesh_that_was_encoded(tmp_path: Path, keep_order: bool) -> None:
    DracoPy = pytest.importorskip("DracoPy")
    positions, triangles = bumpy_sphere()
    normals = (positions / np.linalg.norm(positions, axis=1, keepdims=True)).astype(np.float32)
    uvs = positions[:, :2].astype(np.float64)
    colors = np.random.default_rng(3).integers(0, 256, (len(positions), 4)).astype(np.uint8)
    packed = DracoPy.encode(
        positions, triangles, quantization_bits=16, preserve_order=keep_order,
        normals=normals.astype(np.float64), tex_coord=uvs, colors=colors,
    )  # fmt: skip
    kinds = {a["attribute_type"]: a["unique_id"] for a in DracoPy.decode(packed).attributes}
    ids = {k: kinds[v] for v, k in enumerate(("POSITION", "NORMAL", "COLOR_0", "TEXCOORD_0"))}
    b = GltfBuilder()
    n = len(positions)

    def promised(component: int, kind: str, count: int = n, **extra: Any) -> int:
        entry = {"componentType": component, "type": kind, "count": count, **extra}
        return b.add("accessors", entry)

    primitive = {
        "attributes": {
            "POSITION": promised(5126, "VEC3"),
            "NORMAL": promised(5126, "VEC3"),
            "COLOR_0": promised(5121, "VEC4", normalized=True),
            "TEXCOORD_0": promised(5126, "VEC2"),
        },
        "indices": promised(5125, "SCALAR", triangles.size),
        "extensions": {
            "KHR_draco_mesh_compression": {"bufferView": b.view(packed), "attributes": ids}
        },
    }
    b.root["extensionsUsed"] = b.root["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    mesh = read(tmp_path, one(primitive, builder=b))

    def table(p: Any, nrm: Any, uv: Any, c: Any, t: Any) -> np.ndarray:
        rows = np.concatenate([p, nrm, uv, c], axis=1)[t].reshape(len(t), 3, -1)
        first = np.lexsort(rows[:, :, :3].round(2).transpose(2, 1, 0).reshape(-1, len(t)))
        return rows[first] if not keep_order else rows

    if keep_order:
        got = table(mesh.positions, mesh.normals, mesh.uvs, mesh.colors, mesh.triangles)
        want = table(positions, normals, uvs, colors / 255, triangles)
        assert np.abs(got - want).max() < 1e-3
    assert len(mesh.triangles) == len(triangles)
    # Whatever the order: every vertex is near one of the source with the same colour.
    nearest = ((mesh.positions[:, None] - positions[None]) ** 2).sum(axis=2).argmin(axis=1)
    assert np.abs(mesh.positions - positions[nearest]).max() < 1e-3
    assert np.array_equal((mesh.colors * 255).round(), colors[nearest])
    assert np.abs(mesh.normals - normals[nearest]).max() < 1e-2
    assert np.abs(mesh.uvs - uvs[nearest]).max() < 1e-3
    assert sorted(map(sorted, nearest[mesh.triangles].tolist())) == sorted(
        map(sorted, triangles.tolist())
    )


@pytest.fixture
def codec() -> Any:
    return pytest.importorskip("umbel._umbel")


@pytest.mark.parametrize("extension", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
@pytest.mark.parametrize("index_kind", [np.uint16, np.uint32])
def test_meshopt_streams_give_the_bytes_that_were_encoded(
    tmp_path: Path, codec: Any, extension: str, index_kind: Any
) -> None:
    positions, triangles = bumpy_sphere()
    n = len(positions)
    quantised = np.zeros((n, 4), np.int16)
    quantised[:, :3] = (positions / 2 * 32767).round()
    packed = codec.meshopt_encode_vertex(quantised.view(np.uint8))
    flat = triangles.reshape(-1)
    b = GltfBuilder()
    b.root["buffers"] = [{"byteLength": 1 << 20, "extensions": {extension: {"fallback": True}}}]
    b.root["extensionsUsed"] = b.root["extensionsRequired"] = [extension, "KHR_mesh_quantization"]
    view = b.meshopt_view(packed, n, 8, "ATTRIBUTES", extension)
    position = b.add("accessors", {"bufferView": view, "componentType": 5122, "count": n,
                                   "type": "VEC3", "normalized": True})  # fmt: skip
    size = np.dtype(index_kind).itemsize
    modes = {
        "TRIANGLES": codec.meshopt_encode_index(flat, n),
        "INDICES": codec.meshopt_encode_index_sequence(flat, n),
    }
    primitives = []
    for mode, stream in modes.items():
        indices = b.add("accessors", {
            "bufferView": b.meshopt_view(stream, len(flat), size, mode, extension),
            "componentType": 5123 if size == 2 else 5125, "count": len(flat), "type": "SCALAR",
        })  # fmt: skip
        primitives.append(b.primitive({"POSITION": position}, indices))
    mesh = read(tmp_path, one(*primitives, builder=b))
    assert np.array_equal(mesh.positions, quantised[:, :3] / np.float32(32767))
    assert np.array_equal(mesh.triangles[len(triangles) :], triangles)  # sequences keep all
    first = mesh.triangles[: len(triangles)]  # lists keep triangles, not their first corner
    assert [sorted(t) for t in first.tolist()] == [sorted(t) for t in triangles.tolist()]
    assert np.isclose(signed_volume(mesh), 2 * signed_volume(type(mesh)(mesh.positions, triangles)))


def test_meshopt_filters_are_undone(tmp_path: Path, codec: Any) -> None:
    positions, triangles = bumpy_sphere()
    n = len(positions)
    unit = np.zeros((n, 4), np.float32)
    unit[:, :3] = positions / np.linalg.norm(positions, axis=1, keepdims=True)
    padded = np.zeros((n, 4), np.float32)
    padded[:, :3] = positions
    rgba = np.random.default_rng(7).random((n, 4)).astype(np.float32)
    b = GltfBuilder()
    b.root["buffers"] = [{"byteLength": 1 << 20}]

    def filtered(values: Any, name: str, stride: int, bits: int, **accessor: Any) -> int:
        stream = codec.meshopt_encode_vertex(
            codec.meshopt_encode_filter(values, name, stride, bits)
        )
        view = b.meshopt_view(stream, n, stride, "ATTRIBUTES", "KHR_meshopt_compression", name)
        return b.add("accessors", {"bufferView": view, "count": n, **accessor})

    attributes = {
        "POSITION": filtered(padded, "EXPONENTIAL", 16, 23, componentType=5126, type="VEC3"),
        "NORMAL": filtered(unit, "OCTAHEDRAL", 8, 16, componentType=5122, type="VEC3",
                           normalized=True),
        "COLOR_0": filtered(rgba, "COLOR", 8, 15, componentType=5123, type="VEC4",
                            normalized=True),
    }  # fmt: skip
    mesh = read(tmp_path, one(b.primitive(attributes, triangles.reshape(-1)), builder=b))
    assert np.abs(mesh.positions - positions).max() < 1e-6
    assert np.abs(mesh.normals - unit[:, :3]).max() < 1e-3
    assert np.abs(mesh.colors - rgba).max() < 1e-3


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda c, d: c.meshopt_decode_vertex(d, 10**12, 16), "cannot come from"),
        (lambda c, d: c.meshopt_decode_vertex(d, 10, 6), "stride 6"),
        (lambda c, d: c.meshopt_decode_vertex(d[:-3], 256, 16), "corrupt"),
        (lambda c, d: c.meshopt_decode_vertex(b"", 10, 16), "cannot come from"),
        (lambda c, d: c.meshopt_decode_index(d, 10, 4), "no whole triangles"),
        (lambda c, d: c.meshopt_decode_index(d, 9, 3), "index size 3"),
        (lambda c, d: c.meshopt_decode_index(d, 9, 4), "corrupt"),
        (lambda c, d: c.meshopt_decode_index_sequence(d, 9, 4), "corrupt"),
        (lambda c, d: c.meshopt_filter(np.zeros((4, 8), np.uint8), "SEPIA", 8), "'SEPIA'"),
        (lambda c, d: c.meshopt_filter(np.zeros((4, 12), np.uint8), "OCTAHEDRAL", 12), "12"),
        (lambda c, d: c.meshopt_filter(np.zeros((4, 8), np.uint8), "OCTAHEDRAL", 4), "8 bytes"),
    ],
)
def test_meshopt_codecs_reject_what_makes_no_sense(codec: Any, call: Any, says: str) -> None:
    good = codec.meshopt_encode_vertex(np.arange(256 * 16, dtype=np.uint8).reshape(256, 16))
    with pytest.raises(ValueError, match=says):
        call(codec, good)


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


# --- nodes ------------------------------------------------------------------------------------


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


# --- skins and morph targets ------------------------------------------------------------------


def skinned() -> GltfBuilder:
    """A tetrahedron whose vertex 3 hangs on a joint that has moved up by 5 since binding."""
    b = GltfBuilder()
    joints = np.array([[0, 0, 0, 0]] * 3 + [[1, 0, 0, 0]], np.uint8)
    weights = np.array([[1, 0, 0, 0]] * 4, np.float32)
    inverse = np.stack([np.eye(4), np.eye(4)]).astype(np.float32)
    inverse[1, 3, :3] = [0, 0, -1]  # column-major: bound at z = 1
    mesh = b.mesh(
        b.primitive({"POSITION": TETRA_POSITIONS, "JOINTS_0": joints, "WEIGHTS_0": weights},
                    INDICES)
    )  # fmt: skip
    tip = b.node(translation=[0, 0, 6])
    hip = b.node(translation=[2, 0, 0], children=[tip])
    b.add("skins", {"joints": [hip, tip], "inverseBindMatrices": b.accessor(inverse)})
    b.scene(hip, b.node(mesh=mesh, skin=0, translation=[100, 100, 100]))
    return b


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


# --- materials --------------------------------------------------------------------------------


def test_materials_are_read(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.root["images"] = [{"uri": "bark.png"}]
    b.root["textures"] = [{"source": 0}]
    b.root["materials"] = [
        {
            "name": "bark",
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.1, 0.2, 0.3, 0.4],
                "metallicFactor": 0.5,
                "roughnessFactor": 0.6,
                "baseColorTexture": {"index": 0, "texCoord": 1},
            },
            "emissiveFactor": [1, 0, 0.5],
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}},
            "doubleSided": True,
            "alphaMode": "MASK",
            "alphaCutoff": 0.25,
        },
        {"extensions": {"KHR_materials_pbrSpecularGlossiness": {"glossinessFactor": 0.25}}},
    ]
    one(b.primitive({"POSITION": TETRA_POSITIONS}, INDICES, material=0), builder=b)
    mesh = read(tmp_path, b)
    bark, glossy = mesh.materials
    assert bark.name == "bark"
    assert bark.base_color == (0.1, 0.2, 0.3, 0.4)
    assert (bark.metallic, bark.roughness) == (0.5, 0.6)
    assert bark.emissive == (4, 0, 2)
    assert (bark.double_sided, bark.alpha_mode, bark.alpha_cutoff) == (True, "MASK", 0.25)
    assert bark.images["base_color"].path == tmp_path / "bark.png"
    assert bark.textures["base_color"]["texCoord"] == 1
    assert (glossy.metallic, glossy.roughness) == (0.0, 0.75)
    assert mesh.material_ids.tolist() == [0, 0, 0, 0]


def test_extensions_of_materials_are_kept_with_their_textures(tmp_path: Path) -> None:
    b = GltfBuilder()
    b.root["images"] = [{"uri": "coat.png"}]
    b.root["textures"] = [{"source": 0}]
    coat = {"clearcoatFactor": 0.5, "clearcoatTexture": {"index": 0, "texCoord": 1}}
    b.root["materials"] = [
        {"extensions": {"KHR_materials_clearcoat": coat, "ACME_x": {"a": [1]}}, "extras": {"id": 7}}
    ]
    one(b.primitive({"POSITION": TETRA_POSITIONS}, INDICES, material=0), builder=b)
    (material,) = read(tmp_path, b).materials
    kept = {"clearcoatFactor": 0.5, "clearcoatTexture": {"texCoord": 1}}
    assert material.extensions == {"KHR_materials_clearcoat": kept, "ACME_x": {"a": [1]}}
    assert material.extras == {"id": 7}
    assert set(material.textures) == set(material.images)
    info = material.textures["KHR_materials_clearcoat/clearcoatTexture"]
    assert info == {"texCoord": 1}
    assert material.images["KHR_materials_clearcoat/clearcoatTexture"].path == tmp_path / "coat.png"


# --- damage -----------------------------------------------------------------------------------


def damaged(change: Any) -> GltfBuilder:
    b = GltfBuilder()
    b.scene(b.node(mesh=b.tetra()))
    change(b.root)
    return b


def put(path: str, value: Any) -> Any:
    """A change of the JSON entry at a path such as nodes.0.mesh."""

    def change(root: Any) -> None:
        *parents, last = [int(p) if p.isdigit() else p for p in path.split(".")]
        at = root
        for step in parents:
            at = at[step]
        at[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (put("nodes.0.mesh", 7), r"nodes\[0\] refers to meshes\[7\], there are 1"),
        (put("nodes.0.children", [0]), r"nodes\[0\] is its own ancestor"),
        (put("nodes", [{"children": [2]}, {"children": [2]}, {}]), r"nodes\[2\] has two parents"),
        (put("nodes", [{}, {"children": [2]}, {"children": [1]}]), "its own ancestor"),
        (put("nodes.0.children", [3]), r"refers to nodes\[3\]"),
        (put("nodes.0.matrix", [1, 2, 3]), "matrix that is not 16 numbers"),
        (put("nodes.0.scale", "big"), r"nodes\[0\].scale should be an array, not 'big'"),
        (put("scenes.0.nodes", [0, 0]), "twice"),
        (put("scenes.0.nodes", [-1]), r"refers to nodes\[-1\]"),
        (put("scene", 4), r"scenes\[4\]"),
        (put("accessors.0.count", 5), "needs 60 bytes of bufferViews"),
        (put("accessors.0.count", 10**18), "needs"),
        (put("accessors.0.count", -1), "count -1"),
        (put("accessors.0.count", 3), None),
        (put("accessors.0.count", 4.0), None),
        (put("accessors.0.count", 4.5), "count should be an integer, not 4.5"),
        (put("accessors.0.componentType", 5127), "component type 5127"),
        (put("accessors.0.type", "VEC2"), "POSITION of 2 components"),
        (put("accessors.0.byteOffset", 8), "bufferViews"),
        (put("accessors.0.bufferView", None), None),
        (put("accessors.1.componentType", 5126), "needs 48 bytes|no unsigned integers"),
        (put("accessors.0", {"count": 10**12, "componentType": 5126, "type": "VEC3"}),
         "claims 1000000000000 elements and has no data"),
        (put("bufferViews.0.byteLength", 10**9), "covers bytes 0 to 1000000000"),
        (put("bufferViews.0.byteOffset", -4), "byteOffset -4"),
        (put("bufferViews.0.byteStride", 4), "elements of 12 bytes every 4"),
        (put("bufferViews.0.buffer", 3), r"buffers\[3\]"),
        (put("meshes.0.primitives.0.indices", 9), r"accessors\[9\]"),
        (put("meshes.0.primitives.0.material", 0), r"materials\[0\]"),
        (put("meshes.0.primitives.0.attributes", {"POSITION": 0, "NORMAL": 1}),
         "4 positions and 12 of NORMAL"),
        (put("meshes.0.primitives", "none"), r"meshes\[0\].primitives should be an array"),
        (put("asset.version", "1.0"), "version 1.0"),
        (put("asset", {}), "version"),
        (put("extensionsRequired", ["ACME_shapes"]), "requires the glTF extension ACME_shapes"),
        (put("accessors.0.sparse", {"count": 1, "indices": {"bufferView": 0, "componentType": 5125,
              "byteOffset": 12}, "values": {"bufferView": 0}}), "sparse sets element"),
        (put("accessors.0.sparse", {"count": 1}), "lacks its indices or values"),
        (put("nodes.0.extensions", {"EXT_mesh_gpu_instancing": {"attributes":
              {"TRANSLATION": 0, "SCALE": 1}}}), "different counts"),
        (put("nodes.0.skin", 0), r"skins\[0\]"),
    ],
)  # fmt: skip
def test_damage_is_named(tmp_path: Path, change: Any, says: str | None) -> None:
    data = damaged(change)
    if says is None:  # odd, but what it says can be drawn
        assert len(read(tmp_path, data).triangles) == 4
        return
    with pytest.raises(Error, match=says) as caught:
        read(tmp_path, data)
    assert "mesh.glb" in str(caught.value)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"glTF", "cut short"),
        (damaged(lambda r: None).glb()[:-4], "cut short"),
        (damaged(lambda r: None).glb()[:200], "cut short"),
        (struct.pack("<4sII", b"glTF", 1, 20) + bytes(8), "version 1"),
        (struct.pack("<4sII", b"glTF", 2, 20) + struct.pack("<I4s", 999, b"JSON"), "runs past"),
        (struct.pack("<4sII", b"glTF", 2, 20) + struct.pack("<I4s", 0, b"BIN\0"), "no JSON"),
        (struct.pack("<4sII4s", b"glTF", 2, 24, b"\4\0\0\0") + b"JSON{]}}", "JSON is corrupt"),
        (struct.pack("<4sII4s", b"glTF", 2, 24, b"\4\0\0\0") + b"JSON[1] ", "no object"),
        (b'{"asset":' + b"[" * 100_000, "JSON is corrupt"),
    ],
)
def test_broken_containers_are_named(tmp_path: Path, data: bytes, says: str) -> None:
    with pytest.raises(Error, match=says) as caught:
        read(tmp_path, data)
    assert "mesh.glb" in str(caught.value)


@pytest.mark.parametrize(
    ("uri", "says"),
    [
        ("gone.bin", "gone.bin"),
        ("http://example.com/a.bin", "only files can be read"),
        ("/etc/passwd", "outside the file's folder"),
        ("data:application/octet-stream;base64,AAAA", "should have"),
        ("data:application/octet-stream;base64,A", "damaged data URI"),
    ],
)
def test_buffers_that_cannot_be_had_are_named(tmp_path: Path, uri: str, says: str) -> None:
    b = GltfBuilder()
    b.scene(b.node(mesh=b.tetra()))
    with pytest.raises(Error, match=says):
        read(tmp_path, b.gltf(uri), "mesh.gltf")


def test_indices_beyond_the_vertices_pass_for_validation_to_find(tmp_path: Path) -> None:
    b = GltfBuilder()
    wrong = INDICES.copy()
    wrong[4] = 60000
    good = b.primitive({"POSITION": TETRA_POSITIONS}, INDICES)
    bad = b.primitive({"POSITION": TETRA_POSITIONS}, wrong)
    b.scene(b.node(mesh=b.mesh(bad, good), scale=[-1, 1, 1]), b.node(mesh=b.tetra()))
    mesh = read(tmp_path, b)
    outside = (mesh.triangles >= len(mesh.positions)).any(axis=1)
    assert outside.tolist() == [False, True] + [False] * 10


def test_deep_chains_of_nodes_are_walked(tmp_path: Path) -> None:
    b = GltfBuilder()
    tetra = b.tetra()
    n = 5000
    b.root["nodes"] = [{"translation": [1, 0, 0], "children": [k + 1]} for k in range(n - 1)]
    b.root["nodes"].append({"mesh": tetra})
    b.scene(0)
    assert read(tmp_path, json.loads(json.dumps(b.root)) and b).positions[0, 0] == n - 1
