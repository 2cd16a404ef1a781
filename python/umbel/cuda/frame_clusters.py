"""Clusters of meshes that change every frame, on a CUDA device."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

from umbel.cluster.area_growth import AreaGrowth, RebuildPolicy
from umbel.cuda.arrays import current_stream, device_array
from umbel.cuda.c_structs import c_fields
from umbel.cuda.calls import (
    MeshStruct,
    Scratch,
    address,
    check,
    library,
    maker,
    mesh_struct,
    on_host,
    triangles_array,
)
from umbel.cuda.memory import given_back
from umbel.errors import Error

if TYPE_CHECKING:
    from umbel.cuda.cluster_bvh import ClusterBvh


class _Config(ctypes.Structure):
    _fields_ = c_fields(
        "uint32_t struct_size, method, max_triangles, min_triangles, max_vertices",
        "float underfill_cost",
        "uint32_t code_bits",
    )


class _Pointers(ctypes.Structure):
    """A struct of five pointers, or the first three of them."""

    _fields_ = tuple((name, ctypes.c_void_p) for name in "abcde")


METHODS = {"morton": 0, "hybrid": 1}


class FrameClusters:
    """Clusters of one mesh through its frames, on a device.

    positions: (n, 3) float32; rows may be apart, as in a vertex buffer. Arrays of NumPy are copied
        to the device, and where the first positions are one, `arrays` are copied back: both wait.
    triangles: (m, 3) uint32 or int32, contiguous.
    empty: makes an array: called with a shape and the name of a NumPy type, as in
        `lambda shape, dtype: cupy.empty(shape, dtype)`. By default it is made by the package of
        `positions`: CuPy, PyTorch or Numba.

    method, max_triangles, min_triangles, max_vertices, underfill_cost and code_bits are those of
    umbel.FrameClusters. Every method takes `stream`, an address; by default the current stream of
    the package of the positions.
    """

    def __init__(
        self,
        positions: Any,
        triangles: Any,
        method: str = "hybrid",
        *,
        max_triangles: int = 128,
        min_triangles: int = 0,
        max_vertices: int = 0,
        underfill_cost: float = 1.0,
        code_bits: int = 0,
        empty: Any = None,
        stream: int | None = None,
    ) -> None:
        if method not in METHODS:
            raise Error(f"method must be {' or '.join(map(repr, METHODS))}, not {method!r}")
        where = current_stream(positions) if stream is None else stream
        device_array(positions, "positions", ("f4",), 3, where)
        self._source = triangles_array(triangles, where)
        self._scratch = Scratch(empty or maker(positions), where)
        self._config = _Config(
            ctypes.sizeof(_Config),
            METHODS[method],
            max_triangles,
            min_triangles,
            max_vertices,
            underfill_cost,
            code_bits,
        )
        self._size = self._source.shape[0]
        most = ctypes.c_uint32()
        check(
            library().umbel_frame_max_clusters(
                ctypes.c_uint32(self._size), ctypes.byref(self._config), ctypes.byref(most)
            )
        )
        self._most = most.value
        self._arrays = self._make_arrays()
        self._next: dict[str, Any] | None = None
        self._now = self._scratch.make((max(self._most, 1),), "int64")
        self._total = self._scratch.make((2,), "int64")
        self.build(positions, stream=where)

    def build(self, positions: Any, *, stream: int | None = None) -> None:
        """Clusters of these positions alone."""
        where = current_stream(positions) if stream is None else stream
        self._build(self._mesh(positions, where), self._arrays, where)

    def update(self, positions: Any, *, stream: int | None = None) -> None:
        """As `build`, but triangles with equal codes keep the last frame's order."""
        where = current_stream(positions) if stream is None else stream
        mesh = self._mesh(positions, where)
        mesh.indices = address(self._arrays["triangles"])
        mesh.items = address(self._arrays["items"])
        other = self._next or self._make_arrays(where)
        self._build(mesh, other, where)
        self._arrays, self._next = other, self._arrays

    def refit(self, positions: Any, *, stream: int | None = None) -> None:
        """Keeps the clusters, computes their boxes again and measures the growth of the areas."""
        where = current_stream(positions) if stream is None else stream
        mesh = self._mesh(positions, where)
        self._call(
            "umbel_cuda_refit_frame_clusters",
            [ctypes.byref(mesh), ctypes.byref(self._config)],
            [self._clusters(self._arrays), self._shares(self._arrays)],
            where,
        )

    def rebuild_worst(self, positions: Any, clusters: int, *, stream: int | None = None) -> None:
        """Refits, and rebuilds up to `clusters` of those that have grown the most."""
        where = current_stream(positions) if stream is None else stream
        self.refit(positions, stream=where)
        mesh = self._mesh(positions, where)
        other = self._next or self._make_arrays(where)
        self._call(
            "umbel_cuda_rebuild_worst_frame_clusters",
            [ctypes.byref(mesh), ctypes.byref(self._config), ctypes.c_uint32(clusters)],
            [
                self._clusters(self._arrays),
                self._shares(self._arrays),
                self._clusters(other),
                self._shares(other),
            ],
            where,
        )
        self._arrays, self._next = other, self._arrays

    @property
    def arrays(self) -> dict[str, Any]:
        """The clusters, on the device: `items` (m,), `triangles` (m, 3), `offsets`, `boxes` and
        `count` (1,), how many of the offsets (and one more) and boxes there are. They change with
        the next call; integers are int32."""
        return {
            k: given_back(v, self._scratch.last) for k, v in self._arrays.items() if k != "at_build"
        }

    def bvh(self, positions: Any, builder: str = "lbvh", **options: Any) -> ClusterBvh:
        """A hierarchy with a subtree for every cluster, at these positions. Its `build` follows the
        clusters as they are then, in the stream of the call, and nothing waits."""
        from umbel.cuda.cluster_bvh import ClusterBvh

        return ClusterBvh(self, positions, builder, **options)

    @property
    def source(self) -> Any:
        """The mesh's triangles, as they were given or, from the host, copied."""
        return self._source.owner

    def as_arguments(self) -> tuple[ctypes.Structure, ctypes.Structure]:
        """What C functions take: umbel_frame_config and umbel_cuda_clusters, as they are now."""
        return self._config, self._clusters(self._arrays)

    @property
    def areas(self) -> Any:
        """(2,) int64 on the device: area ratios now and at the build, times 2^40."""
        return given_back(self._total, self._scratch.last)

    def area_growth(self) -> AreaGrowth:
        """As last measured. Waits for the device."""
        values = on_host(self._total, self._scratch.last)
        return AreaGrowth(float(values[0]) / 2**40, float(values[1]) / 2**40)

    def step(
        self,
        positions: Any,
        policy: RebuildPolicy,
        frames: int,
        *,
        stream: int | None = None,
    ) -> str:
        """Refits, asks the policy, `frames` after the last rebuild, and does what it says; tells
        what that was. Waits for the device, which measures."""
        self.refit(positions, stream=stream)
        action = policy.decide(self.area_growth(), frames)
        if action == "rebuild":
            self.update(positions, stream=stream)
        elif action == "rebuild_worst":
            count = int(on_host(self._arrays["count"], self._scratch.last)[0])
            worst = max(1, round(policy.budget * count))
            self.rebuild_worst(positions, worst, stream=stream)
        return action

    def _make_arrays(self, stream: int | None = None) -> dict[str, Any]:
        most, size = max(self._most, 1), max(self._size, 1)
        return {
            "items": self._scratch.make((size,), "int32", stream),
            "triangles": self._scratch.make((size, 3), "int32", stream),
            "offsets": self._scratch.make((most + 1,), "int32", stream),
            "boxes": self._scratch.make((most, 6), "float32", stream),
            "count": self._scratch.make((1,), "int32", stream),
            "at_build": self._scratch.make((most,), "int64", stream),
        }

    def _mesh(self, positions: Any, stream: int) -> MeshStruct:
        return mesh_struct(positions, self._source, stream)

    @staticmethod
    def _clusters(arrays: dict[str, Any]) -> _Pointers:
        names = ("items", "triangles", "offsets", "boxes", "count")
        return _Pointers(*(address(arrays[name]) for name in names))

    def _shares(self, arrays: dict[str, Any]) -> _Pointers:
        return _Pointers(
            address(self._now), address(arrays["at_build"]), address(self._total), None, None
        )

    def _build(self, mesh: MeshStruct, out: dict[str, Any], stream: int) -> None:
        self._call(
            "umbel_cuda_build_frame_clusters",
            [ctypes.byref(mesh), ctypes.byref(self._config)],
            [self._clusters(out)],
            stream,
        )
        self._call(
            "umbel_cuda_measure_frame_clusters",
            [ctypes.c_uint32(self._size), ctypes.byref(self._config)],
            [self._clusters(out), self._shares(out)],
            stream,
            ctypes.c_int(1),
        )

    def _call(
        self, name: str, head: list[Any], structs: list[_Pointers], stream: int, *more: Any
    ) -> None:
        self._scratch.call(name, *head, *(ctypes.byref(s) for s in structs), *more, stream=stream)
