"""Meshes far from zero, as on maps, and files of them."""

import json
import struct

import numpy as np

import umbel

UTM = np.array([500000.0, 4649776.0, 312.5])
EARTH = np.array([4027893.75, 307045.5, 4919474.125])
WKT = 'PROJCS["WGS 84 / UTM zone 33N",GEOGCS["WGS 84"],UNIT["metre",1]]'


def patch(cells=99, step=0.05, at=UTM):
    """A wavy height field around a place on a map: float64 points, and triangles."""
    x, y = np.meshgrid(np.arange(cells + 1) * step, np.arange(cells + 1) * step)
    points = np.stack([x, y, 0.3 * np.sin(3 * x) * np.cos(2 * y)], axis=-1).reshape(-1, 3) + at
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).reshape(-1)
    a, b, c, d = corner, corner + 1, corner + cells + 1, corner + cells + 2
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)]).astype(np.uint32)
    return points, faces


def degenerate(points, faces):
    p = np.asarray(points, np.float64)
    a, b, c = (p[faces[:, k]] for k in range(3))
    return int((~np.cross(b - a, c - a).any(axis=1)).sum())


def write_ply(path, points, faces):
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(points)}",
        *(f"property double {axis}" for axis in "xyz"),
        f"element face {len(faces)}",
        "property list uchar uint vertex_indices",
        "end_header\n",
    ]
    rows = np.empty(len(faces), [("n", "u1"), ("v", "<u4", 3)])
    rows["n"], rows["v"] = 3, faces
    path.write_bytes("\n".join(header).encode() + points.astype("<f8").tobytes() + rows.tobytes())


def write_obj(path, points, faces):
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
    path.write_text("\n".join(lines) + "\n")


def write_stl(path, points, faces):
    lines = ["solid patch"]
    for face in faces.tolist():
        lines.append("facet normal 0 0 0\nouter loop")
        lines += ["vertex {!r} {!r} {!r}".format(*points[i].tolist()) for i in face]
        lines.append("endloop\nendfacet")
    path.write_text("\n".join([*lines, "endsolid patch", ""]))


def write_gltf(path, positions, faces, nodes):
    """Nodes that all show one mesh."""
    indices = faces.astype("<u4").tobytes()
    data = positions.astype("<f4").tobytes() + indices
    low, high = positions.min(axis=0).tolist(), positions.max(axis=0).tolist()
    root = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": [{"mesh": 0, **node} for node in nodes],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": [
            {"buffer": 0, "byteLength": len(data) - len(indices)},
            {"buffer": 0, "byteOffset": len(data) - len(indices), "byteLength": len(indices)},
        ],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": len(positions),
                "type": "VEC3",
                "min": low,
                "max": high,
            },
            {"bufferView": 1, "componentType": 5125, "count": faces.size, "type": "SCALAR"},
        ],
    }
    text = json.dumps(root).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    chunks += struct.pack("<II", len(data), 0x004E4942) + data
    path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)


def sphere():
    ball = umbel.shapes.sphere(4)
    assert len(ball.positions) == 2562
    return ball


def xyz(*values):
    return np.array(values, np.float64)


def moved(mesh, by):
    """The mesh elsewhere: the same positions, and an origin."""
    return umbel.Mesh(mesh.positions.astype(np.float64) + by, mesh.triangles)


def distinct(points):
    return len(np.unique(points, axis=0))


def on_grid(mesh, step=2.0**-12):
    """Positions that float64 still holds exactly when they are moved far away."""
    return umbel.Mesh((np.round(mesh.positions / step) * step).astype(np.float32), mesh.triangles)


def translation(by):
    matrix = np.eye(4)
    matrix[:3, 3] = by
    return matrix


#: Round enough to be the origin of what is moved by it.
ROUND = np.array([2.0**19, 2.0**22, -(2.0**16)])
