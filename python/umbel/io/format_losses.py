"""What formats that hold less than glTF lose, in words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from umbel.geometry.mesh import Mesh

LIGHTS = "KHR_lights_punctual"


def attribute_losses(mesh: Mesh) -> Iterator[str]:
    """Of what neither PLY nor OBJ can say of vertices and of the scene."""
    if mesh.uv_sets:
        sets = len(mesh.uv_sets)
        yield "the second set of UVs" if sets == 1 else f"{sets} further sets of UVs"
    if mesh.joints is not None:
        yield "joints and weights"
    tree = mesh.tree
    if any(set(node) - {"instances", "children"} for node in tree.get("nodes", [])):
        yield "the scene's nodes"
    yield from camera_and_light_losses(tree)
    if "extras" in tree or "extras" in tree.get("asset", {}) or mesh.extras is not None:
        yield "extras"


def camera_and_light_losses(tree: dict[str, Any]) -> Iterator[str]:
    """Of a scene's tree without them."""
    if tree.get("cameras"):
        yield "cameras"
    if LIGHTS in tree.get("extensions", {}):
        yield "lights"


def copyright_line(mesh: Mesh) -> str:
    """The scene's copyright for a comment, "" where it has none."""
    words = str(mesh.tree.get("asset", {}).get("copyright", "")).split()
    return " ".join(["copyright:", *words]) if words else ""
