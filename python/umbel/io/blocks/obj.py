"""OBJ: a text, so it is written as tables once."""

from __future__ import annotations

import warnings
from pathlib import Path

from umbel.errors import LoadWarning
from umbel.io.blocks.layout import Layout
from umbel.io.files import GZIP, read_head, text_of
from umbel.io.folder import Folder
from umbel.io.obj.reader import materials_of


def lay_out(layout: Layout, path: Path) -> bool:
    """Adds the file's tables; False if only the reader of whole files can read it."""
    if read_head(path).startswith(GZIP):
        return False
    where = text_of(path)
    layout.recipe = None
    found = layout.native.add_obj(path, where, layout.new_file(""))
    for note in found["notes"]:
        warnings.warn(note.decode("utf-8", "replace"), LoadWarning, stacklevel=4)
    numbers = None
    if found["has_materials"]:
        numbers = layout.shared.add(
            materials_of(found, Folder(path.parent, layout.allow_outside), where)
        )
    layout.add_part(
        where,
        found["columns"],
        found["triangles"],
        color_scale=found["color_scale"],
        srgb_colors=True,
        may_miss=found["misses_material"],
        vertices=found["vertices"],
        numbers=numbers,
    )
    return True
