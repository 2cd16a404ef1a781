"""Binary STL as a table."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from umbel.io.blocks.layout import Layout
from umbel.io.files import GZIP, read_head
from umbel.io.stl import binary_table, warn_of_attributes


def lay_out(layout: Layout, path: Path) -> bool:
    """Adds the file's triangles; False if only the reader of whole files can read it."""
    head = read_head(path)
    if head.startswith(GZIP):
        return False
    found = binary_table(head, path.stat().st_size, str(path))
    if found is None:
        return False
    offset, stride, count = found
    if count:
        warn_of_attributes(np.memmap(path, mode="r"), count, str(path))
    table = layout.add_table(layout.add_file(path), offset, stride, count)
    corners = [12 + 4 * k for k in range(9)]
    layout.add_part(str(path), {"positions": (table, "f4", corners, False)})
    return True
