"""Writes a mesh as OBJ text, with its materials in an MTL beside it."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import warn_lost
from umbel.geometry.mesh import Mesh
from umbel.io.colors import MOST_BRIGHT, to_srgb
from umbel.io.files import replacing_together
from umbel.io.format_losses import attribute_losses, copyright_line, reference_losses
from umbel.io.obj.mtl_writer import MtlWriter, encoded, head

_CHUNK = 1 << 16  # rows formatted at once


def write_obj(path: Path, mesh: Mesh) -> None:
    """Writes OBJ text with as many digits as give every float back to the bit, positions in the
    world, and beside it a .mtl and images if the mesh has materials. One warning names what OBJ
    cannot hold. Only texture coordinates that count from an image's top are turned round."""
    library = MtlWriter(path, mesh.materials if mesh.material_ids is not None else [])
    lost = [*_losses(mesh), *library.lost, *reference_losses(path, mesh.coordinates)]
    if lost:
        warn_lost(f"{path}: OBJ has no place for", lost, most=8)
    with replacing_together() as opened:
        for name, data in library.files.items():
            with opened(path.with_name(name)) as file:
                file.write(data)
        with opened(path) as file:
            _write(file, mesh, library)


def _write(file: IO[bytes], mesh: Mesh, library: MtlWriter) -> None:
    names, uvs = library.names, mesh.uvs
    if uvs is not None and library.flips:
        uvs = np.stack([uvs[:, 0], np.float32(1) - uvs[:, 1]], axis=1)
    file.write(head(library.ours))
    if not len(mesh.triangles):
        file.write(b"# no faces\n")  # or readers would take the file for one that is cut short
    if copyright_line(mesh):
        file.write(f"# {copyright_line(mesh)}\n".encode())
    if library.name:
        file.write(encoded(f"mtllib {library.name}\n"))
    points: NDArray[Any] = mesh.vertices
    row = "v" + (" %.9g" if points.dtype == np.float32 else " %r") * 3
    if mesh.colors is not None:
        colors = np.minimum(to_srgb(mesh.colors[:, :3]), np.float32(MOST_BRIGHT))
        points = np.concatenate([points, colors], axis=1)
        row += " %.9g %.9g %.9g"
    _write_rows(file, row, points)
    if uvs is not None:
        _write_rows(file, "vt %.9g %.9g", uvs)
    if mesh.normals is not None:
        _write_rows(file, "vn %.9g %.9g %.9g", mesh.normals)
    corner = {
        (False, False): " %d",
        (True, False): " %d/%d",
        (False, True): " %d//%d",
        (True, True): " %d/%d/%d",
    }[mesh.uvs is not None, mesh.normals is not None]
    faces = np.repeat(mesh.triangles.astype(np.int64) + 1, corner.count("%d"), axis=1)
    for start, stop, material in _runs(mesh):
        if material is not None:
            name = names[material] if material < len(names) else f"material_{material}"
            file.write(f"usemtl {name}\n".encode())
        _write_rows(file, "f" + corner * 3, faces[start:stop])


def _losses(mesh: Mesh) -> list[str]:
    lost = list(attribute_losses(mesh))
    if mesh.tangents is not None:
        lost.append("tangents")
    if mesh.colors is not None and (mesh.colors[:, 3] != 1).any():
        lost.append("the alpha of colours")
    if mesh.colors is not None and (to_srgb(mesh.colors[:, :3]) > MOST_BRIGHT).any():
        lost.append("colours so bright that they could be bytes")
    return lost


def _runs(mesh: Mesh) -> list[tuple[int, int, int | None]]:
    """Ranges of consecutive triangles of the same material."""
    m = len(mesh.triangles)
    if mesh.material_ids is None or not m:
        return [(0, m, None)]
    cuts = np.flatnonzero(np.diff(mesh.material_ids)) + 1
    edges = [0, *cuts.tolist(), m]
    return [(a, b, int(mesh.material_ids[a])) for a, b in pairwise(edges)]


def _write_rows(file: Any, row: str, table: NDArray[Any]) -> None:
    for start in range(0, len(table), _CHUNK):
        part = table[start : start + _CHUNK]
        file.write(((row + "\n") * len(part) % tuple(part.reshape(-1).tolist())).encode())
