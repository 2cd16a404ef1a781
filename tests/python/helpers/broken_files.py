"""Small files of every format, and ways to break them. A `Damage` that is `certain` must be noticed
by whoever reads the file; others may look like another file that is whole, such as one whose
coordinates are different."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from helpers.gltf_builder import GltfBuilder, meshopt_sphere
from helpers.mesh_files import bumpy_sphere, corners, ply_bytes, stl_bytes
from umbel.geometry.mesh import Material, Mesh
from umbel.io import save

Rng = np.random.Generator
XYZ = [("float", "x"), ("float", "y"), ("float", "z")]
FACE = [("list", "uchar", "int", "vertex_indices")]


def _mesh() -> Mesh:
    positions, triangles = bumpy_sphere(6)
    normals = positions / np.linalg.norm(positions, axis=1, keepdims=True)
    return Mesh(
        positions,
        triangles,
        normals=normals,
        uvs=positions[:, :2],
        material_ids=np.arange(len(triangles), dtype=np.uint32) * 2 // len(triangles),
        materials=[Material("stone", (0.5, 0.25, 0.125, 1.0)), Material("lamp", metallic=1.0)],
        name="ball",
    )


def saved(folder: Path, extension: str) -> bytes:
    """The mesh as `umbel.save` writes it."""
    path = folder / f"source{extension}"
    mesh = _mesh()
    if extension == ".ply":  # which has no place for materials
        mesh = replace(mesh, material_ids=None, materials=[])
    save(path, mesh)
    data = path.read_bytes()
    # The library would have to lie beside every broken file.
    return data.replace(b"mtllib source.mtl\n", b"") if extension == ".obj" else data


def ply(fmt: str) -> bytes:
    mesh = _mesh()
    points = [tuple(p) for p in mesh.positions.tolist()]
    faces = [(t,) for t in mesh.triangles.tolist()]
    return ply_bytes([("vertex", XYZ, points), ("face", FACE, faces)], fmt)


def draco() -> bytes:
    import DracoPy

    positions, triangles = bumpy_sphere(4)
    packed = DracoPy.encode(positions, triangles, quantization_bits=14)
    [attribute] = DracoPy.decode(packed).attributes
    b = GltfBuilder()
    position = b.add("accessors", {"componentType": 5126, "count": len(positions), "type": "VEC3"})
    indices = b.add("accessors", {"componentType": 5125, "count": triangles.size,
                                  "type": "SCALAR"})  # fmt: skip
    extension = {"bufferView": b.view(packed), "attributes": {"POSITION": attribute["unique_id"]}}
    primitive = b.primitive({"POSITION": position}, indices)
    primitive["extensions"] = {"KHR_draco_mesh_compression": extension}
    b.root["extensionsUsed"] = b.root["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    b.scene(b.node(mesh=b.mesh(primitive)))
    return b.glb()


def sparse() -> bytes:
    positions, triangles = bumpy_sphere(4)
    b = GltfBuilder()
    base = b.accessor(positions)
    b.root["accessors"][base]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": b.view(b"\1\0\3\0"), "componentType": 5123},
        "values": {"bufferView": b.view(np.ones(6, np.float32).tobytes())},
    }
    b.scene(b.node(mesh=b.mesh(b.primitive({"POSITION": base}, triangles.reshape(-1)))))
    return b.glb()


def textured() -> bytes:
    mesh = _mesh()
    b = GltfBuilder()
    png = bytes.fromhex(
        "89504e470d0a1a0a0000000d49484452000000010000000108060000001f15c4890000000d49444154789c63"
        "f8cfc0f01f0005000180ffa3dd8db20000000049454e44ae426082"
    )
    b.root["images"] = [{"bufferView": b.view(png), "mimeType": "image/png"}]
    b.root["textures"] = [{"source": 0}]
    b.root["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    attributes = {"POSITION": mesh.positions, "TEXCOORD_0": mesh.uvs}
    b.scene(b.node(mesh=b.mesh(b.primitive(attributes, mesh.triangles.reshape(-1), material=0))))
    return b.glb()


def gltf() -> bytes:
    b = GltfBuilder()
    positions, triangles = bumpy_sphere(4)
    b.scene(b.node(mesh=b.mesh(b.primitive({"POSITION": positions}, triangles.reshape(-1)))))
    return b.gltf()


#: By format, how each of its kinds of file is made.
SOURCES: dict[str, dict[str, Callable[[Path], bytes]]] = {
    "obj": {"full.obj": lambda folder: saved(folder, ".obj")},
    "ply": {
        "ascii.ply": lambda _: ply("ascii"),
        "little.ply": lambda _: ply("binary_little_endian"),
        "big.ply": lambda _: ply("binary_big_endian"),
        "full.ply": lambda folder: saved(folder, ".ply"),
    },
    "stl": {
        "ascii.stl": lambda _: stl_bytes(corners(_mesh()), "ascii", "ball"),
        "binary.stl": lambda _: stl_bytes(corners(_mesh()), "binary"),
    },
    "gltf": {"inside.gltf": lambda _: gltf()},
    "glb": {
        "full.glb": lambda folder: saved(folder, ".glb"),
        "textured.glb": lambda _: textured(),
        "sparse.glb": lambda _: sparse(),
        "meshopt.glb": lambda _: meshopt_sphere(),
        "draco.glb": lambda _: draco(),
    },
}


@dataclass
class Damage:
    data: bytes
    what: str
    certain: bool


def damaged(name: str, data: bytes, rng: Rng) -> Damage:
    """The file, broken in one of several ways."""
    kind = int(rng.integers(0, 4))
    if kind == 0:
        return _truncated(name, data, rng)
    if kind == 1:
        return _flipped(data, rng)
    lying = _lying(name, data, rng) if kind == 2 else _garbled(name, data, rng)
    return lying if lying.data != data else damaged(name, data, rng)


def is_text(name: str) -> bool:
    return name.endswith((".obj", ".gltf")) or name.startswith("ascii")


def _truncated(name: str, data: bytes, rng: Rng) -> Damage:
    at = int(rng.integers(0, len(data)))
    # An OBJ file without its last lines is another OBJ file; all other text says where it ends.
    if name.endswith(".obj"):
        while data[at - 1 : at] == b"\n" or data[:at].rsplit(b"\n", 1)[-1].startswith(b"#"):
            at -= 1
    if name == "ascii.stl":
        at = min(at, data.rindex(b"endsolid"))
    return Damage(data[:at], f"cut at byte {at} of {len(data)}", True)


def _flipped(data: bytes, rng: Rng) -> Damage:
    out = bytearray(data)
    reach = len(out) if rng.integers(0, 2) else min(len(out), 600)
    places = rng.integers(0, reach, int(rng.integers(1, 9)))
    for at in places.tolist():
        out[at] ^= 1 << int(rng.integers(0, 8))
    return Damage(bytes(out), f"bits flipped at {sorted(places.tolist())}", False)


def _number(value: int, rng: Rng) -> int:
    """A larger one."""
    return value + int(rng.choice([1, 2, 100, 1 << 16, 1 << 31, 1 << 40]))


def _lying(name: str, data: bytes, rng: Rng) -> Damage:
    if name.endswith((".gltf", ".glb")):
        return _lying_gltf(name, data, rng)
    if name == "binary.stl":
        count = int.from_bytes(data[80:84], "little")
        said = int(rng.choice([0, 1, count - 1, count + 1, 2 * count, 1 << 31, (1 << 32) - 1]))
        return Damage(data[:80] + said.to_bytes(4, "little") + data[84:], f"says {said}", True)
    if name.endswith(".ply"):
        pattern = rb"element \w+ (\d+)"
    elif name.endswith(".obj"):
        pattern = rb"(?<=[ /])(\d+)(?=[ /\n])(?=[^\n]*\n(?:f|usemtl|$))"
    else:
        pattern = rb"(vertex [^\n]*\n)"
    matches = list(re.finditer(pattern, data))
    found = matches[int(rng.integers(0, len(matches)))]
    a, b = found.span(1)
    if name == "ascii.stl":
        return Damage(data[:a] + data[b:], f"without line {data.count(10, 0, a) + 1}", True)
    value = int(found[1])
    said = _number(value, rng)
    if name.endswith(".ply") and rng.integers(0, 2) and value > 1:
        said = int(rng.integers(0, value))
    if name.endswith(".obj"):
        said += 100_000
    new = data[:a] + str(said).encode() + data[b:]
    return Damage(new, f"{said} in place of {value} at byte {a}", True)


def _lying_gltf(name: str, data: bytes, rng: Rng) -> Damage:
    if name.endswith(".glb") and rng.integers(0, 3) == 0:
        at = int(rng.choice([8, 12]))  # lengths of the file and of the first chunk
        value = int.from_bytes(data[at : at + 4], "little")
        said = int(rng.choice([0, 1, value - 4, value + 4, 1 << 31]))
        new = data[:at] + said.to_bytes(4, "little") + data[at + 4 :]
        return Damage(new, f"length {said} in place of {value} at byte {at}", True)
    text, rest = (data, b"") if name.endswith(".gltf") else _split(data)
    root = json.loads(text)
    places: list[tuple[Any, str]] = []
    for table, key in (("accessors", "count"), ("bufferViews", "byteLength"),
                       ("bufferViews", "byteOffset")):  # fmt: skip
        places += [(entry, key) for entry in root[table] if key in entry]
    for view in root["bufferViews"]:
        places += [(e, "count") for e in view.get("extensions", {}).values()]
    places += [(e["sparse"], "count") for e in root["accessors"] if "sparse" in e]
    places += [
        (primitive, "indices") for mesh in root["meshes"] for primitive in mesh["primitives"]
    ]
    entry, key = places[int(rng.integers(0, len(places)))]
    value = entry[key]
    # The last buffer view is an index list's: all of them say more than there is.
    entry[key] = _number(value, rng) + (1 << 16 if key == "byteLength" else 0)
    said = f"{key} {entry[key]} in place of {value}"
    # What is compressed has no bytes of its own, and a view's length says nothing of it. A view
    # may begin anywhere that its numbers can, and an image is not looked at.
    certain = "meshopt" not in name or key != "byteLength"
    if key == "byteOffset":
        certain = bool(entry[key] % 2 or entry[key] >= 1 << 15) and name != "textured.glb"
    new = json.dumps(root).encode()
    return Damage(new if name.endswith(".gltf") else _joined(new, rest), said, certain)


def _split(data: bytes) -> tuple[bytes, bytes]:
    """The JSON of a .glb, and the chunks after it."""
    size = int.from_bytes(data[12:16], "little")
    return data[20 : 20 + size], data[20 + size :]


def _joined(text: bytes, rest: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    whole = len(text).to_bytes(4, "little") + b"JSON" + text + rest
    return b"glTF" + (2).to_bytes(4, "little") + (12 + len(whole)).to_bytes(4, "little") + whole


def _garbled(name: str, data: bytes, rng: Rng) -> Damage:
    """Garbage in a place that means something."""
    garbage = bytes(rng.choice(list(b"#~x?\0\xff"), 3).tolist())
    if name.endswith(".glb"):
        text, rest = _split(data)
        at = _place(rb'[{}\[\]:"]', text, rng)
        new = _joined(text[:at] + garbage[:1].replace(b"x", b"~") + text[at + 1 :], rest)
        return Damage(new, f"garbage at {at} of the JSON", True)
    garbage = b"x" + garbage.replace(b"#", b"~")
    if name.endswith(".gltf"):
        at, size = _place(rb"[{}\[\]]", data, rng), 1
    elif name.endswith(".obj"):
        at, size = _place(rb"(?<=\n(?:v|f) )\S|(?<=\n)(?:v|f)(?= )", data, rng), 1
    elif name == "ascii.stl":
        at, size = _place(rb"facet|vertex|outer|loop|(?<=vertex )\S", data, rng), 2
    elif name == "ascii.ply":
        at, size = _place(rb"(?<=\n)\d|element|property|format|end_", data, rng), 1
    else:  # the header, or for binary STL all of it
        at, size = _place(rb"(?<=\n)\S+(?= )|end_header", data[:200] + b" ", rng), 2
        if name == "binary.stl":
            return Damage(data[:83] + b"\x7f" + data[84:], "garbage for the count", True)
    return Damage(data[:at] + garbage + data[at + size :], f"{garbage!r} at byte {at}", True)


def _place(pattern: bytes, data: bytes, rng: Rng) -> int:
    """Where one of the matches begins."""
    found = [m.start() for m in re.finditer(pattern, data)]
    return found[int(rng.integers(0, len(found)))]
