"""Textured scenes for the viewer's tests: large textures, and all features of materials.

Each is written as a glTF file of squares in a row, and built from that.
"""

import base64
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import umbel

Json = dict[str, Any]

#: 8 x 8 texels, red and green above blue and white, as basisu 2.1 encodes them.
KTX2 = base64.b64decode(
    "q0tUWCAyMLsNChoKAAAAAAEAAAAIAAAACAAAAAAAAAAAAAAAAQAAAAEAAAABAAAAaAAAACwAAACUAAAAJAAAALgAAAAA"
    "AAAAiQAAAAAAAABBAQAAAAAAAAIAAAAAAAAAAAAAAAAAAAAsAAAAAAAAAAIAKACjAQIAAwMAAAgAAAAAAAAAAAA/AAAA"
    "AAAAAAAA/////x8AAABLVFh3cml0ZXIAQmFzaXMgVW5pdmVyc2FsIDIuMTAAAAQAAgArAAAACQAAAC0AAAAAAAAAAAAA"
    "AAAAAAACAAAAAAAAAAAAAAAgwEQAAAAAAADiBAQwEQAAAAAAgCQQACYAAAAAAAAQAoAJAAAAAAAABDA2rKqqqlJVVVUF"
    "AMFEAAAAAAAA8l+NAJgBAAAAAABAwggwIUAAAAAABJFTCgAmAAAAAAAAEEAAEAY="
)
QUADRANTS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
#: Length of a square's side, of the row from one to the next, and of its lines of vertices.
SIDE, STEP, LINES = 1.0, 1.25, 5


def data_uri(data: bytes, kind: str) -> str:
    """An image inside a glTF file."""
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"


def encoded(texels: np.ndarray, kind: str, **options: Any) -> bytes:
    """An image file."""
    out = io.BytesIO()
    Image.fromarray(texels).save(out, kind, **options)
    return out.getvalue()


def write_row(path: Path, materials: list[Json], **root: Any) -> None:
    """A square for each material, from left to right; two sets of texture coordinates each, the
    second upside down."""
    lines = np.linspace(0, 1, LINES, dtype=np.float32)
    uv = np.stack(np.meshgrid(lines, lines), axis=-1).reshape(-1, 2)
    corner = np.arange(LINES * LINES).reshape(LINES, LINES)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    triangles = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1).astype(np.uint32)
    buffer, views, accessors, primitives = b"", [], [], []

    def accessor(values: np.ndarray, kind: str, component: int) -> int:
        nonlocal buffer
        views.append({"buffer": 0, "byteOffset": len(buffer), "byteLength": values.nbytes})
        buffer += values.tobytes()
        accessors.append(
            {
                "bufferView": len(views) - 1,
                "componentType": component,
                "count": values.size if kind == "SCALAR" else len(values),
                "type": kind,
                "min": np.atleast_1d(values.min(axis=0)).tolist(),
                "max": np.atleast_1d(values.max(axis=0)).tolist(),
            }
        )
        return len(accessors) - 1

    indices = accessor(triangles, "SCALAR", 5125)
    normals = accessor(np.tile(np.float32([0, 0, 1]), (len(uv), 1)), "VEC3", 5126)
    first = accessor(uv, "VEC2", 5126)
    second = accessor(np.ascontiguousarray(uv * [1, -1] + [0, 1], np.float32), "VEC2", 5126)
    for i in range(len(materials)):
        xy = (uv - 0.5) * [SIDE, -SIDE] + [STEP * i, 0]
        positions = np.hstack([xy, np.zeros((len(uv), 1))]).astype(np.float32)
        attributes = {
            "POSITION": accessor(positions, "VEC3", 5126),
            "NORMAL": normals,
            "TEXCOORD_0": first,
            "TEXCOORD_1": second,
        }
        primitives.append({"attributes": attributes, "indices": indices, "material": i})
    uri = f"data:application/octet-stream;base64,{base64.b64encode(buffer).decode()}"
    gltf = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": primitives}],
        "buffers": [{"byteLength": len(buffer), "uri": uri}],
        "bufferViews": views,
        "accessors": accessors,
        "materials": materials,
        **root,
    }
    path.write_text(json.dumps(gltf), encoding="utf-8")


