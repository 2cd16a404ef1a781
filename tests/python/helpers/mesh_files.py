"""Small writers of mesh files, in the plainest way, to check the readers against."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

# A tetrahedron, wound to face outwards.
TETRA_POSITIONS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
TETRA_TRIANGLES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.uint32)


def signed_volume(mesh: Any) -> float:
    """Positive if the triangles of a closed mesh face outwards."""
    p = mesh.positions.astype(np.float64)[mesh.triangles]
    return float(np.einsum("ni,ni->n", p[:, 0], np.cross(p[:, 1], p[:, 2])).sum() / 6)


def corners(mesh: Any) -> np.ndarray:
    """(m, 3, 3) the triangles' positions, whatever the numbering of vertices."""
    return mesh.positions[mesh.triangles]


def bumpy_sphere(n: int = 12, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Positions and triangles of a closed lumpy ball."""
    rng = np.random.default_rng(seed)
    theta = np.linspace(0, np.pi, n + 1)[1:-1]
    phi = np.linspace(0, 2 * np.pi, 2 * n, endpoint=False)
    ring = np.stack(
        [
            np.outer(np.sin(theta), np.cos(phi)),
            np.outer(np.sin(theta), np.sin(phi)),
            np.outer(np.cos(theta), np.ones_like(phi)),
        ],
        axis=2,
    ).reshape(-1, 3)
    points = np.concatenate([ring, [[0, 0, 1], [0, 0, -1]]]) * (
        1 + 0.1 * rng.random((len(ring) + 2, 1))
    )
    rows, columns = n - 1, 2 * n
    faces = []
    for r in range(rows - 1):
        for c in range(columns):
            a, b = r * columns + c, r * columns + (c + 1) % columns
            faces += [[a, a + columns, b], [b, a + columns, b + columns]]
    top, bottom = rows * columns, rows * columns + 1
    for c in range(columns):
        d = (c + 1) % columns
        faces.append([top, c, d])
        faces.append([bottom, (rows - 1) * columns + d, (rows - 1) * columns + c])
    return points.astype(np.float32), np.array(faces, np.uint32)


# --- PLY --------------------------------------------------------------------------------------

_PLY_FORMATS = {
    "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I",
    "float": "f", "double": "d", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H",
    "int32": "i", "uint32": "I", "float32": "f", "float64": "d",
}  # fmt: skip


def ply_bytes(
    elements: list[tuple[str, list[tuple[str, ...]], list[tuple[Any, ...]]]],
    fmt: str = "binary_little_endian",
    newline: str = "\n",
) -> bytes:
    """A PLY file of elements (name, properties, rows). A property is (type, name) or
    ("list", count type, type, name); a row has one entry a property, lists as sequences."""
    head = ["ply", f"format {fmt} 1.0", "comment made for a test"]
    for name, properties, rows in elements:
        head.append(f"element {name} {len(rows)}")
        head += ["property " + " ".join(p) for p in properties]
    out = (newline.join(head) + newline + "end_header" + newline).encode()
    order = ">" if fmt == "binary_big_endian" else "<"
    for _, properties, rows in elements:
        for row in rows:
            words: list[str] = []
            for p, value in zip(properties, row, strict=True):
                values = list(value) if p[0] == "list" else [value]
                if fmt == "ascii":
                    words += [str(len(values))] if p[0] == "list" else []
                    words += [_ascii_number(v, p[-2]) for v in values]
                else:
                    if p[0] == "list":
                        out += struct.pack(order + _PLY_FORMATS[p[1]], len(values))
                    out += struct.pack(f"{order}{len(values)}{_PLY_FORMATS[p[-2]]}", *values)
            if fmt == "ascii":
                out += (" ".join(words) + newline).encode()
    return out


def _ascii_number(value: Any, kind: str) -> str:
    return repr(float(value)) if _PLY_FORMATS[kind] in "fd" else str(int(value))


# --- STL --------------------------------------------------------------------------------------


def stl_bytes(corners: np.ndarray, kind: str, name: str = "x") -> bytes:
    """An STL file, "ascii" or "binary", of (m, 3, 3) corners, without normals."""
    if kind == "ascii":
        facets = "".join(
            "facet normal 0 0 0\nouter loop\n"
            + "".join("vertex {:.6g} {:.6g} {:.6g}\n".format(*p) for p in t.tolist())
            + "endloop\nendfacet\n"
            for t in corners
        )
        return f"solid {name}\n{facets}endsolid {name}\n".encode()
    records = np.zeros(len(corners), [("n", "<f4", 3), ("p", "<f4", (3, 3)), ("a", "<u2")])
    records["p"] = corners
    return bytes(80) + len(corners).to_bytes(4, "little") + records.tobytes()
