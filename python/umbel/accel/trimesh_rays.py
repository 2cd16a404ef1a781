"""A ray object for trimesh: `mesh.ray = umbel.trimesh_rays(mesh)`.

It has the methods of trimesh's own ray objects, with the same arguments and results, so that
everything in trimesh that asks `mesh.ray` (`mesh.contains`, proximity, ...) uses Umbel.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel.accel.bvh import Bvh
from umbel.errors import Error

# Hits of one ray that are closer than this, times the mesh's size, are one: a ray through an edge
# meets both of its triangles. The figure is trimesh's.
_SAME_FACTOR = 1e-6
_SAME_FLOOR = 1e-8
_GRAZING = 1e-3  # sine of ray and plane below which their intersection says little


def trimesh_rays(mesh: Any, **options: Any) -> RayMeshIntersector:
    """The ray object of a `trimesh.Trimesh`; `options` are those of `umbel.Bvh`."""
    return RayMeshIntersector(mesh, **options)


class _Made(NamedTuple):
    """A hierarchy around the origin, where 32 bits hold most of what 64 did."""

    bvh: Bvh
    center: NDArray[np.float64]
    size: float
    """No less than the mesh's diagonal."""

    def cast(
        self, origins: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The rays in 32 bits. Those from afar start near the mesh, in 64 bits, and so stay
        exact."""
        starts = origins - self.center
        with np.errstate(all="ignore"):
            ahead = -np.einsum("ij,ij->i", starts, directions) - self.size
            starts += np.maximum(ahead, 0.0)[:, None] * directions
            return starts.astype(np.float32), directions.astype(np.float32)


class RayMeshIntersector:
    """Ray queries on a `trimesh.Trimesh`. Follows the mesh when it changes."""

    def __init__(self, geometry: Any, scale_to_box: bool = True, **options: Any) -> None:
        """
        geometry: a `trimesh.Trimesh`.
        scale_to_box: taken for compatibility; rays are watertight at any scale.
        options: of `umbel.Bvh`, such as builder and threads.
        """
        self.mesh = geometry
        self._scale_to_box = scale_to_box
        self._options = options
        self._made: tuple[int, _Made] | None = None

    def _bvh(self) -> _Made:
        """The hierarchy of the mesh as it is now."""
        state = hash(self.mesh)
        if self._made is None or self._made[0] != state:
            bounds = self.mesh.bounds
            box = np.zeros((2, 3)) if bounds is None else np.asarray(bounds, np.float64)
            center = box.mean(axis=0)
            positions = np.asarray(self.mesh.vertices, np.float64) - center
            bvh = Bvh(positions.astype(np.float32), np.asarray(self.mesh.faces), **self._options)
            self._made = (state, _Made(bvh, center, float(np.linalg.norm(box[1] - box[0]))))
        return self._made[1]

    def _rays(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        origins = np.asarray(ray_origins, dtype=np.float64)
        directions = np.asarray(ray_directions, dtype=np.float64)
        if origins.shape != directions.shape:
            raise Error("Ray origin and direction don't match!")
        if origins.size == 0:
            return origins.reshape(0, 3), directions.reshape(0, 3)
        if origins.ndim != 2 or origins.shape[1] != 3:
            raise Error(f"rays must have shape (n, 3), not {origins.shape}")
        lengths = np.linalg.norm(directions, axis=1, keepdims=True)
        with np.errstate(all="ignore"):
            unit = np.where(lengths > 0, directions / lengths, 0.0)
        return origins, unit

    def intersects_location(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        **kwargs: Any,
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        """Where rays hit the surface: locations (m, 3), index_ray (m,), index_tri (m,).

        Hits are sorted by ray, then by distance; those at one point of a ray are one."""
        index_tri, index_ray, locations = self.intersects_id(
            ray_origins,
            ray_directions,
            multiple_hits=multiple_hits,
            return_locations=True,
            **kwargs,
        )
        return locations, index_ray, index_tri

    def intersects_id(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        max_hits: int = 100,
        return_locations: bool = False,
    ) -> Any:
        """The triangles that rays hit: index_tri (m,), index_ray (m,) and, with
        `return_locations`, locations (m, 3). At most `max_hits` a ray, only the first without
        `multiple_hits`."""
        origins, directions = self._rays(ray_origins, ray_directions)
        made = self._bvh()
        bvh = made.bvh
        starts, ways = made.cast(origins, directions)
        if multiple_hits:
            index_tri, index_ray, u, v = self._all_hits(bvh, starts, ways, max_hits)
        else:
            hits = bvh.intersect(starts, ways)
            index_ray = np.flatnonzero(hits.hit)
            index_tri = hits.primitive[index_ray].astype(np.int64)
            u, v = hits.u[index_ray], hits.v[index_ray]
        if not return_locations:
            return index_tri, index_ray
        points = self._locations(origins[index_ray], directions[index_ray], index_tri, u, v)
        return index_tri, index_ray, points

    def _all_hits(
        self, bvh: Bvh, starts: NDArray[np.float32], ways: NDArray[np.float32], max_hits: int
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[Any], NDArray[Any]]:
        if max_hits <= 0:
            none = np.zeros(0, np.int64)
            return none, none, np.zeros(0), np.zeros(0)
        found = bvh.all_hits(starts, ways)
        ray = found.ray
        apart = np.ones(len(ray), bool)
        least = max(_SAME_FLOOR, _SAME_FACTOR * float(self.mesh.scale))
        apart[1:] = (ray[1:] != ray[:-1]) | (np.diff(found.t) > least)
        # The number of each hit among those of its ray that are kept.
        order = np.cumsum(apart) - 1
        first = found.offsets[:-1][found.counts > 0]
        number = order - np.repeat(order[first], found.counts[found.counts > 0])
        kept = np.flatnonzero(apart & (number < max_hits))
        return found.primitive[kept].astype(np.int64), ray[kept], found.u[kept], found.v[kept]

    def _locations(
        self,
        origins: NDArray[np.float64],
        directions: NDArray[np.float64],
        index_tri: NDArray[np.int64],
        u: NDArray[Any],
        v: NDArray[Any],
    ) -> NDArray[np.float64]:
        """Points of hits in double precision: on the ray and in the triangle's plane, but for
        grazing rays, whose points come from where in the triangle they are."""
        corners = np.asarray(self.mesh.vertices, np.float64)[np.asarray(self.mesh.faces)[index_tri]]
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        u64, v64 = (w.astype(np.float64)[:, None] for w in (u, v))
        inside = a + u64 * (b - a) + v64 * (c - a)
        normal = np.cross(b - a, c - a)
        steep = np.einsum("ij,ij->i", directions, normal)
        with np.errstate(all="ignore"):
            t = np.einsum("ij,ij->i", a - origins, normal) / steep
            plain = np.abs(steep) > _GRAZING * np.linalg.norm(normal, axis=1)
        on_plane = origins + np.where(plain, t, 0.0)[:, None] * directions
        points: NDArray[np.float64] = np.where(plain[:, None], on_plane, inside)
        return points

    def intersects_first(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, **_kwargs: Any
    ) -> NDArray[np.int64]:
        """(n,) the first triangle that each ray hits; -1 where none."""
        origins, directions = self._rays(ray_origins, ray_directions)
        made = self._bvh()
        return made.bvh.intersect(*made.cast(origins, directions)).primitive.astype(np.int64)

    def intersects_any(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, **_kwargs: Any
    ) -> NDArray[np.bool_]:
        """(n,) whether each ray hits the surface."""
        origins, directions = self._rays(ray_origins, ray_directions)
        made = self._bvh()
        return made.bvh.occluded(*made.cast(origins, directions))

    def contains_points(self, points: ArrayLike) -> NDArray[np.bool_]:
        """(n,) whether each of (n, 3) points is inside the mesh, which must be watertight."""
        array = np.asarray(points, dtype=np.float64)
        if array.ndim != 2 or array.shape[1] != 3:
            raise Error("points must be (n,3)")
        made = self._bvh()
        return made.bvh.contains(array - made.center)

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_made": None}

    def __copy__(self, *_args: Any) -> RayMeshIntersector:
        return RayMeshIntersector(self.mesh, self._scale_to_box, **self._options)

    __deepcopy__ = __copy__