def large_textures(folder: Path) -> None:
    """Squares with textures of 4096 x 4096 texels that no coder makes small."""
    random = np.random.default_rng(5)
    images = []
    for hue in ([230, 60, 50], [60, 200, 80], [70, 90, 240]):
        noise = random.integers(-48, 48, (1024, 1024, 1), np.int16)
        tile = np.clip(np.array(hue, np.int16) + noise, 0, 255).astype(np.uint8)
        data = encoded(np.tile(tile, (4, 4, 1)), "JPEG", quality=90)
        images.append({"uri": data_uri(data, "jpeg")})
    count = len(images)
    write_row(
        folder / "large.gltf",
        [
            {
                "name": f"square {i}",
                "pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture": {"index": i}},
            }
            for i in range(count)
        ],
        images=images,
        textures=[{"source": i} for i in range(count)],
    )


def all_materials(folder: Path) -> None:
    """A square for each feature of materials."""
    # Long: a list of materials.
    quadrants = encoded(QUADRANTS, "PNG")
    dark_above = encoded(np.uint8([[[0, 0, 0]], [[255, 255, 255]]]), "PNG")
    holes = np.concatenate([QUADRANTS, np.uint8([[[255], [0]], [[255], [0]]])], axis=2)
    images = [
        {"uri": data_uri(quadrants, "png")},
        {"uri": data_uri(KTX2, "ktx2"), "name": "ktx2"},
        {"uri": data_uri(dark_above, "png")},
        {"uri": data_uri(encoded(holes, "PNG"), "png")},
        {"uri": data_uri(encoded(QUADRANTS, "WEBP", lossless=True), "webp")},
    ]
    basis = {"sampler": 0, "extensions": {"KHR_texture_basisu": {"source": 1}}}
    webp = {"sampler": 0, "extensions": {"EXT_texture_webp": {"source": 4}}}
    textures = [{"source": i, "sampler": 0} for i in range(4)]
    unlit: Json = {"KHR_materials_unlit": {}}

    def painted(texture: Json, **more: Any) -> Json:
        return {"pbrMetallicRoughness": {"baseColorTexture": texture}, **more}

    quarter = {"KHR_texture_transform": {"offset": [0.5, 0], "scale": [0.5, 0.5]}}
    write_row(
        folder / "materials.gltf",
        [
            painted({"index": 0}, name="unlit", extensions=unlit),
            painted({"index": 4}, name="basis", extensions=unlit),
            painted({"index": 5}, name="webp", extensions=unlit),
            painted({"index": 0, "texCoord": 1}, name="second set", extensions=unlit),
            painted({"index": 0, "extensions": quarter}, name="moved", extensions=unlit),
            painted(
                {"index": 3}, name="holes", extensions=unlit, alphaMode="MASK", alphaCutoff=0.25
            ),
            {
                "name": "shaded corners",
                "pbrMetallicRoughness": {"metallicFactor": 0},
                "occlusionTexture": {"index": 2, "texCoord": 1},
            },
            {
                "name": "glass",
                "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.1},
                "extensions": {
                    "KHR_materials_transmission": {"transmissionFactor": 1},
                    "KHR_materials_volume": {"thicknessFactor": 0.2},
                    "KHR_materials_ior": {"ior": 1.33},
                },
            },
            {
                "name": "lamp",
                "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]},
                "emissiveFactor": [0.25, 0, 0],
                "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}},
            },
            {"name": "unheard of", "extensions": {"EXT_unheard_of": {}}},
        ],
        images=images,
        textures=[*textures, basis, webp],
        samplers=[{"magFilter": 9728, "minFilter": 9728}],
        extensionsUsed=[
            *("KHR_materials_unlit", "KHR_texture_basisu", "EXT_texture_webp"),
            *("KHR_texture_transform", "KHR_materials_transmission", "KHR_materials_volume"),
            *("KHR_materials_ior", "KHR_materials_emissive_strength", "EXT_unheard_of"),
        ],
    )


def make_textured(folder: Path) -> None:
    """Builds them all as assets."""
    large_textures(folder)
    all_materials(folder)
    for name in ("large", "materials"):
        umbel.build_lod(folder / f"{name}.gltf").save(folder / f"{name}.umbel")
        (folder / f"{name}.gltf").unlink()
