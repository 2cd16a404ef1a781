"""Rays, closest points and overlaps of boxes by a hierarchy on a CUDA device."""

from __future__ import annotations

import ctypes
import math
from abc import ABC, abstractmethod
from typing import Any

from umbel.cuda.arrays import DeviceArray, current_stream, device_array
from umbel.cuda.c_structs import c_fields
from umbel.cuda.calls import Scratch, address, on_host
from umbel.cuda.memory import given_back
from umbel.errors import Error

ALL_BITS = 0xFFFFFFFF


class BvhStruct(ctypes.Structure):
    """umbel_cuda_bvh."""

    _fields_ = c_fields(
        "void* nodes, triangles, info",
    )


class _Rays(ctypes.Structure):
    _fields_ = c_fields(
        "void* origins, directions",
        "size_t origin_stride, direction_stride",
        "void* t_min, t_max",
        "size_t interval_stride",
        "uint64_t count",
        "uint32_t cull_back_faces, mask",
        "void* masks",
    )


class _Points(ctypes.Structure):
    _fields_ = c_fields(
        "void* points",
        "size_t stride",
        "uint64_t count",
        "float max_distance",
    )


class _Out(ctypes.Structure):
    """A struct of four pointers, or the first three of them."""

    _fields_ = tuple((name, ctypes.c_void_p) for name in "abcd")


