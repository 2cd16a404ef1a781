"""What formats that hold less than glTF lose, in words."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from umbel.geometry.mesh import Mesh
from umbel.io.coordinates import sidecar
from umbel.plain_json import plain

LIGHTS = "KHR_lights_punctual"
WHERE = {"instances", "children", "translation", "rotation", "scale", "matrix"}
"""What nodes say that is in the instances, too."""


def attribute_losses(mesh: Mesh) -> Iterator[str]:
    """Of what neither PLY nor OBJ can say of vertices and of the scene."""
    if mesh.uv_sets:
        sets = len(mesh.uv_sets)
        yield "the second set of UVs" if sets == 1 else f"{sets} further sets of UVs"
    if mesh.joints is not None:
        yield "joints and weights"
    if any(set(node) - {"instances", "children"} for node in mesh.tree.get("nodes", [])):
        yield "the scene's nodes"
    yield from scene_losses(mesh.tree, mesh.extras)


def scene_losses(tree: dict[str, Any], extras: Any = None) -> Iterator[str]:
    """Of what a scene's tree says but for the nodes and the copyright; `extras` are those of its
    mesh."""
    yield from camera_and_light_losses(tree)
    yield from sorted(set(tree.get("extensions", {})) - {LIGHTS})
    held = [tree, tree.get("asset", {}), *tree.get("scenes", []), *tree.get("meshes", [])]
    if extras is not None or any("extras" in entry for entry in held):
        yield "extras"
    yield from name_losses(tree)


def name_losses(tree: dict[str, Any]) -> Iterator[str]:
    """Of what the tree calls the scene and its meshes."""
    if any(entry.get("name") for key in ("scenes", "meshes") for entry in tree.get(key, [])):
        yield "names of the scene and its meshes"


def camera_and_light_losses(tree: dict[str, Any]) -> Iterator[str]:
    """Of a scene's tree without them."""
    if tree.get("cameras"):
        yield "cameras"
    if LIGHTS in tree.get("extensions", {}):
        yield "lights"


def reference_losses(path: Path, coordinates: dict[str, str]) -> Iterator[str]:
    """Of what a file's coordinates refer to, which only a .prj file beside it says."""
    crs = coordinates.get("crs")
    if crs and sidecar(path).get("crs") != crs:
        yield "the reference system of its coordinates, which a .prj file said"


def copyright_line(mesh: Mesh) -> str:
    """The scene's copyright for a comment, "" where it has none."""
    words = plain(str(mesh.tree.get("asset", {}).get("copyright", ""))).split()
    return " ".join(["copyright:", *words]) if words else ""
