"""What the reader of PLY leaves out of a file, in words."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Mapping

from umbel.errors import LoadWarning
from umbel.io.ply import names as ply_names
from umbel.io.ply.data import LONGEST_HEADER

LIST = "list"
_SHOWN = 6  # names in a warning

Kinds = Mapping[str, str]
"""Of an element's properties: "i", "u" or "f" of numbers, or LIST."""


def warn_of_losses(
    elements: Mapping[str, Kinds], head: bytes, where: str, splits: bool = False
) -> None:
    """One warning that names the elements that are no part of a mesh, the properties that nothing
    is made of, and the textures in a header's comments. `elements` are those that have rows, `head`
    is the file's beginning; `splits`: whether corners have texture coordinates of their own."""
    lost = list(_losses(elements, splits))
    header = head[:LONGEST_HEADER].partition(b"end_header")[0]
    named = re.findall(rb"[\r\n]comment[ \t]+TextureFile[ \t]+([^\r\n]+)", header)
    if named:
        lost.append(f"the textures {_listed([repr(n.decode('utf-8', 'replace')) for n in named])}")
    if lost:
        warnings.warn(f"{where}: left out: {'; '.join(lost)}", LoadWarning, stacklevel=6)


def _losses(elements: Mapping[str, Kinds], splits: bool) -> Iterator[str]:
    for name, kinds in elements.items():
        if name == "vertex":
            used = _of_vertices(kinds)
        elif name in ("face", "tristrips"):
            used = _of_faces(kinds, splits) if name == "face" else set()
            used.update([n for n in ply_names.INDEX_LISTS if kinds.get(n) == LIST][:1])
        else:
            yield f"the element '{name}'"
            continue
        rest = [n for n in kinds if n not in used]
        if rest:
            yield f"{_listed(rest)} of the element '{name}'"


def _of_vertices(kinds: Kinds) -> set[str]:
    used: set[str] = set()
    for choices in (
        ply_names.POSITION,
        ply_names.NORMAL,
        ply_names.UV,
        ply_names.COLOR,
        ply_names.TANGENT,
    ):
        for names in choices:
            if all(kinds.get(n, LIST) != LIST for n in names):
                used.update(names)
                if choices is ply_names.COLOR:
                    used.update([n for (n,) in ply_names.ALPHA if kinds.get(n, LIST) != LIST][:1])
                break
    return used


def _of_faces(kinds: Kinds, splits: bool) -> set[str]:
    numbers = [n for n in ply_names.MATERIAL_ID if kinds.get(n, LIST) != LIST][:1]
    used = {n for n in numbers if kinds[n] != "f"}
    return used | {ply_names.CORNER_UVS} if splits else used


def _listed(names: list[str]) -> str:
    more = [f"{len(names) - _SHOWN} more"] if len(names) > _SHOWN else []
    return ", ".join([*names[:_SHOWN], *more])