class Queries(ABC):
    """What a hierarchy on a device answers. Queries are arrays on the device, answers are made by
    the package of the hierarchy's positions, and nothing waits, but where it says so. The answers
    are those of umbel.Bvh on the processor, bit by bit.

    Every method takes `stream`, an address; by default the current stream of the package of the
    queries.
    """

    _scratch: Scratch
    _masks: DeviceArray | None

    @abstractmethod
    def _struct(self) -> BvhStruct:
        """The hierarchy's arrays, as the C interface takes them."""

    def intersect(
        self,
        origins: Any,
        directions: Any,
        *,
        t_min: Any = None,
        t_max: Any = None,
        mask: int = ALL_BITS,
        cull_back_faces: bool = False,
        stream: int | None = None,
    ) -> dict[str, Any]:
        """The nearest hits of rays.

        origins, directions: (n, 3) float32; rows may be apart. Directions may have any length but
            0, and t counts in it.
        t_min, t_max: (n,) float32, contiguous; by default 0 and infinity.
        mask: sees triangles whose mask shares a bit with this.
        cull_back_faces: pass through triangles whose corners run clockwise.

        Returns `t` (n,), infinity where nothing is hit; `primitive` (n,) int32, -1 where nothing
        is; `uv` (n, 2), so that the hit is at (1 - u - v) p0 + u p1 + v p2.
        """
        where = current_stream(origins) if stream is None else stream
        rays = self._rays(origins, directions, t_min, t_max, where)
        rays.mask, rays.cull_back_faces = _bits(mask), cull_back_faces
        hits = {
            "t": self._made(where, rays.count, "float32"),
            "primitive": self._made(where, rays.count, "int32"),
            "uv": self._made(where, rays.count, "float32", 2),
        }
        self._query("umbel_cuda_intersect", rays, _addresses(hits), stream=where)
        return {name: given_back(array, where) for name, array in hits.items()}

    def occluded(
        self,
        origins: Any,
        directions: Any,
        *,
        t_min: Any = None,
        t_max: Any = None,
        mask: int = ALL_BITS,
        cull_back_faces: bool = False,
        stream: int | None = None,
    ) -> Any:
        """Whether rays hit anything: (n,) uint8, 1 or 0. Arguments as for `intersect`."""
        where = current_stream(origins) if stream is None else stream
        rays = self._rays(origins, directions, t_min, t_max, where)
        rays.mask, rays.cull_back_faces = _bits(mask), cull_back_faces
        results = self._made(where, rays.count, "uint8")
        self._query("umbel_cuda_occluded", rays, ctypes.c_void_p(address(results)), stream=where)
        return given_back(results, where)

    def closest_point(
        self, points: Any, *, max_distance: float = math.inf, stream: int | None = None
    ) -> dict[str, Any]:
        """The nearest points of the surface.

        points: (n, 3) float32; rows may be apart.
        max_distance: what is farther away is not found.

        Returns `point` (n, 3), `distance` (n,), infinity where nothing is near enough, `primitive`
        (n,) int32, -1 where nothing is, and `uv` (n, 2).
        """
        where = current_stream(points) if stream is None else stream
        given = device_array(points, "points", ("f4",), 3, where)
        count = given.shape[0]
        if not max_distance >= 0:
            raise Error(f"max_distance must be at least 0, not {max_distance}")
        found = {
            "point": self._made(where, count, "float32", 3),
            "distance": self._made(where, count, "float32"),
            "primitive": self._made(where, count, "int32"),
            "uv": self._made(where, count, "float32", 2),
        }
        points_struct = _Points(given.pointer, given.strides[0], count, max_distance)
        out = _addresses(found)
        self._query("umbel_cuda_closest_points", points_struct, out, stream=where)
        return {name: given_back(array, where) for name, array in found.items()}

    def overlaps(self, boxes: Any, *, stream: int | None = None) -> tuple[Any, Any]:
        """The triangles that touch boxes, exactly.

        boxes: (n, 6) float32, contiguous: lowest and highest corners.

        Returns offsets (n + 1,) and triangles, both int32: box i touches
        triangles[offsets[i] : offsets[i + 1]], ascending. Waits for the device, to know how much
        there is.
        """
        where = current_stream(boxes) if stream is None else stream
        given = device_array(boxes, "boxes", ("f4",), 6, where)
        if given.strides[0] != 24 and given.shape[0] > 1:
            raise Error("boxes must be contiguous")
        count = given.shape[0]
        offsets = self._made(where, count + 1, "int32")
        head = (
            ctypes.byref(self._struct()),
            ctypes.c_void_p(given.pointer),
            ctypes.c_uint32(count),
            ctypes.c_void_p(address(offsets)),
        )
        self._scratch.call("umbel_cuda_count_overlaps", *head, stream=where)
        total = int(on_host(offsets, where)[count])
        triangles = self._made(where, total, "int32")
        self._scratch.call(
            "umbel_cuda_list_overlaps",
            *head,
            ctypes.c_void_p(address(triangles)),
            ctypes.c_uint32(total),
            stream=where,
        )
        return given_back(offsets, where), given_back(triangles, where)

    def _rays(self, origins: Any, directions: Any, t_min: Any, t_max: Any, stream: int) -> _Rays:
        starts = device_array(origins, "origins", ("f4",), 3, stream)
        count = starts.shape[0]

        owners = [starts]

        def of_rays(given: Any, name: str, columns: int = 0) -> DeviceArray:
            array = device_array(given, name, ("f4",), columns, stream)
            if array.shape[0] != count:
                raise Error(f"there are {count} origins, but {array.shape[0]} {name}")
            owners.append(array)
            return array

        def ends(given: Any, name: str) -> int | None:
            return None if given is None else of_rays(given, name).pointer

        ways = of_rays(directions, "directions", 3)
        rays = _Rays(
            origins=starts.pointer,
            directions=ways.pointer,
            origin_stride=starts.strides[0],
            direction_stride=ways.strides[0],
            t_min=ends(t_min, "t_min"),
            t_max=ends(t_max, "t_max"),
            interval_stride=4,
            count=count,
            masks=None if self._masks is None else self._masks.pointer,
        )
        rays.owners = owners  # copies of what is on the host live as long as this
        return rays

    def _made(self, stream: int, count: int, dtype: str, columns: int = 0) -> Any:
        return self._scratch.answer((count, columns) if columns else (count,), dtype, stream)

    def _query(self, name: str, queries: ctypes.Structure, out: Any, stream: int) -> None:
        self._scratch.call(
            name, ctypes.byref(self._struct()), ctypes.byref(queries), out, stream=stream
        )


def _addresses(arrays: dict[str, Any]) -> Any:
    return ctypes.byref(_Out(*map(address, arrays.values())))


def _bits(mask: int) -> int:
    if not 0 <= mask <= ALL_BITS:
        raise Error(f"mask must have 32 bits, not {mask}")
    return mask
