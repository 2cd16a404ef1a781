"""What is wrong with a file's JSON is named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from helpers.gltf_builder import GltfBuilder, read
from helpers.refusals import refused


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
        (put("nodes.0.scale", [1, float("inf"), 1]), r"scale\[1\] should be a number, not inf"),
        (put("nodes.0.scale", "big"), r"nodes\[0\].scale should be an array, not 'big'"),
        (put("scenes.0.nodes", [0, 0]), "twice"),
        (put("scenes.0.nodes", [-1]), r"refers to nodes\[-1\]"),
        (put("scene", 4), r"scenes\[4\]"),
        (put("accessors.0.count", 5), "needs 60 bytes of bufferViews"),
        (put("accessors.0.count", 10**18), "needs"),
        (put("accessors.0.count", -1), "count -1"),
        (put("accessors.0.count", 3), None),
        (put("accessors.0.count", 4.0), None),
        (put("scenes.0.nodes", [0.0]), None),
        (put("scenes.0.nodes", [0.5]), r"scenes\[0\].nodes\[0\] should be an integer, not 0.5"),
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
    with refused(says, "mesh.glb"):
        read(tmp_path, data)
