"""A mesh as glTF's primitives: one vertex buffer, and a primitive for each run of triangles of the
same material. Values are written bit for bit, but for those that glTF forbids."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error
from umbel.geometry.mesh import Float32Array, Mesh, UInt32Array, any_tangents, area_weighted_normals
from umbel.io.gltf.arrays import UINT16, Arrays, Json
from umbel.io.gltf.skins import Skin, has_joints

_RUNS_PER_MATERIAL = 4
_UNIT = 0.004
"""How far a normal's length may be from one; Khronos's validator allows a little more."""
_WEIGHTS = 1e-6

MaterialOf = Callable[[int, int], int]
"""The number in the file of a material, for a mesh with so many sets of UVs."""


def write_primitives(
    arrays: Arrays, mesh: Mesh, material: MaterialOf, skin: Skin | None
) -> list[Json]:
    """The primitives of a mesh that has triangles. Joints are numbered as in the skin, or left
    out."""
    if int(mesh.triangles.max()) >= len(mesh.positions):
        raise Error("a triangle points beyond the vertices")
    attributes = _attributes(arrays, mesh)
    if skin is not None and has_joints(mesh):
        attributes |= _skin(arrays, mesh, skin)
    triangles, runs = _runs(mesh)
    view, kind, size = arrays.indices(triangles, len(mesh.positions))
    sets = 0 if mesh.uvs is None else 1 + len(mesh.uv_sets)
    primitives = []
    for start, stop, number in runs:
        accessor = arrays.accessor(view, kind, "SCALAR", 3 * (stop - start), 3 * start * size)
        primitive: Json = {"attributes": attributes, "indices": accessor}
        if number is not None:
            primitive["material"] = material(number, sets)
        primitives.append(primitive)
    return primitives


def _attributes(arrays: Arrays, mesh: Mesh) -> Json:
    attributes: Json = {"POSITION": arrays.attribute(mesh.positions, "VEC3")}
    entry = arrays.accessors[attributes["POSITION"]]
    finite = mesh.positions[np.isfinite(mesh.positions).all(axis=1)]
    corners = finite if len(finite) else np.zeros((1, 3), np.float32)
    entry["min"], entry["max"] = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    normals = None if mesh.normals is None else _normals(mesh, mesh.normals)
    for key, array, width in (
        ("NORMAL", normals, "VEC3"),
        ("TANGENT", None if mesh.tangents is None else _tangents(mesh.tangents, normals), "VEC4"),
        ("TEXCOORD_0", mesh.uvs, "VEC2"),
        ("COLOR_0", None if mesh.colors is None else _colors(mesh.colors), "VEC4"),
    ):
        if array is not None:
            attributes[key] = arrays.attribute(array, width)
    for k, uvs in enumerate(mesh.uv_sets):
        attributes[f"TEXCOORD_{k + 1}"] = arrays.attribute(uvs, "VEC2")
    return attributes


def _not_unit(vectors: Float32Array) -> NDArray[np.bool_]:
    with np.errstate(all="ignore"):
        off = np.abs(np.linalg.norm(vectors.astype(np.float64), axis=1) - 1)
    wrong: NDArray[np.bool_] = ~(off <= _UNIT)
    return wrong


def _normals(mesh: Mesh, normals: Float32Array) -> Float32Array:
    """The normals; those without a length get that of the triangles around, or any."""
    wrong = _not_unit(normals)
    if not wrong.any():
        return normals
    out = normals.copy()
    with np.errstate(all="ignore"):
        given = normals[wrong].astype(np.float64)
        out[wrong] = given / np.linalg.norm(given, axis=1, keepdims=True)
    wrong = _not_unit(out)
    if wrong.any():
        out[wrong] = area_weighted_normals(mesh.positions, mesh.triangles)[wrong]
        out[_not_unit(out)] = (0, 0, 1)
    return out


def _tangents(tangents: Float32Array, normals: Float32Array | None) -> Float32Array:
    wrong = _not_unit(tangents[:, :3])
    signs = np.abs(tangents[:, 3]) != 1
    if not (wrong.any() or signs.any()):
        return tangents
    out = tangents.copy()
    with np.errstate(all="ignore"):
        out[wrong, :3] /= np.linalg.norm(out[wrong, :3], axis=1, keepdims=True)
    wrong = _not_unit(out[:, :3])
    if wrong.any():
        around = np.tile(np.array([[0, 0, 1]], np.float32), (int(wrong.sum()), 1))
        out[wrong, :3] = any_tangents(around if normals is None else normals[wrong])[:, :3]
    out[signs, 3] = np.where(out[signs, 3] < 0, -1, 1)
    return out


def _colors(colors: Float32Array) -> Float32Array:
    inside: Float32Array = np.clip(np.nan_to_num(colors, nan=1.0), 0, 1)
    return inside


def _skin(arrays: Arrays, mesh: Mesh, skin: Skin) -> Json:
    assert mesh.joints is not None and mesh.weights is not None
    used = np.where(mesh.weights > 0, mesh.joints, np.uint32(0))
    if used.size and int(used.max()) >= len(skin.numbers):
        raise Error(f"a glTF file cannot hold the joint {int(used.max())}")
    joints, weights = _valid_weights(skin.numbers[used], mesh.weights)
    none = ~weights.any(axis=1)
    joints[none, 0], weights[none, 0] = skin.still, 1.0
    attributes: Json = {}
    for k in range(joints.shape[1] // 4):
        columns = slice(4 * k, 4 * k + 4)
        attributes[f"JOINTS_{k}"] = arrays.attribute(joints[:, columns], "VEC4", UINT16)
        attributes[f"WEIGHTS_{k}"] = arrays.attribute(weights[:, columns], "VEC4")
    return attributes


def _valid_weights(joints: UInt32Array, weights: Float32Array) -> tuple[UInt32Array, Float32Array]:
    """Weights that are not negative and add up to one, no joint twice in a vertex, and joints
    without a weight zero. What is so already keeps its bits."""
    weights = np.nan_to_num(np.clip(weights, 0, None), nan=0.0, posinf=0.0)
    joints = np.where(weights > 0, joints, np.uint32(0))
    for k in range(1, joints.shape[1]):
        for j in range(k):
            same = (weights[:, k] > 0) & (weights[:, j] > 0) & (joints[:, j] == joints[:, k])
            weights[same, j] += weights[same, k]
            weights[same, k] = 0
            joints[same, k] = 0
    total = weights.sum(axis=1, dtype=np.float64)
    wrong = (np.abs(total - 1) > _WEIGHTS) & (total > 0)
    weights[wrong] = (weights[wrong] / total[wrong, None]).astype(np.float32)
    return joints, weights


def _runs(mesh: Mesh) -> tuple[UInt32Array, list[tuple[int, int, int | None]]]:
    """The triangles, and ranges of them that have one material. They are put in order of material
    only where materials change too often for one primitive each run."""
    triangles, ids = mesh.triangles, mesh.material_ids
    if ids is None:
        return triangles, [(0, len(triangles), None)]
    if np.count_nonzero(np.diff(ids)) >= _RUNS_PER_MATERIAL * len(np.unique(ids)):
        order = np.argsort(ids, kind="stable")
        triangles, ids = triangles[order], ids[order]
    edges = [0, *(np.flatnonzero(np.diff(ids)) + 1).tolist(), len(ids)]
    known = len(mesh.materials)
    return triangles, [(a, b, int(ids[a]) if ids[a] < known else None) for a, b in pairwise(edges)]
