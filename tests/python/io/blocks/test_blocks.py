"""Sources of blocks hold what the readers of whole files do."""

from __future__ import annotations

import os
import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import umbel
from helpers.commands import DATA
from helpers.gltf_builder import GltfBuilder
from umbel.errors import LoadWarning
from umbel.geometry.arrays import extras_of
from umbel.io.blocks import Source, open_source
from umbel.testing import giant

STREAMS = ("normals", "tangents", "uvs", "colors")


def read_all(source: Source, size: int = 5000) -> dict[str, np.ndarray[Any, Any] | None]:
    """Every triangle's corners, in order: positions and streams, and the materials."""
    native = source.triangles
    blocks = [
        native.read(at, min(at + size, native.triangles)) for at in range(0, native.triangles, size)
    ]
    out: dict[str, Any] = {}
    for key in ("positions", *STREAMS):
        rows = [b[key][b["triangles"]] for b in blocks if b[key] is not None]
        out[key] = np.concatenate(rows) if rows else None
    extras = [
        b["extra_values"].reshape(len(b["positions"]), -1)[b["triangles"]]
        for b in blocks
        if "extras" in b
    ]
    out["extra_values"] = np.concatenate(extras) if extras else None
    ids = [b["materials"] for b in blocks if b["materials"] is not None]
    out["materials"] = np.concatenate(ids) if ids else None
    return out


def check_same(source: Source, mesh: umbel.Mesh, rounding: float = 0.0) -> None:
    assert source.triangles.triangles == len(mesh.triangles)
    read = read_all(source)
    if not len(mesh.triangles):
        return
    relative = (read["positions"] - mesh.origin).astype(np.float32)
    expected = mesh.positions[mesh.triangles]
    np.testing.assert_allclose(relative, expected, rtol=rounding, atol=rounding / 1e3)
    for key in STREAMS:
        values = getattr(mesh, key)
        if values is None:
            assert read[key] is None
        else:
            np.testing.assert_allclose(
                read[key], values[mesh.triangles], rtol=rounding, atol=rounding / 1e3
            )
    _, extras = extras_of(mesh)
    if extras is None:
        assert read["extra_values"] is None
    else:
        expected = extras.reshape(len(mesh.positions), -1)[mesh.triangles]
        assert np.array_equal(read["extra_values"], expected)
    if mesh.material_ids is None:
        assert read["materials"] is None
    else:
        assert np.array_equal(read["materials"], mesh.material_ids)
    assert [m.name for m in source.materials] == [m.name for m in mesh.materials]


def files() -> list[Path]:
    found = sorted(p for p in DATA.glob("*") if p.suffix in (".ply", ".obj", ".glb", ".stl"))
    return [p for p in found if p.stat().st_size < 60 << 20]


