"""The triangle mesh that every part of the package takes and gives, as NumPy arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel.errors import Error
from umbel.geometry.origin import Rounding, localize, origin_of, rounding_loss, zero_origin

if TYPE_CHECKING:
    from umbel.geometry.camera import Camera
    from umbel.io.textures.images import TextureImage

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
UInt32Array = NDArray[np.uint32]

_UINT32_MAX = 0xFFFFFFFF


@dataclass
class Material:
    """What a surface is made of: glTF's metallic-roughness model, and what extends it.

    `textures` maps a slot ("base_color", "metallic_roughness", "normal", "occlusion", "emissive")
    to how the file uses the image: `texCoord`, `scale` or `strength`, and `extensions` such as
    KHR_texture_transform; `images` maps it to the image itself. `extensions` is glTF's JSON as it
    is in the file; textures in it are slots too, named "KHR_materials_sheen/sheenColorTexture".
    KHR_materials_emissive_strength is a part of `emissive`.
    """

    name: str = ""
    base_color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)  #: linear RGBA
    metallic: float = 0.0  #: 0 dielectric to 1 metal
    roughness: float = 1.0  #: perceptual, 0 mirror to 1 matte
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)  #: linear RGB, may exceed 1
    double_sided: bool = False
    alpha_mode: str = "OPAQUE"  #: OPAQUE, MASK or BLEND
    alpha_cutoff: float = 0.5  #: used by MASK
    textures: dict[str, dict[str, Any]] = field(default_factory=dict)
    images: dict[str, TextureImage] = field(default_factory=dict, repr=False)
    extensions: dict[str, Any] = field(default_factory=dict)  #: of glTF, by their names
    extras: Any = None  #: what the file's author keeps with it, as JSON


@dataclass(eq=False)
class Mesh:
    """A triangle mesh. Arrays are C-contiguous; an attribute that is absent is None.

    A vertex is at `origin + positions[i]`: where the world's coordinates are too large for float32
    (maps, Earth-centred scans), positions are relative to an origin near them. Where `positions`
    are given in float64 with no origin, the mesh gets one if it needs it (`umbel.localize`).

    Positions are in the file's own units, right-handed; corners run counter-clockwise seen from
    outside. UVs are as the file stores them: glTF puts v = 0 at the image's top, OBJ and PLY at
    its bottom. Colours of PLY and OBJ, which are sRGB, become linear. Integer colours of arrays are
    divided by their type's largest value, nothing else.

    Nothing here checks *values*: indices may point beyond the vertices and positions may be NaN
    until `umbel.validate` says otherwise. Shapes and types are checked on construction.
    """

    positions: Float32Array  #: (n, 3) float32, relative to `origin`
    triangles: UInt32Array  #: (m, 3) uint32, vertex indices
    normals: Float32Array | None = None  #: (n, 3) float32, unit length where known
    tangents: Float32Array | None = None  #: (n, 4) float32, w = -1 or 1 as in glTF
    uvs: Float32Array | None = None  #: (n, 2) float32, first set
    colors: Float32Array | None = None  #: (n, 4) float32, linear RGBA in [0, 1]
    material_ids: UInt32Array | None = None  #: (m,) uint32, index into `materials`
    uv_sets: list[Float32Array] = field(default_factory=list)  #: the second set and on, like `uvs`
    joints: UInt32Array | None = None  #: (n, 4 k) uint32, joints that move a vertex
    weights: Float32Array | None = None  #: (n, 4 k) float32, how much each of `joints` does
    materials: list[Material] = field(default_factory=list)
    name: str = ""
    cameras: list[Camera] = field(default_factory=list)  #: perspective cameras of the file
    origin: Float64Array = field(default_factory=zero_origin)  #: (3,) float64, mostly zero
    #: what is known of the world's coordinates: "unit", "up", "crs"
    coordinates: dict[str, str] = field(default_factory=dict)
    extras: Any = None  #: what the file's author keeps with it, as JSON
    #: the nodes around it, skins, cameras, lights, extras and copyright, as `Asset.scene` has them
    tree: dict[str, Any] = field(default_factory=dict)
    source: str = ""  #: the file that it was read from, for messages
    fault: str = ""  #: where that file first names a vertex that is not there, for messages
    rounding: Rounding = field(default_factory=Rounding)  #: what float32 positions lost so far

    def __post_init__(self) -> None:
        self.origin = origin_of(self.origin)
        self.triangles = _triangles(self.triangles)
        self._take_positions()
        n = len(self.positions)
        self.normals = _optional(self.normals, n, 3, "normals")
        self.tangents = _optional(self.tangents, n, 4, "tangents")
        self.uvs = _optional(self.uvs, n, 2, "uvs")
        self.colors = _colors(self.colors, n)
        self.uv_sets = [_row_each(uvs, n, 2, "uv_sets") for uvs in self.uv_sets]
        self._check_skin(n)
        if self.material_ids is not None:
            ids = _indices(_array(self.material_ids, "material_ids"), "material_ids")
            if ids.shape != (len(self.triangles),):
                raise Error(
                    f"material_ids must have one entry a triangle, shape "
                    f"({len(self.triangles)},), not {ids.shape}"
                )
            self.material_ids = ids

    def _take_positions(self) -> None:
        array = _table(self.positions, 3, "positions")
        # float32 holds every value of these types.
        if array.dtype.itemsize <= 2 or array.dtype == np.float32:
            self.positions = np.ascontiguousarray(array, np.float32)
            return
        world, around = array, zero_origin()
        if self.origin.any():
            with np.errstate(over="ignore"):
                self.positions = np.ascontiguousarray(array, np.float32)
        else:
            self.origin, self.positions = localize(array, self.triangles)
            around = self.origin
        self.rounding += rounding_loss(world, around, self.positions, self.triangles)

    def _check_skin(self, n: int) -> None:
        if (self.joints is None) != (self.weights is None):
            raise Error("joints and weights belong together, but only one of them is given")
        if self.joints is None:
            return
        self.joints = np.ascontiguousarray(_indices(_array(self.joints, "joints"), "joints"))
        columns = self.joints.shape[1] if self.joints.ndim == 2 else 0
        if columns == 0 or columns % 4 or len(self.joints) != n:
            raise Error(
                f"joints must have one row a vertex of 4, 8, ... numbers, not shape "
                f"{self.joints.shape}"
            )
        self.weights = _optional(self.weights, n, columns, "weights")

    @property
    def world_positions(self) -> Float64Array:
        """(n, 3) float64: origin + positions."""
        return self.origin + self.positions

    @property
    def vertices(self) -> Float32Array | Float64Array:
        """The vertices in the world, under trimesh's name: `positions` where there is no origin,
        else `world_positions`."""
        return self.world_positions if self.origin.any() else self.positions

    @property
    def faces(self) -> UInt32Array:
        """`triangles`, under trimesh's name."""
        return self.triangles

    @property
    def bounds(self) -> Float32Array | Float64Array | None:
        """(2, 3) least and greatest corner of the vertices that triangles use, in the world, or
        None. In float64 where there is an origin."""
        used = self.triangles[(self.triangles < len(self.positions)).all(axis=1)]
        if not len(used):
            return None
        mask = np.zeros(len(self.positions), bool)
        mask[used.reshape(-1)] = True
        points = self.positions[mask]
        box = np.stack([points.min(axis=0), points.max(axis=0)])
        return self.origin + box if self.origin.any() else box

    def __repr__(self) -> str:
        extras = [
            k for k in ("normals", "tangents", "uvs", "colors") if getattr(self, k) is not None
        ]
        if self.uv_sets:
            extras.append(f"{len(self.uv_sets)} more uvs")
        if self.joints is not None:
            extras.append("joints")
        if self.material_ids is not None:
            extras.append(f"{len(self.materials)} materials")
        name = f" {self.name!r}" if self.name else ""
        tail = f", {', '.join(extras)}" if extras else ""
        return (
            f"<Mesh{name}: {len(self.triangles)} triangles, {len(self.positions)} vertices{tail}>"
        )

    @staticmethod
    def from_any(obj: Any) -> Mesh:
        """Takes a Mesh (given back as it is), a `trimesh.Trimesh`, anything with `.vertices` and
        `.faces`, or a pair (positions, triangles), and gives a Mesh. Arrays that already have the
        right type and layout are not copied."""
        if isinstance(obj, Mesh):
            return obj
        if hasattr(obj, "vertices") and hasattr(obj, "faces"):
            return _from_trimesh_like(obj)
        if isinstance(obj, (tuple, list)) and len(obj) == 2:
            return Mesh(obj[0], obj[1])
        if hasattr(obj, "flatten") and hasattr(obj, "instances"):
            return Mesh.from_any(obj.flatten())
        raise Error(
            f"expected a Mesh, a trimesh.Trimesh, an object with .vertices and .faces, or a pair "
            f"(positions, triangles), not {type(obj).__name__}"
        )


