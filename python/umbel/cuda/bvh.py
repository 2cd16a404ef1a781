"""Hierarchies of triangles, built on a CUDA device."""

from __future__ import annotations

import ctypes
import struct
from dataclasses import dataclass
from typing import Any

from umbel.cuda.arrays import current_stream, device_array
from umbel.cuda.c_structs import c_fields
from umbel.cuda.calls import (
    INTEGERS,
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
from umbel.cuda.rays import BvhStruct, Queries
from umbel.errors import Error

NODE_BYTES = 80
TRIANGLE_BYTES = 48


class _Config(ctypes.Structure):
    _fields_ = c_fields(
        "uint32_t struct_size, builder",
        "float traversal_cost, intersection_cost",
        "uint32_t max_leaf_size",
        "float presplit",
        "uint32_t hlbvh_bits, treelet_size, treelet_rounds, ploc_radius, kmeans_clusters",
        "uint32_t kmeans_candidates, kmeans_iterations, kmeans_manhattan",
        "uint32_t kmeans_forwarded_clusters",
    )


@dataclass(frozen=True)
class BvhInfo:
    """What holds of a whole tree."""

    nodes: int
    triangles: int
    """In leaves; with presplit a triangle may be there repeatedly."""
    bounds: tuple[tuple[float, float, float], tuple[float, float, float]]
    sah_cost: float
    """Of the binary tree that the nodes were made of."""


class Bvh(Queries):
    """A hierarchy over one mesh, on a device: 8 children a node, in 80 bytes.

    positions: (n, 3) float32; rows may be apart, as in a vertex buffer. They are not checked;
        triangles with a NaN or an infinite corner are never hit. Arrays of NumPy are copied to the
        device, and where these are one, all answers are copied back: both wait.
    triangles: (m, 3) uint32 or int32, contiguous.
    builder: "lbvh", "hlbvh", "atrbvh", "ploc", "hploc", "kmeans", "kmeans-q1" to "kmeans-q5" or
        "sweep". Those of "ploc" and "kmeans" wait for the stream while they build; the others do
        not.
    settings: of the builder, by the names of umbel_cuda_bvh_config in umbel_cuda_bvh.h, such as
        max_leaf_size (1 to 8), presplit (0 to 1) or ploc_radius.
    masks: (m,) uint32 or int32, bits of each triangle; rays see those that share a bit with their
        mask. By default all bits are set. Not copied: a later ray sees what was written since.
    empty: makes an array: called with a shape and the name of a NumPy type, as in
        `lambda shape, dtype: cupy.empty(shape, dtype)`. By default it is made by the package of
        `positions`: CuPy, PyTorch or Numba.

    Every method takes `stream`, an address; by default the current stream of the package of the
    positions.
    """

    def __init__(
        self,
        positions: Any,
        triangles: Any,
        builder: str = "hploc",
        *,
        masks: Any = None,
        empty: Any = None,
        stream: int | None = None,
        **settings: float,
    ) -> None:
        where = current_stream(positions) if stream is None else stream
        self._source = triangles_array(triangles, where)
        mesh = mesh_struct(positions, self._source, where)
        self._masks = None
        if masks is not None:
            self._masks = device_array(masks, "masks", INTEGERS, 0, where)
            if self._masks.shape[0] != self._source.shape[0]:
                raise Error(
                    f"there are {self._source.shape[0]} triangles, but {self._masks.shape[0]} masks"
                )
        self._config = _Config()
        check(
            library().umbel_cuda_bvh_config_init_sized(
                ctypes.byref(self._config),
                ctypes.c_size_t(ctypes.sizeof(self._config)),
                str(builder).encode(),
            )
        )
        self._config = _changed(self._config, settings)
        nodes, references = ctypes.c_uint32(), ctypes.c_uint32()
        check(
            library().umbel_cuda_bvh_capacity(
                ctypes.c_uint32(self._source.shape[0]),
                ctypes.byref(self._config),
                ctypes.byref(nodes),
                ctypes.byref(references),
            )
        )
        self._scratch = Scratch(empty or maker(positions), where)
        make = self._scratch.make
        self._arrays = {
            "nodes": make((nodes.value, NODE_BYTES), "uint8"),
            "triangles": make((max(references.value, 1), TRIANGLE_BYTES), "uint8"),
            "info": make((40,), "uint8"),
        }
        self._build(mesh, where)

    def build(self, positions: Any, *, stream: int | None = None) -> None:
        """Builds again, for other positions of as many vertices."""
        where = current_stream(positions) if stream is None else stream
        self._build(mesh_struct(positions, self._source, where), where)

    def refit(self, positions: Any, *, stream: int | None = None) -> None:
        """Keeps the nodes, and makes their boxes for other positions."""
        where = current_stream(positions) if stream is None else stream
        self._call("umbel_cuda_refit_bvh", mesh_struct(positions, self._source, where), where)

    @property
    def arrays(self) -> dict[str, Any]:
        """The tree, on the device, as bytes: `nodes` (room, 80), `triangles` (references, 48) and
        `info` (40,). compact_bvh.hpp describes them."""
        return {k: given_back(v, self._scratch.last) for k, v in self._arrays.items()}

    def info(self) -> BvhInfo:
        """What is said of the whole tree. Waits for the device."""
        words = struct.unpack("<2I8f", on_host(self._arrays["info"], self._scratch.last).tobytes())
        return BvhInfo(words[0], words[1], (words[2:5], words[5:8]), words[8])

    def _build(self, mesh: MeshStruct, stream: int) -> None:
        self._call("umbel_cuda_build_bvh", mesh, stream)

    def _struct(self) -> BvhStruct:
        return BvhStruct(*(address(self._arrays[name]) for name in ("nodes", "triangles", "info")))

    def _call(self, name: str, mesh: MeshStruct, stream: int) -> None:
        self._scratch.call(
            name,
            ctypes.byref(mesh),
            ctypes.byref(self._config),
            ctypes.byref(self._struct()),
            stream=stream,
        )


def _changed(config: _Config, settings: dict[str, float]) -> _Config:
    names = [name for name, *_ in _Config._fields_[2:]]
    for name, value in settings.items():
        if name not in names:
            raise Error(f"there is no setting {name!r}; the settings are {', '.join(names)}")
        try:
            setattr(config, name, value)
        except TypeError:
            raise Error(f"{name} must be a number, not {value!r}") from None
        if getattr(config, name) != value and not isinstance(value, float):
            raise Error(f"{name} is {value}, which is out of range")
    return config