@pytest.mark.parametrize("path", files(), ids=lambda p: p.name)
def test_real_meshes_have_the_same_triangles(path: Path, tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mesh = umbel.load(path)
        try:
            umbel.validate(mesh)
        except umbel.Error:
            with pytest.raises(umbel.Error, match=path.stem):
                read_all(open_source(path, tmp_path))
            return
        source = open_source(path, tmp_path)
    check_same(source, mesh, rounding=1e-6 if path.suffix == ".glb" else 0.0)


@pytest.mark.parametrize("kind", giant.KINDS)
@pytest.mark.parametrize("extension", [".ply", ".stl", ".glb"])
@pytest.mark.parametrize("options", [{}, {"seams": True}, {"shuffled": True}])
def test_large_formats_are_read_where_they_are(
    kind: str, extension: str, options: dict[str, bool], tmp_path: Path
) -> None:
    path, work = tmp_path / f"a{extension}", tmp_path / "work"
    giant.write(giant.make(kind, 9001, **options), path)
    source = open_source(path, work)
    assert not work.exists()
    check_same(source, umbel.load(path))


@pytest.mark.parametrize("kind", ["terrain", "city"])
def test_meshes_in_random_order_are_sorted_once(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("umbel.io.blocks._LEAST_BYTES", 0)
    monkeypatch.setattr("umbel.io.blocks._BLOCK", 4000)
    path, work = tmp_path / "a.ply", tmp_path / "work"
    giant.write(giant.make(kind, 200_000, shuffled=True, seams=kind == "city"), path)
    source = open_source(path, work)
    assert {p.suffix for p in work.iterdir()} == {".indices", ".rows0"}
    check_same(source, umbel.load(path))
    giant.write(giant.make(kind, 200_000), path)
    open_source(path, tmp_path / "other")
    assert not (tmp_path / "other").exists()


def test_any_block_size_gives_the_same(tmp_path: Path) -> None:
    giant.write(giant.city(5000, seams=True, shuffled=True), tmp_path / "a.ply")
    source = open_source(tmp_path / "a.ply", tmp_path)
    whole = read_all(source, 5000)
    for size in (1, 77, 4999):
        for key, values in read_all(source, size).items():
            assert values is None or np.array_equal(values, whole[key])


@pytest.mark.parametrize("extension", [".ply", ".obj", ".glb"])
def test_tiles_of_a_scan_are_one_mesh_with_shared_bits(tmp_path: Path, extension: str) -> None:
    mesh = giant.scan(4 * 2 * 32 * 32, tile=32)
    paths = giant.write_tiles(mesh, tmp_path / "tiles", extension)
    source = open_source(paths, tmp_path)
    read = read_all(source)["positions"]
    exact = np.concatenate([b.positions[b.triangles] for b in mesh.blocks()])
    assert np.array_equal(read, exact)
    assert len(np.unique(read.reshape(-1, 3), axis=0)) == 65 * 65


def test_tiles_with_other_coordinates_are_said(tmp_path: Path) -> None:
    mesh = giant.terrain(200)
    for name in ("a.glb", "b.ply"):
        giant.write(mesh, tmp_path / name)
    (tmp_path / "b.prj").write_text('PROJCS["WGS 84 / UTM zone 32N"]')
    with pytest.warns(LoadWarning, match=r"b\.ply: its coordinates are .*as before"):
        source = open_source([tmp_path / "a.glb", tmp_path / "b.ply"], tmp_path)
    assert source.triangles.triangles == 400


def big_endian(path: Path) -> None:
    """Rewrites a PLY file of floats and triangles alone with its bytes the other way."""
    head, body = path.read_bytes().split(b"end_header\n")
    vertices = int(head.split(b"element vertex ")[1].split()[0])
    rows = np.frombuffer(body, "<f4", 3 * vertices).astype(">f4").tobytes()
    face = np.dtype([("n", "u1"), ("v", "<u4", 3)])
    faces = np.frombuffer(body, face, offset=12 * vertices)
    swapped = faces.astype(np.dtype([("n", "u1"), ("v", ">u4", 3)])).tobytes()
    path.write_bytes(head.replace(b"little", b"big") + b"end_header\n" + rows + swapped)


def test_big_endian_ply(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    giant.write(giant.terrain(3000), path)
    big_endian(path)
    check_same(open_source(path, tmp_path / "work"), umbel.load(path))


def polygons(path: Path, faces: list[list[int]], materials: bool) -> None:
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 8\n"
    head += "property double x\nproperty double y\nproperty double z\n"
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\n"
    head += "property short material_index\n" if materials else ""
    body = np.random.default_rng(1).random((8, 3)).astype("<f8").tobytes()
    for k, face in enumerate(faces):
        body += struct.pack(f"<B{len(face)}i", len(face), *face)
        body += struct.pack("<h", k % 3) if materials else b""
    path.write_bytes(head.encode() + b"end_header\n" + body)


@pytest.mark.parametrize("materials", [False, True])
def test_polygons_become_fans(tmp_path: Path, materials: bool) -> None:
    path = tmp_path / "a.ply"
    polygons(path, [[0, 1, 2, 3], [4, 5, 6], [0, 1], [7, 6, 5, 4, 3]], materials)
    with pytest.warns(LoadWarning, match="1 faces have fewer than three corners"):
        source = open_source(path, tmp_path / "work")
    with pytest.warns(LoadWarning):
        mesh = umbel.load(path)
    check_same(source, mesh)


def test_faces_before_vertices_that_only_the_whole_reader_takes(tmp_path: Path) -> None:
    head = "ply\nformat binary_little_endian 1.0\nelement face 2\n"
    head += "property list uchar int vertex_indices\nelement vertex 4\n"
    head += "".join(f"property float {name}\n" for name in ("x", "y", "z", "red", "green", "blue"))
    body = struct.pack("<B4iB2i", 4, 0, 1, 2, 3, 2, 0, 1)
    body += np.random.default_rng(1).random((4, 6)).astype("<f4").tobytes()
    path = tmp_path / "a.ply"
    path.write_bytes(head.encode() + b"end_header\n" + body)
    with pytest.warns(LoadWarning) as caught:
        source = open_source(path, tmp_path / "work")
    assert [str(w.message) for w in caught] == [
        f"{path}: 1 faces have fewer than three corners and are left out"
    ]
    with pytest.warns(LoadWarning):
        check_same(source, umbel.load(path))


def test_vertices_without_triangles_are_said(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    polygons(path, [[0, 1]], materials=False)
    with pytest.warns(LoadWarning, match="has 8 vertices, and no triangles"):
        open_source(path, tmp_path / "work")


def test_an_iterable_of_blocks_is_written_once(tmp_path: Path) -> None:
    for mesh in (giant.city(5000, seams=True), giant.foliage(3000), giant.scan(4000, tile=16)):
        source = open_source(mesh.blocks(size=700), tmp_path / type(mesh).__name__)
        whole = mesh.block(0, mesh.triangle_count)
        read = read_all(source)
        assert np.array_equal(read["positions"], whole.positions[whole.triangles])
        if whole.uvs is not None:
            assert np.array_equal(read["uvs"], whole.uvs[whole.triangles])
        if whole.materials is not None:
            assert np.array_equal(read["materials"], whole.materials)
    pairs = [(np.eye(3), [[0, 1, 2]]), (np.eye(3) + 1, [[2, 1, 0]])]
    read = read_all(open_source(iter(pairs), tmp_path / "pairs"))
    assert np.array_equal(read["positions"][1], (np.eye(3) + 1)[::-1])


def test_tables_that_every_build_writes_again_are_not_flushed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unwanted(_: int) -> None:
        raise OSError("a table was flushed")

    monkeypatch.setattr(os, "fsync", unwanted)
    source = open_source(giant.city(2000, seed=5).blocks(500), tmp_path / "work")
    assert source.triangles.triangles == giant.city(2000, seed=5).triangle_count


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "work").touch()
    with pytest.raises(umbel.Error, match=r"cannot make the folder .*work: File exists"):
        open_source(giant.city(2000, seed=5).blocks(500), tmp_path / "work")


def test_nodes_move_and_mirror_meshes(tmp_path: Path) -> None:
    mesh = umbel.shapes.blob(3)
    mesh = umbel.Mesh(mesh.positions, mesh.triangles, normals=mesh.positions)
    turned = np.array([[0, -2, 0, 5], [1, 0, 0, 6], [0, 0, 3, 7], [0, 0, 0, 1.0]])
    mirrored = np.diag([-1.0, 2, 1, 1])
    scene = umbel.io.Scene([mesh], [], [umbel.io.Instance(0, m) for m in (turned, mirrored)])
    umbel.save(tmp_path / "a.glb", scene)
    work = tmp_path / "work"
    with pytest.warns(umbel.LoadWarning, match="2 nodes become one"):
        source = open_source(tmp_path / "a.glb", work)
    assert not work.exists()
    check_same(source, umbel.load(tmp_path / "a.glb"), rounding=1e-6)


def test_broken_files_are_refused_by_name(tmp_path: Path) -> None:
    for extension in (".ply", ".stl", ".glb"):
        path = tmp_path / f"short{extension}"
        giant.write(giant.terrain(500), path)
        path.write_bytes(path.read_bytes()[:-20])
        with pytest.raises(umbel.Error, match=f"short{extension}.* cut short"):
            open_source(path, tmp_path / "work")
    path = tmp_path / "index.ply"
    polygons(path, [[0, 1, 2], [3, 4, 8]], False)
    with pytest.raises(umbel.Error, match=r"index.ply: triangle 1 has vertex index 8, of 8"):
        read_all(open_source(path, tmp_path))
    polygons(path, [[0, 1, 2], [3, -1, 2]], False)
    with pytest.raises(umbel.Error, match=r"index.ply: triangle 1 has vertex index"):
        read_all(open_source(path, tmp_path))
    positions = np.random.default_rng(1).random((8, 3)).astype(np.float32)
    positions[4, 1] = np.nan
    giant.write(giant.terrain(8), tmp_path / "nan.stl")
    data = bytearray((tmp_path / "nan.stl").read_bytes())
    data[84 + 3 * 50 + 12 : 84 + 3 * 50 + 16] = struct.pack("<f", np.nan)
    (tmp_path / "nan.stl").write_bytes(data)
    with pytest.raises(umbel.Error, match=r"nan.stl: triangle 3 has a vertex whose position"):
        read_all(open_source(tmp_path / "nan.stl", tmp_path))
    with pytest.raises(umbel.Error, match="no files"):
        open_source([], tmp_path)
    with pytest.raises(umbel.Error, match="triangle 0 has vertex index 3, of 3"):
        open_source(iter([(np.eye(3), [[0, 1, 3]])]), tmp_path)
    with pytest.raises(umbel.Error, match="there are no blocks"):
        open_source(iter([]), tmp_path)


@pytest.mark.parametrize("missing", ["componentType", "type", "count"])
def test_accessors_that_lack_something_are_named(tmp_path: Path, missing: str) -> None:
    b = GltfBuilder()
    b.scene(b.node(mesh=b.tetra()))
    del b.root["accessors"][0][missing]
    (tmp_path / "a.glb").write_bytes(b.glb())
    with pytest.raises(umbel.Error, match=r"a.glb: .*accessors\[0\] has"):
        open_source(tmp_path / "a.glb", tmp_path / "work")


OBJ = """mtllib none.mtl
f 1/1 2/2 3/1
v 0 0 0
v 1 0 0 255 0 0
v 0 1 0
v 0 0 1
vt 0 0
vt 1 0
usemtl a
f -4 -3 -2 -1
vn 0 0 2
usemtl b
f 1//1 2/2/1 4
f 1/1 3/2 4/2
"""


@pytest.mark.filterwarnings("ignore::umbel.LoadWarning")
@pytest.mark.parametrize("color", ["255 0 0", "1.0001 0.5 0"])
def test_obj_of_every_kind_of_corner(tmp_path: Path, color: str) -> None:
    path = tmp_path / "a.obj"
    path.write_text(OBJ.replace("255 0 0", color))
    source = open_source(path, tmp_path / "work")
    read, mesh = read_all(source), umbel.load(path)
    assert np.array_equal(read["positions"], mesh.positions[mesh.triangles])
    assert np.array_equal(read["uvs"], mesh.uvs[mesh.triangles])
    assert np.array_equal(read["colors"], mesh.colors[mesh.triangles])
    assert np.array_equal(read["materials"], mesh.material_ids)
    assert [m.name for m in source.materials] == [m.name for m in mesh.materials]
    assert np.array_equal(read["normals"][3], [[0, 0, 1], [0, 0, 1], [0, 0, 0]])


@pytest.mark.parametrize(
    ("lines", "match"),
    [
        ("f 1 2 9\n", r"a.obj, line 4: vertex index 9 is beyond the 3 there are"),
        ("f 1/4 2/1 3/1\nvt 0 0\n", r"a.obj, line 4: .* 4 is beyond the 1 there are"),
        ("f 1 2 -7\n", r"a.obj, line 4: "),
        ("f 1 2 x\n", r"a.obj, line 4: "),
        ("", r"a.obj holds 3 vertices and no faces"),
    ],
)
def test_broken_obj_files_are_refused_by_line(tmp_path: Path, lines: str, match: str) -> None:
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n" + lines)
    with pytest.raises(umbel.Error, match=match):
        open_source(path, tmp_path / "work")
    work = tmp_path / "work"
    assert not work.exists() or not list(work.iterdir())