def area_weighted_normals(positions: Float32Array, triangles: UInt32Array) -> Float32Array:
    """(n, 3) float32 unit vertex normals: the mean of the normals of the triangles around, each
    weighted by its area. Zero where a vertex has no triangle, or only flat ones. Triangles that
    point beyond the vertices count for nothing."""
    n = len(positions)
    inside = triangles[(triangles < n).all(axis=1)]
    points = positions.astype(np.float64)
    a, b, c = (points[inside[:, k]] for k in range(3))
    with np.errstate(all="ignore"):
        cross = np.cross(b - a, c - a)
        corners = inside.T.reshape(-1)
        total = np.empty((n, 3))
        for axis in range(3):
            total[:, axis] = np.bincount(corners, np.tile(cross[:, axis], 3), minlength=n)
    return normalized(total)


def normalized(vectors: NDArray[Any]) -> Float32Array:
    """(n, 3) float32 vectors of length one; zero and non-finite ones become zero."""
    v = np.asarray(vectors, np.float64)
    with np.errstate(all="ignore"):
        largest = np.abs(v).max(axis=1, keepdims=True, initial=0.0)
        v = v / largest
        v = v / np.sqrt((v * v).sum(axis=1, keepdims=True))
    v[~np.isfinite(v).all(axis=1)] = 0.0
    out: Float32Array = v.astype(np.float32)
    return out


