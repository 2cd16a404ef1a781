"""What the reader of glTF leaves out of a file, in words."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any

from umbel.io.gltf.properties import unknown_properties

Json = dict[str, Any]

_TRIANGLES = (4, 5, 6)
_PLAIN = {"POSITION", "NORMAL", "TANGENT", "COLOR_0", *(f"TEXCOORD_{k}" for k in range(8))}
_SKIN = {f"{kind}_{k}" for kind in ("JOINTS", "WEIGHTS") for k in range(3)}
_READ = {"KHR_draco_mesh_compression"}
_SHOWN = 5  # names in a warning


def losses(root: Json, drawn: Iterable[Json], extensions: set[str]) -> Iterator[str]:
    """Each thing that is lost of what the scene draws; `drawn` are its nodes, and `extensions`
    those that are lost elsewhere."""
    nodes = list(drawn)
    numbers = dict.fromkeys(node["mesh"] for node in nodes if "mesh" in node)
    meshes = [root["meshes"][k] for k in numbers]
    primitives = [p for mesh in meshes for p in mesh.get("primitives") or []]
    skipped = sum(p.get("mode", 4) not in _TRIANGLES for p in primitives)
    if skipped:
        yield (
            f"{skipped} primitives of points or lines"
            if skipped > 1
            else ("a primitive of points or lines")
        )
    shown = [p for p in primitives if p.get("mode", 4) in _TRIANGLES]
    lost = {name for p in shown for name in _attributes(p.get("attributes") or {})}
    if lost:
        yield f"the attributes {', '.join(sorted(lost, key=_natural))}"
    yield from _motion(root, [*meshes, *nodes], shown)
    inside = {e for p in shown for e in p.get("extensions") or {}} - _READ
    if inside | extensions:
        yield ", ".join(sorted(inside | extensions))
    scenes = len(root.get("scenes") or [])
    if scenes > 1:
        yield f"{scenes - 1} other scenes" if scenes > 2 else "another scene"


def missing_textures(count: int) -> Iterator[str]:
    """So many that have no image."""
    if count:
        yield f"{count} textures without an image" if count > 1 else "a texture without an image"


def unknown_names(root: Json) -> Iterator[str]:
    """Properties that glTF does not have, the first of them by name."""
    unknown = list(unknown_properties(root))
    if unknown:
        more = f" and {len(unknown) - _SHOWN} more" if len(unknown) > _SHOWN else ""
        yield f"{', '.join(unknown[:_SHOWN])}{more}, which glTF does not have"


def _attributes(attributes: Json) -> set[str]:
    """Those that a Mesh cannot hold."""
    lost = set(attributes) - _PLAIN - _SKIN
    for kind, most in (("TEXCOORD", 8), ("JOINTS", 3)):
        sets = [k for k in range(most) if f"{kind}_{k}" in attributes]
        lost.update(f"{kind}_{k}" for place, k in enumerate(sets) if k != place)
    return lost


def _natural(name: str) -> tuple[str, int]:
    found = re.search(r"\d+$", name)
    return name.rstrip("0123456789"), int(found.group()) if found else 0


def _motion(root: Json, weighted: list[Json], shown: list[Json]) -> Iterator[str]:
    """Of animations and morph targets; `weighted` may have weights of these."""
    targets = max((len(p.get("targets") or []) for p in shown), default=0)
    if targets:
        used = any(any(entry.get("weights") or []) for entry in weighted)
        note = " (default weights are applied)" if used else ""
        yield (f"{targets} morph targets" if targets > 1 else "a morph target") + note
    animations = len(root.get("animations") or [])
    if animations:
        yield f"{animations} animations" if animations > 1 else "an animation"
