"""From anything that holds a mesh to the arrays that the library reads, without needless copies."""

from __future__ import annotations

import contextlib
import operator
import os
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel import _umbel
from umbel.errors import Error
from umbel.geometry.mesh import Material, Mesh, check_unmasked


def array_of(name: str, values: ArrayLike) -> NDArray[Any]:
    """`values` as an array of anything; umbel.Error if they are none, or some are masked."""
    try:
        array = np.asarray(values)
    except ValueError:
        raise Error(f"{name} must be an array, but its rows differ in length") from None
    check_unmasked(name, values)
    return array


def numbers(name: str, values: ArrayLike) -> NDArray[Any]:
    """`values` as an array of real numbers; umbel.Error if they are none."""
    array = array_of(name, values)
    if array.dtype.kind not in "fiub":
        raise Error(f"{name} must hold numbers, not {array.dtype}")
    return array


def rows(name: str, values: ArrayLike, columns: int) -> NDArray[np.float32]:
    """`values` as contiguous float32 (n, columns); umbel.Error if that is not its shape."""
    array = numbers(name, values)
    with np.errstate(over="ignore"):  # too large for float32 becomes inf, which validation names
        array = np.ascontiguousarray(array, dtype=np.float32)
    if array.size == 0:
        return array.reshape(0, columns)
    if array.ndim != 2 or array.shape[1] != columns:
        raise Error(f"{name} must have shape (n, {columns}), not {array.shape}")
    return array


def indices(name: str, values: ArrayLike, columns: int = 0) -> NDArray[np.uint32]:
    """`values` as contiguous uint32 (n,), or (n, columns); negative or huge ones raise."""
    array = array_of(name, values)
    if array.size == 0:
        return np.empty((0, columns) if columns else (0,), np.uint32)
    if array.ndim != (2 if columns else 1) or (columns and array.shape[1] != columns):
        raise Error(
            f"{name} must have shape (n,{f' {columns}' if columns else ''}), not {array.shape}"
        )
    if array.dtype.kind not in "iu":
        raise Error(f"{name} must be integers, not {array.dtype}")
    if array.dtype.kind == "i" or array.dtype.itemsize > 4:
        wrong = np.flatnonzero((array < 0) | (array > 0xFFFFFFFE))
        if wrong.size:
            row = int(wrong[0]) // max(columns, 1)
            raise Error(f"{name}[{row}] holds {array.flat[wrong[0]]}, which is out of range")
    return np.ascontiguousarray(array, dtype=np.uint32)


def whole(name: str, value: int, most: int = 0xFFFFFFFF) -> int:
    """`value` as a whole number from 0 to `most`; umbel.Error if it is none."""
    try:
        number = operator.index(value)
    except TypeError:
        raise Error(f"{name} must be a whole number, not {value!r}") from None
    if not 0 <= number <= most:
        raise Error(f"{name} must be from 0 to {most}, not {number}")
    return number


def number(name: str, value: Any) -> float:
    """`value` as a number; umbel.Error if it is none."""
    if not isinstance(value, (int, float, np.number)):
        raise Error(f"{name} must be a number, not {value!r}")
    return float(value)


def thread_count(threads: int) -> int:
    return whole("threads", threads)


def configure(config: Any, options: Mapping[str, Any]) -> None:
    """Sets those of the library's settings that are not None; umbel.Error names one whose value has
    the wrong type."""
    for name, value in options.items():
        if value is None:
            continue
        try:
            setattr(config, name, value)
        except (TypeError, RuntimeError):
            raise Error(f"{name} cannot be {value!r}") from None


def as_mesh(source: Any, allow_outside: bool = False) -> Mesh:
    """A Mesh from a Mesh, a file's path (see `umbel.load`), anything with .vertices and .faces such
    as a trimesh.Trimesh, or a pair (positions, triangles)."""
    if isinstance(source, (str, os.PathLike)):
        from umbel.io import load

        return load(source, allow_outside=allow_outside)
    return Mesh.from_any(source)


def native(mesh: Mesh) -> _umbel.MeshArrays:
    """The mesh as the library sees it. The arrays are shared, not copied, where types fit."""

    def optional(name: str, columns: int) -> NDArray[np.float32] | None:
        values = getattr(mesh, name)
        return None if values is None else rows(name, values, columns)

    extras, values = extras_of(mesh)
    return _umbel.MeshArrays(
        rows("positions", mesh.positions, 3),
        indices("triangles", mesh.triangles, 3),
        normals=optional("normals", 3),
        tangents=optional("tangents", 4),
        uvs=optional("uvs", 2),
        colors=optional("colors", 4),
        materials=None if mesh.material_ids is None else indices("material_ids", mesh.material_ids),
        extras=extras,
        extra_values=values,
    )


