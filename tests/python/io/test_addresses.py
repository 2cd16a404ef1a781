"""Meshes at addresses: the same as from files, with all that they refer to."""

from __future__ import annotations

import errno
import hashlib
import http.server
import json
import sys
import threading
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import umbel
from helpers.commands import Umbel
from umbel.io import load_scene
from umbel.io.addresses import name_of
from umbel.io.references import leads_outside, references, source_digest

fsspec = pytest.importorskip("fsspec")
PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010802000000907753de"
    "0000000c49444154789c63f8cfc0000003010100c9fe92ef0000000049454e44ae426082"
)
OBJ = b"""mtllib sub/paint.mtl
v 0 0 0
v 1 0 0
v 0 1 0
vt 0 0
vt 1 0
vt 0 1
usemtl red
f 1/1 2/2 3/3
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """An OBJ with a library and an image, a glTF with a buffer and an image, and others."""
    (tmp_path / "sub").mkdir()
    (tmp_path / "a.obj").write_bytes(OBJ)
    (tmp_path / "sub" / "paint.mtl").write_bytes(b"newmtl red\nKd 1 0 0\nmap_Kd red.png\n")
    (tmp_path / "sub" / "red.png").write_bytes(PIXEL)
    (tmp_path / "red.png").write_bytes(PIXEL)
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    (tmp_path / "my buffer.bin").write_bytes(positions.tobytes())
    gltf = {
        "asset": {"version": "2.0"},
        "buffers": [{"uri": "my%20buffer.bin", "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "images": [{"uri": "red.png"}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    (tmp_path / "b.gltf").write_text(json.dumps(gltf))
    for name in ("c.ply", "d.glb"):
        umbel.save(tmp_path / name, umbel.shapes.sphere(2))
    return tmp_path


@pytest.fixture
def in_memory(folder: Path) -> str:
    """The same files in fsspec's memory."""
    system = fsspec.filesystem("memory")
    for path in folder.rglob("*"):
        if path.is_file():
            system.pipe(f"/meshes/{path.relative_to(folder).as_posix()}", path.read_bytes())
    return "memory://meshes"


@pytest.mark.parametrize("name", ["a.obj", "b.gltf", "c.ply", "d.glb"])
def test_a_mesh_at_an_address_is_the_same(folder: Path, in_memory: str, name: str) -> None:
    here, there = umbel.load(folder / name), umbel.load(f"{in_memory}/{name}")
    assert np.array_equal(here.positions, there.positions)
    assert np.array_equal(here.triangles, there.triangles)
    assert there.name == here.name
    assert [m.base_color for m in there.materials] == [m.base_color for m in here.materials]


def test_images_come_along(in_memory: str) -> None:
    for name in ("a.obj", "b.gltf"):
        scene = load_scene(f"{in_memory}/{name}")
        images = [image for m in scene.materials for image in m.images.values()]
        assert [image.data for image in images] == [PIXEL]


def test_fallback_images_come_along_and_missing_ones_are_named(in_memory: str) -> None:
    system = fsspec.filesystem("memory")
    gltf = json.loads(system.cat("/meshes/b.gltf"))
    gltf["images"].append({"uri": "red.ktx2"})
    gltf["textures"][0]["extensions"] = {"KHR_texture_basisu": {"source": 1}}
    system.pipe("/meshes/b.gltf", json.dumps(gltf).encode())
    system.pipe("/meshes/red.ktx2", b"not read")
    [material] = load_scene(f"{in_memory}/b.gltf").materials
    [image] = material.images.values()
    assert (image.data, image.fallback.data) == (b"not read", PIXEL)
    system.rm("/meshes/red.ktx2")
    says = r"memory://meshes/b.gltf: left out: images that could not be fetched: 'red.ktx2'$"
    with pytest.warns(umbel.LoadWarning, match=says):
        [material] = load_scene(f"{in_memory}/b.gltf").materials
    assert [image.data for image in material.images.values()] == [PIXEL]
    system.rm("/meshes/red.png")
    with pytest.warns(umbel.LoadWarning, match="could not be fetched: 'red.png', 'red.ktx2'"):
        assert load_scene(f"{in_memory}/b.gltf").materials[0].images == {}


def test_coordinate_systems_come_along(folder: Path, in_memory: str) -> None:
    wkt = b'PROJCS["ETRS89 / UTM zone 32N"]'
    (folder / "c.prj").write_bytes(wkt)
    fsspec.filesystem("memory").pipe("/meshes/c.prj", wkt)
    here, there = umbel.load(folder / "c.ply"), umbel.load(f"{in_memory}/c.ply")
    assert here.coordinates == there.coordinates and here.coordinates["crs"] == wkt.decode()