def unit_normals(normals: Float32Array) -> Float32Array:
    """The normals, those whose length is off by over a hundredth (scanners write sums of face
    normals) made unit length. Zero and non-finite ones stay, and so does every bit of the rest."""
    with np.errstate(all="ignore"):
        length = np.sqrt((normals.astype(np.float64) ** 2).sum(axis=1))
        wrong = np.flatnonzero((np.abs(length - 1.0) > 0.01) & (length > 0) & np.isfinite(length))
    if not len(wrong):
        return normals
    out = normals.copy()
    out[wrong] = normalized(normals[wrong])
    return out


def any_tangents(normals: Float32Array) -> Float32Array:
    """(n, 4) float32 tangents that fit the normals and nothing more, for vertices whose source
    gives none: unit length, at a right angle to the normal, w = 1."""
    out = np.zeros((len(normals), 4), np.float32)
    axis = np.eye(3)[np.argmin(np.abs(normals), axis=1)] if len(normals) else np.zeros((0, 3))
    out[:, :3] = normalized(np.cross(axis, normals.astype(np.float64)))
    out[~out[:, :3].any(axis=1), 0] = 1.0
    out[:, 3] = 1.0
    return out


def uv_tangents(
    positions: Float32Array, triangles: UInt32Array, normals: Float32Array, uvs: Float32Array
) -> Float32Array:
    """(n, 4) float32 tangents along growing u, as normal maps of glTF need them (Lengyel 2001):
    means over the triangles around; any that fit the normal where those give none."""
    out = any_tangents(normals)
    if not len(triangles):
        return out
    a, b, c = (positions[triangles[:, k]].astype(np.float64) for k in range(3))
    (u1, v1), (u2, v2) = ((uvs[triangles[:, k]] - uvs[triangles[:, 0]]).T for k in (1, 2))
    with np.errstate(all="ignore"):
        turn = np.sign(u1.astype(np.float64) * v2 - u2.astype(np.float64) * v1)
        along_u = ((b - a) * v2[:, None] - (c - a) * v1[:, None]) * turn[:, None]
        along_v = ((c - a) * u1[:, None] - (b - a) * u2[:, None]) * turn[:, None]
        corners = triangles.reshape(-1)
        sums = np.zeros((2, len(normals), 3))
        for total, values in zip(sums, (along_u, along_v), strict=True):
            for axis in range(3):
                weights = np.repeat(np.nan_to_num(values[:, axis]), 3)
                total[:, axis] = np.bincount(corners, weights, len(normals))
        normal = normals.astype(np.float64)
        tangent = sums[0] - normal * np.sum(normal * sums[0], axis=1, keepdims=True)
        tangent = normalized(tangent)
        # v grows downwards in an image, the bitangent upwards.
        mirrored = np.sum(np.cross(normal, tangent) * sums[1], axis=1) > 0
    known = tangent.any(axis=1)
    out[known, :3] = tangent[known]
    out[known, 3] = np.where(mirrored[known], -1.0, 1.0)
    return out


def to_uint32(indices: NDArray[Any]) -> UInt32Array:
    """Indices of any number type as uint32. What is negative, fractional or too large becomes an
    index that no mesh has, so that validation names it instead of a wrong vertex being used."""
    if indices.dtype == np.uint32:
        return np.ascontiguousarray(indices)
    if indices.dtype.kind == "u" and indices.dtype.itemsize < 4:
        return indices.astype(np.uint32)
    if indices.dtype.kind == "i" and indices.dtype.itemsize == 4:
        native = np.ascontiguousarray(indices, dtype=np.int32)
        return native.view(np.uint32)
    with np.errstate(invalid="ignore"):
        good = (indices >= 0) & (indices <= _UINT32_MAX)
        if indices.dtype.kind == "f":
            good &= indices == np.floor(indices)
        out: UInt32Array = np.where(good, indices, 0).astype(np.uint32)
    out[~good] = _UINT32_MAX
    return out


