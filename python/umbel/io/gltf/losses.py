"""What the reader of glTF leaves out of a file, in words."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any

from umbel.io.gltf.buffers import MESHOPT
from umbel.io.gltf.materials import ALPHA_MODES
from umbel.io.gltf.properties import unknown_properties

Json = dict[str, Any]

_TRIANGLES = (4, 5, 6)
_PLAIN = {"POSITION", "NORMAL", "TANGENT", "COLOR_0", *(f"TEXCOORD_{k}" for k in range(8))}
_UNSIGNED = (5121, 5123, 5125)
_PLACES = {"TRANSLATION", "ROTATION", "SCALE"}
_READ = {"KHR_draco_mesh_compression", *MESHOPT}
_INSTANCING = "EXT_mesh_gpu_instancing"
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
    lost = {name for p in shown for name in _attributes(p.get("attributes") or {}, root)}
    if lost:
        yield f"the attributes {', '.join(sorted(lost, key=_natural))}"
    of_instances = {name for node in nodes for name in _instanced(node)} - _PLACES
    if of_instances:
        yield f"the instances' attributes {', '.join(sorted(of_instances, key=_natural))}"
    yield from _motion(root, [*meshes, *nodes], shown)
    materials = root.get("materials") or []
    modes = {mode for m in materials if (mode := m.get("alphaMode", "OPAQUE")) not in ALPHA_MODES}
    if modes:
        yield f"the alphaMode {', '.join(map(repr, sorted(modes)))}, which is none of glTF's"
    bases = [m.get("pbrMetallicRoughness") or {} for m in materials]
    data = [e for table in ("accessors", "bufferViews", "buffers") for e in root.get(table) or []]
    sparse = [entry["sparse"] for entry in root.get("accessors") or [] if "sparse" in entry]
    data += [*sparse, *(e[key] for e in sparse for key in ("indices", "values") if key in e)]
    parts = [*shown, *meshes, *(root.get("skins") or []), *bases, *data]
    inside = {e for part in parts for e in part.get("extensions") or {}} - _READ
    if inside | extensions:
        yield ", ".join(sorted(inside | extensions))
    for what, holders in (
        ("primitives", shown),
        ("pbrMetallicRoughness", bases),
        ("accessors and buffers", data),
    ):
        if any("extras" in holder for holder in holders):
            yield f"the extras of {what}"
    beside = set(_beside(root, nodes))
    if beside:
        yield ", ".join(sorted(beside))
    scenes = len(root.get("scenes") or [])
    if scenes > 1:
        yield f"{scenes - 1} other scenes" if scenes > 2 else "another scene"
    idle = len(root.get("meshes") or []) - len(meshes)
    if idle and scenes <= 1:
        yield f"{idle} meshes that are not drawn" if idle > 1 else "a mesh that is not drawn"


def idle_nodes(root: Json, kept: int) -> Iterator[str]:
    """Nodes of the file that its only scene does not have; `kept` are those that a tree keeps."""
    idle = len(root.get("nodes") or []) - kept
    if idle and len(root.get("scenes") or []) == 1:
        yield (
            f"{idle} nodes that the scene does not have"
            if idle > 1
            else ("a node that the scene does not have")
        )


def missing_textures(count: int) -> Iterator[str]:
    """So many that have no image."""
    if count:
        yield f"{count} textures without an image" if count > 1 else "a texture without an image"


def idle_images(count: int) -> Iterator[str]:
    """So many that no material uses."""
    if count:
        yield f"{count} images that are not used" if count > 1 else "an image that is not used"


def unknown_names(root: Json) -> Iterator[str]:
    """Properties that glTF does not have, the first of them by name."""
    unknown = list(unknown_properties(root))
    if unknown:
        more = f" and {len(unknown) - _SHOWN} more" if len(unknown) > _SHOWN else ""
        yield f"{', '.join(unknown[:_SHOWN])}{more}, which glTF does not have"


def _attributes(attributes: Json, root: Json) -> set[str]:
    """Those that a Mesh cannot hold."""
    lost = set(attributes) - _PLAIN
    for k in range(3):  # joints and weights, up to the first set that is not whole
        pair = {f"JOINTS_{k}", f"WEIGHTS_{k}"}
        if not pair <= set(attributes) or not _is_whole(attributes[f"JOINTS_{k}"], root):
            break
        lost -= pair
    return lost


def _is_whole(accessor: int, root: Json) -> bool:
    """Whether an accessor has numbers that joints can have."""
    known = root.get("accessors") or []
    return accessor < len(known) and known[accessor].get("componentType") in _UNSIGNED


def _beside(root: Json, nodes: list[Json]) -> Iterator[str]:
    """What extensions that are read for one property have beside it: those that give instances, or
    the image of a texture."""
    textures = root.get("textures")
    held = [(node, "attributes") for node in nodes]
    held += [(one, "source") for one in (textures if isinstance(textures, list) else ())]
    for entry, known in held:
        extensions = entry.get("extensions") if isinstance(entry, dict) else None
        for name, extension in extensions.items() if isinstance(extensions, dict) else ():
            is_read = isinstance(extension, dict) and isinstance(extension.get(known), int)
            if is_read or name == _INSTANCING:
                yield from (f"{key} of {name}" for key in extension if key != known)


def _instanced(node: Json) -> Json:
    """The attributes of a node's instances."""
    extension = (node.get("extensions") or {}).get(_INSTANCING) or {}
    return extension.get("attributes") or {}


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