def test_what_is_missing_names_the_address(in_memory: str) -> None:
    fsspec.filesystem("memory").rm("/meshes/my buffer.bin")
    with pytest.raises(umbel.Error, match=r"memory://meshes/") as raised:
        umbel.load(f"{in_memory}/b.gltf")
    assert "/tmp" not in str(raised.value) and "my buffer.bin" in str(raised.value)
    with pytest.raises(umbel.Error, match=r"memory://meshes/none\.ply"):
        umbel.load(f"{in_memory}/none.ply")
    with pytest.raises(umbel.Error, match=r"nosuch://x/a\.ply"):
        umbel.load("nosuch://x/a.ply")


def test_without_fsspec_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fsspec", None)
    with pytest.raises(umbel.Error, match=r"umbel\[remote\]"):
        umbel.load("https://example.org/a.ply")


def test_names_of_addresses() -> None:
    assert name_of("https://x.org/a/my%20mesh.glb?key=1") == "my mesh.glb"
    assert name_of("s3://bucket/a/b.obj") == "b.obj"
    assert name_of("zip://in/c.ply::file:///x/y.zip") == "c.ply"


@pytest.fixture
def served(folder: Path) -> Iterator[str]:
    """The folder by HTTP."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=folder))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()


def test_commands_take_addresses(
    umbel_command: Umbel, folder: Path, served: str, tmp_path: Path
) -> None:
    pytest.importorskip("aiohttp")
    made, expected = tmp_path / "made.umbel", tmp_path / "expected.umbel"
    done = umbel_command("build", f"{served}/d.glb", "-o", made, "--json")
    assert done.status == 0 and done.json["input"] == f"{served}/d.glb"
    assert umbel_command("build", folder / "d.glb", "-o", expected).status == 0
    assert made.read_bytes() == expected.read_bytes()
    said = umbel_command("info", f"{served}/b.gltf", "--json").json
    assert said["input_triangles"] == 1 and said["materials"] == 1
    asset = made.as_uri()  # Python's server knows no ranges, which assets are read by
    said = umbel_command("info", asset, "--json").json
    assert said["kind"] == "asset" and said["input_triangles"] == 320
    assert umbel_command("verify", asset, "--json").json["ok"] is True
    extracted = umbel_command("extract", asset, "--level", 0, "-o", tmp_path / "x.ply", "--json")
    assert extracted.json["triangles"] == 320
    done = umbel_command("info", f"{served}/none.obj", "--json")
    assert done.status == 1 and done.json["input"] == f"{served}/none.obj"
    assert f"{served}/none.obj" in done.json["error"]


def test_references_are_found(folder: Path) -> None:
    assert references("a.obj", OBJ) == ["sub/paint.mtl"]
    assert references("b.gltf", (folder / "b.gltf").read_bytes()) == ["my buffer.bin", "red.png"]
    library = b"newmtl x\nmap_Kd -s 1 1 1 x.png\n  bump y.png\nNs 3\n# map_Ks no.png\n"
    assert references("p.mtl", library) == ["x.png", "y.png"]
    assert references("sub/p.mtl", library) == ["sub/x.png", "sub/y.png"]
    assert references("a.obj", b"v 0 0 0\nmtllib my paint.mtl") == [
        *("my paint.mtl", "my", "paint.mtl"),
    ]
    assert references("a.obj", b"mtllib a#1.mtl # my paint\nmtllib # none\n") == ["a#1.mtl"]
    assert references("a.obj", b"v 0 0 0\rmtllib a.mtl\rmtllib b.mtl\r") == ["a.mtl", "b.mtl"]
    assert references("a.obj", b"mtllib \\ \r\n a.mtl \\\n b.mtl\nmtllib c.mtl\n") == [
        *("a.mtl  b.mtl", "a.mtl", "b.mtl", "c.mtl"),
    ]
    assert references("b.glb", (folder / "b.gltf").read_bytes()) == ["my buffer.bin", "red.png"]
    padded = (folder / "b.gltf").read_bytes() + b"\0\0"  # as it may be in a .glb
    assert references("b.gltf", padded) == ["my buffer.bin", "red.png"]
    assert references("c.ply", (folder / "c.ply").read_bytes()) == []
    assert references("d.glb", (folder / "d.glb").read_bytes()) == []
    assert references("d.glb", b"glTF\0\0\0") == references("b.gltf", b"{ no json") == []


def test_digests_tell_what_a_file_refers_to(folder: Path) -> None:
    plain = source_digest(folder / "c.ply")
    assert plain == hashlib.sha256((folder / "c.ply").read_bytes()).hexdigest()
    seen = {source_digest(folder / "a.obj")}
    (folder / "sub" / "paint.mtl").write_bytes(b"newmtl red\nKd 0 0 1\nmap_Kd red.png\n")
    seen.add(source_digest(folder / "a.obj"))
    (folder / "sub" / "paint.mtl").unlink()
    seen.add(source_digest(folder / "a.obj"))
    seen.add(source_digest(folder / "b.gltf"))
    (folder / "red.png").write_bytes(PIXEL + b"\0")
    seen.add(source_digest(folder / "b.gltf"))
    (folder / "c.prj").write_text('GEOGCS["WGS 84"]')  # says what the coordinates mean
    seen |= {plain, source_digest(folder / "c.ply")}
    assert len(seen) == 7


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_digests_tell_of_libraries_whatever_ends_lines(tmp_path: Path, end: str) -> None:
    vertices = ["v 0 0 0"] * 200_000  # more than is read at once
    for lines in (["mtllib a.mtl", *vertices], [*vertices, "mtllib a.mtl"]):
        (tmp_path / "a.obj").write_bytes(end.join([*lines, "f 1 2 3", ""]).encode())
        (tmp_path / "a.mtl").write_bytes(b"newmtl a\n")
        before = source_digest(tmp_path / "a.obj")
        (tmp_path / "a.mtl").write_bytes(b"newmtl b\n")
        assert source_digest(tmp_path / "a.obj") != before


def test_digests_follow_no_reference_out_of_the_folder(tmp_path: Path) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    (tmp_path / "out.mtl").write_bytes(b"newmtl a\n")
    (inner / "a.obj").write_bytes(b"mtllib ../out.mtl\nv 0 0 0\n")
    before = source_digest(inner / "a.obj"), source_digest(inner / "a.obj", allow_outside=True)
    (tmp_path / "out.mtl").write_bytes(b"newmtl b\n")
    assert source_digest(inner / "a.obj") == before[0]
    assert source_digest(inner / "a.obj", allow_outside=True) != before[1]


@pytest.mark.parametrize("name", ["12:30.png", "noon:half.png"])
def test_names_with_colons_are_beside_the_file(folder: Path, in_memory: str, name: str) -> None:
    memory = fsspec.filesystem("memory")
    uri = name.replace("noon:", "noon%3A")
    texts = {
        "sub/paint.mtl": f"newmtl red\nmap_Kd {name}\n",
        "b.gltf": (folder / "b.gltf").read_text().replace("red.png", uri),
    }
    for file, text in texts.items():
        (folder / file).write_text(text)
        memory.pipe(f"{in_memory}/{file}", text.encode())
    memory.pipe(f"{in_memory}/{name}", PIXEL)
    memory.pipe(f"{in_memory}/sub/{name}", PIXEL)
    seen = {source_digest(folder / file) for file in ("a.obj", "b.gltf")}
    for place in (folder, folder / "sub"):
        (place / name).write_bytes(PIXEL)
    seen |= {source_digest(folder / file) for file in ("a.obj", "b.gltf")}
    assert len(seen) == 4
    for file in ("a.obj", "b.gltf"):
        [material] = load_scene(f"{in_memory}/{file}").materials
        assert material.images["base_color"].encoded() == PIXEL
    http = (folder / "b.gltf").read_text().replace(uri, "https://example.org/red.png")
    assert references("b.gltf", http.encode()) == ["my buffer.bin"]
    for outside in ("c:/red.png", "C:red.png", "/red.png", "..\\red.png"):
        assert leads_outside(outside)


@pytest.mark.parametrize("full", ["b.gltf", "my buffer.bin", "red.png"])
def test_a_full_disk_for_temporary_files_is_named(
    in_memory: str, monkeypatch: pytest.MonkeyPatch, full: str
) -> None:
    """Also where the mesh could be read without what there is no room for."""
    write = Path.write_bytes

    def write_bytes(path: Path, data: bytes) -> int:
        if path.name == full:
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(path, data)

    monkeypatch.setattr(Path, "write_bytes", write_bytes)
    with pytest.raises(umbel.Error, match=f"cannot write .*{full}: No space left on .*TMPDIR"):
        load_scene(f"{in_memory}/b.gltf")
