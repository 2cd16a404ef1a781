"""What formats that hold less than glTF lose, in words."""

from __future__ import annotations

from collections.abc import Iterator

from umbel.geometry.mesh import Mesh


def attribute_losses(mesh: Mesh) -> Iterator[str]:
    """Of what neither PLY nor OBJ can say of vertices and of the scene."""
    if mesh.uv_sets:
        sets = len(mesh.uv_sets)
        yield "the second set of UVs" if sets == 1 else f"{sets} further sets of UVs"
    if mesh.joints is not None:
        yield "joints and weights"
    tree = mesh.tree
    nodes = tree.get("nodes", [])
    if any(set(node) - {"instances", "children"} for node in nodes):
        yield "the scene's nodes"
    if tree.get("cameras"):
        yield "cameras"
    if "KHR_lights_punctual" in tree.get("extensions", {}):
        yield "lights"
    if "extras" in tree or "extras" in tree.get("asset", {}) or mesh.extras is not None:
        yield "extras"


def copyright_line(mesh: Mesh) -> str:
    """The scene's copyright for a comment, "" where it has none."""
    words = str(mesh.tree.get("asset", {}).get("copyright", "")).split()
    return " ".join(["copyright:", *words]) if words else ""