@contextlib.contextmanager
def about(mesh: Mesh, remedy: str = "") -> Iterator[None]:
    """What is done with a mesh: refusals of it name its file, and the line where an OBJ file names
    a vertex that is not there, and end with the remedy."""
    try:
        yield
    except Error as error:
        if error.code != "invalid_mesh":
            raise
        sentence = str(error)
        if mesh.fault and _BEYOND in sentence:
            sentence = mesh.fault
        elif mesh.source and mesh.source not in sentence:
            sentence = f"{mesh.source}: {sentence}"
        named = Error(f"{sentence}; {remedy}" if remedy else sentence)
        named.code = error.code
        raise named from None


#: How the library's sentence about a vertex that is not there goes.
_BEYOND = "is out of range, the mesh has"

_UVS, _JOINTS, _WEIGHTS = 4, 16, 32


def extras_of(mesh: Mesh) -> tuple[list[tuple[int, int]], NDArray[np.float32] | None]:
    """Further texture coordinates, joints and weights as the library sees them: (kind, set) of each
    of them, and the values of all, a vertex after the other."""
    extras = [(_UVS, k + 1) for k in range(len(mesh.uv_sets))]
    columns: list[NDArray[Any]] = [rows("uv_sets", uvs, 2) for uvs in mesh.uv_sets]
    for k, uvs in enumerate(columns):
        if len(uvs) != len(mesh.positions):
            raise Error(
                f"uv_sets[{k}] must have one row a vertex, {len(mesh.positions)}, not {len(uvs)}"
            )
    for kind, values in ((_JOINTS, mesh.joints), (_WEIGHTS, mesh.weights)):
        if values is not None:
            if kind == _JOINTS:
                check_joints(values)
            extras += [(kind, k) for k in range(values.shape[1] // 4)]
            columns.append(values.astype(np.float32))
    if not columns:
        return [], None
    return extras, np.ascontiguousarray(np.concatenate(columns, axis=1)).reshape(-1)


def check_joints(joints: NDArray[Any]) -> None:
    """Raises where a number is none that a float holds."""
    if joints.size and int(joints.max()) > 1 << 24:
        raise Error(f"joints has the joint {int(joints.max())}, at most {1 << 24} is possible")


def _from_extras(arrays: dict[str, Any]) -> dict[str, Any]:
    """The fields of a Mesh instead of `extras` and `extra_values`."""
    extras, values = arrays.pop("extras", []), arrays.pop("extra_values", None)
    if not extras:
        return arrays
    widths = [2 if kind == _UVS else 1 if kind > _WEIGHTS else 4 for kind, _ in extras]
    table = values.reshape(len(arrays["positions"]), sum(widths))
    parts = np.split(table, np.cumsum(widths)[:-1], axis=1)
    found = {
        kind: [part for (k, _), part in zip(extras, parts, strict=True) if k == kind]
        for kind in (_UVS, _JOINTS, _WEIGHTS)
    }
    arrays["uv_sets"] = found[_UVS]
    if found[_JOINTS] and len(found[_JOINTS]) == len(found[_WEIGHTS]):
        arrays["joints"] = np.concatenate(found[_JOINTS], axis=1).clip(0).astype(np.uint32)
        arrays["weights"] = np.concatenate(found[_WEIGHTS], axis=1)
    return arrays


def mesh_of(
    arrays: dict[str, Any],
    materials: list[Material],
    name: str = "",
    origin: NDArray[np.float64] | None = None,
) -> Mesh:
    """A Mesh from the library's arrays, whose `materials` are a number a triangle."""
    ids = arrays.pop("materials", None)
    if ids is not None and not materials and not ids.any():
        ids = None  # one material that nothing is known of is no material
    elif ids is None and materials:
        ids = np.zeros(len(arrays["triangles"]), np.uint32)
    mesh = Mesh(**_from_extras(arrays), material_ids=ids, materials=materials, name=name)
    if origin is not None:
        mesh.origin = origin.copy()
    return mesh


def check_affine(name: str, matrices: NDArray[Any]) -> None:
    """Refuses (..., 4, 4) matrices with another last row: those of row vectors have the translation
    there, which would be lost."""
    if matrices.shape[-2:] == (4, 4) and (matrices[..., 3, :] != (0, 0, 0, 1)).any():
        raise Error(f"the last row of {name} must be 0, 0, 0, 1")