def to_unit_floats(values: NDArray[Any]) -> Float32Array:
    """Integers divided by their type's largest value (never below -1), floats as they are."""
    if values.dtype.kind == "f":
        return values.astype(np.float32)
    largest = np.iinfo(values.dtype).max
    if values.dtype.itemsize < 4:
        out = values.astype(np.float32) / np.float32(largest)
    else:
        out = (values / float(largest)).astype(np.float32)
    return np.maximum(out, np.float32(-1.0)) if values.dtype.kind == "i" else out


def _array(value: ArrayLike, what: str) -> NDArray[Any]:
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise Error(f"{what} cannot be made an array: {error}") from None
    check_unmasked(what, value)
    if array.size == 0:
        array = array.astype(np.float32) if array.dtype == object else array
    if array.dtype.kind not in "fiub":
        raise Error(f"{what} must hold numbers, not {array.dtype}")
    return array


def check_unmasked(what: str, value: Any) -> None:
    """Raises where values are masked: in a plain array they would be taken for good ones."""
    if hasattr(value, "mask") and np.ma.is_masked(value):  # numpy.ma takes time to import
        raise Error(f"{what} must have no masked values: fill them, or leave them out")


def _table(value: ArrayLike, columns: int, what: str) -> NDArray[Any]:
    array = _array(value, what)
    if array.size == 0:
        array = array.reshape(0, columns)
    if array.ndim != 2 or array.shape[1] != columns:
        raise Error(f"{what} must have shape (n, {columns}), not {array.shape}")
    return array


def _floats(value: ArrayLike, columns: int, what: str) -> Float32Array:
    array = _table(value, columns, what)
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(array, dtype=np.float32)


def _optional(value: Any, n: int, columns: int, what: str) -> Float32Array | None:
    return None if value is None else _row_each(value, n, columns, what)


def _row_each(value: Any, n: int, columns: int, what: str) -> Float32Array:
    array = _floats(value, columns, what)
    if len(array) != n:
        raise Error(f"{what} must have one row a vertex: {n}, not {len(array)}")
    return array


def _colors(value: Any, n: int) -> Float32Array | None:
    if value is None:
        return None
    array = _array(value, "colors")
    if array.dtype.kind in "iu" and array.ndim == 2:
        array = to_unit_floats(array)
    if array.ndim == 2 and array.shape[1] == 3:
        array = np.concatenate([array, np.ones((len(array), 1), array.dtype)], axis=1)
    return _optional(array, n, 4, "colors")


def _indices(array: NDArray[Any], what: str) -> UInt32Array:
    if array.size == 0:
        return array.astype(np.uint32)
    if array.dtype.kind not in "iu":
        raise Error(f"{what} must hold integers, not {array.dtype}")
    if array.dtype.kind == "i" or array.dtype.itemsize > 4:
        low, high = int(array.min()), int(array.max())
        if low < 0 or high > _UINT32_MAX:
            bad = low if low < 0 else high
            where = np.argwhere(array == bad)[0].tolist()
            raise Error(f"{what}{where} is {bad}, which is no index")
    return np.ascontiguousarray(array, dtype=np.uint32)


def _triangles(value: ArrayLike) -> UInt32Array:
    array = _indices(_array(value, "triangles"), "triangles")
    if array.size == 0:
        array = array.reshape(0, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise Error(f"triangles must have shape (m, 3), not {array.shape}")
    return array


def _from_trimesh_like(obj: Any) -> Mesh:
    n = len(obj.vertices)
    visual = getattr(obj, "visual", None)
    uvs = getattr(visual, "uv", None)
    colors = None
    if visual is not None and getattr(visual, "kind", None) == "vertex":
        colors = np.asarray(visual.vertex_colors)
    normals = None
    # trimesh computes vertex normals when asked; only those that it was given are taken.
    if "vertex_normals" in getattr(obj, "_cache", ()):
        normals = np.asarray(obj.vertex_normals)
    mesh = Mesh(
        obj.vertices,
        obj.faces,
        normals=normals if normals is not None and np.shape(normals) == (n, 3) else None,
        uvs=uvs if uvs is not None and np.shape(uvs) == (n, 2) else None,
        colors=colors if colors is not None and len(colors) == n else None,
    )
    metadata = getattr(obj, "metadata", None)
    if isinstance(metadata, dict):
        mesh.name = str(metadata.get("name", "") or "")
    return mesh
