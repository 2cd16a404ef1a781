"""Cuts of thousands of instances of a mesh, selected on a CUDA device."""

from __future__ import annotations

import ctypes
import struct
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from umbel.cuda.arrays import current_stream, device_array, is_on_host
from umbel.cuda.c_structs import c_fields
from umbel.cuda.calls import Scratch, address, check, library, maker, on_host
from umbel.cuda.memory import DeviceMemory, given_back
from umbel.errors import Error

if TYPE_CHECKING:
    from umbel.lod.tables import Tables

KINDS = {"error": 0, "camera": 1, "level": 2}
OVERFLOW = {1: "queue", 2: "groups", 4: "clusters"}
MOST_ROOM = 1 << 24


class _Arrays(ctypes.Structure):
    _fields_ = c_fields(
        "uint32_t struct_size, reserved",
        "void* levels",
        "size_t level_count",
        "void* groups",
        "size_t group_count",
        "void* clusters",
        "size_t cluster_count",
        "void* nodes",
        "size_t node_count",
    )


class _Tables(ctypes.Structure):
    _fields_ = c_fields(
        "void* nodes, groups, clusters, normal_cones",
        "uint32_t group_count, layers",
    )


class _Scene(ctypes.Structure):
    _fields_ = c_fields(
        "void* view, planes",
        "uint32_t plane_count",
        "void* instances",
        "uint32_t instance_count",
    )


class _Pages(ctypes.Structure):
    _fields_ = c_fields(
        "void* page_of_group, resident, states",
        "uint32_t page_count",
    )


class _Room(ctypes.Structure):
    _fields_ = c_fields(
        "uint32_t queue, groups, clusters",
    )


class _Pointers(ctypes.Structure):
    """A struct of three pointers, or the first two of them."""

    _fields_ = tuple((name, ctypes.c_void_p) for name in "abc")


@dataclass(frozen=True)
class Counts:
    """How large a selection was."""

    queue: int
    """The most inner nodes of a layer that were looked below."""
    groups: int
    clusters: int
    requests: int
    refused: int
    """Instances without a cut, because their transforms cannot be inverted."""
    overflow: int
    """0, or the sum of 1, 2 and 4 for a queue, groups and clusters that had no room: then no
    instance has a cut."""


@dataclass(frozen=True)
class Selection:
    """What instances show, on the device (of a selector like NumPy's arrays, in those); integers
    are int32."""

    offsets: Any
    """(i + 1,): instance i shows clusters[offsets[i] : offsets[i + 1]], ascending."""
    clusters: Any
    """(room,)"""
    counts_array: Any
    """(6,): the fields of Counts."""
    urgencies: Any = None
    """(p,) float32, with pages: by how much the error of what is shown instead would be too large,
    at worst; 0 for pages that nobody wants."""
    requests_array: Any = None
    """(p,), with pages: the first `requests` of them are wanted and missing, ascending."""
    stream: int | None = None
    """Where they are written; it must still be there when values are asked for."""

    def counts(self) -> Counts:
        """Waits for the device."""
        return Counts(*(int(n) & 0xFFFFFFFF for n in on_host(self.counts_array, self.stream)))

    def cuts(self) -> list[Any]:
        """A NumPy array of clusters for each instance. Waits for the device."""
        self._expect_room()
        offsets, clusters = on_host(self.offsets, self.stream), on_host(self.clusters)
        return [clusters[a:b] for a, b in pairwise(offsets)]

    def requests(self) -> Any:
        """Pages that are wanted and missing, ascending, as a NumPy array. Waits for the device."""
        if self.requests_array is None:
            raise Error("a selection without pages asks for none")
        return on_host(self.requests_array)[: self._expect_room().requests]

    def _expect_room(self) -> Counts:
        counts = self.counts()
        if counts.overflow:
            full = [name for bit, name in OVERFLOW.items() if counts.overflow & bit]
            raise Error(
                f"there was no room for all {' and '.join(full)}: at least {counts.queue}, "
                f"{counts.groups} and {counts.clusters} are needed"
            )
        return counts


class Selector:
    """Selects cuts of one mesh for many instances, as `Tables.instance_cuts` does.

    tables: of a Lod or an Asset; copied to the device.
    like: an array, whose package makes all others: CuPy, PyTorch or Numba, or NumPy, whose arrays
        are copied to the device and back.
    normal_cones: what `normal_cones` of a Lod or an Asset gives; clusters that turn their back are
        left out.
    page_of_group: (g,) the page of each group, for assets that are not all in memory.
    empty, put: for other packages: `empty` makes an array of a shape and the name of a NumPy type,
        `put` one of a NumPy array.
    """

    def __init__(
        self,
        tables: Tables,
        like: Any = None,
        *,
        normal_cones: Any = None,
        page_of_group: Any = None,
        empty: Any = None,
        put: Any = None,
        stream: int | None = None,
    ) -> None:
        import numpy as np

        self._where = current_stream(like) if stream is None else stream
        self._scratch = Scratch(empty or maker(like), self._where)
        self._put = put or _putter(like)
        self._levels = np.ascontiguousarray(tables.levels)
        self._inner = int((tables.nodes["child_count"] > 0).sum())
        self._sizes = (len(tables.groups), len(tables.clusters))
        layers = self._checked(tables)
        rows = {
            "nodes": _bytes(tables.nodes),
            "groups": _bytes(tables.groups),
            "clusters": _bytes(tables.clusters),
            "normal_cones": None if normal_cones is None else _bytes(normal_cones.rows()),
        }
        self._arrays = {k: None if v is None else self._put(v) for k, v in rows.items()}
        self._tables = _Tables(
            *(None if a is None else address(a) for a in self._arrays.values()),
            self._sizes[0],
            layers,
        )
        # One a stream, for good: a captured graph writes and reads it again.
        self._views: dict[int, Any] = {}
        self._pages: dict[str, Any] | None = None
        if page_of_group is not None:
            pages = np.ascontiguousarray(page_of_group, np.uint32)
            if pages.shape != self._sizes[:1]:
                raise Error(f"page_of_group must be one a group, not {pages.shape}")
            self._page_count = int(pages.max()) + 1 if len(pages) else 0
            self._pages = {
                "page_of_group": self._put(pages.view(np.int32)),
                "resident": None,
                "states": self._scratch.make((max(len(pages), 1),), "int32"),
            }

    def set_resident(self, resident: Any, *, stream: int | None = None) -> None:
        """Says which pages are in memory: (p,) uint8 on the device, 1 or 0. The array is kept; call
        this again when it has changed. Before the first time nothing is."""
        if self._pages is None:
            raise Error("give page_of_group to select with pages")
        where = current_stream(resident) if stream is None else stream
        given = device_array(resident, "resident", ("u1", "i1", "b1"), 0, where)
        if given.shape[0] < self._page_count:
            raise Error(f"there are {self._page_count} pages, but resident has {given.shape[0]}")
        self._pages["resident"] = given
        self._scratch.call(
            "umbel_cuda_mark_resident_groups",
            ctypes.byref(self._tables),
            ctypes.c_void_p(self._levels.ctypes.data),
            ctypes.c_uint32(len(self._levels)),
            ctypes.byref(self._pages_struct(given.pointer)),
            stream=where,
        )

    def select(
        # Long: every setting is named and described here.
        self,
        transforms: Any,
        view: Any,
        *,
        planes: Any = None,
        room: tuple[int, int, int] | None = None,
        stream: int | None = None,
    ) -> Selection:
        """Cuts of instances. Nothing waits.

        transforms: (i, 12) float32 on the device, contiguous: three rows of four, from the mesh's
            space to the scene's.
        view: of the scene, from `Tables.view` or `Camera.view`; or on the device, (7,) float32, as
            `view_words` makes it, so that a captured graph follows what is written there.
        planes: (p, 4) float32 on the device, of the scene: inward unit normals and offsets; what is
            wholly outside one of them is left out.
        room: for the inner nodes of a layer, groups and clusters of all instances together. By
            default enough for anything, or 2^24 each.
        """
        where = current_stream(transforms) if stream is None else stream
        instances = device_array(transforms, "transforms", ("f4",), 12, where)
        if instances.strides[0] != 48 and instances.shape[0] > 1:
            raise Error("transforms must be contiguous")
        if hasattr(view, "kind"):
            view = self._put_view(view_words(view), where)
        seen = device_array(view, "view", ("f4",), 0, where)
        if seen.shape[0] != 7:
            raise Error(f"view must have the shape (7,), not {seen.shape}")
        outside = None if planes is None else device_array(planes, "planes", ("f4",), 4, where)
        count = instances.shape[0]
        sizes = room or tuple(min(each * count, MOST_ROOM) for each in (self._inner, *self._sizes))
        chosen = Selection(
            self._scratch.answer((count + 1,), "int32", where),
            self._scratch.answer((max(sizes[2], 1),), "int32", where),
            self._scratch.answer((6,), "int32", where),
            *self._make_feedback(where),
            stream=where,
        )
        scene = _Scene(
            seen.pointer,
            outside.pointer if outside else None,
            outside.shape[0] if outside else 0,
            instances.pointer,
            count,
        )
        out = (chosen.offsets, chosen.clusters, chosen.counts_array)
        pages = feedback = None
        if self._pages is not None:
            resident = self._pages["resident"]
            if resident is None:
                raise Error("set_resident must say what is in memory first")
            pages = ctypes.byref(self._pages_struct(resident.pointer))
            feedback = ctypes.byref(
                _Pointers(address(chosen.urgencies), address(chosen.requests_array), None)
            )
        self._scratch.call(
            "umbel_cuda_select",
            ctypes.byref(self._tables),
            ctypes.byref(scene),
            pages,
            ctypes.byref(_Room(*sizes)),
            ctypes.byref(_Pointers(*map(address, out))),
            feedback,
            stream=where,
        )
        return Selection(
            given_back(chosen.offsets, where),
            given_back(chosen.clusters, where),
            given_back(chosen.counts_array, where),
            given_back(chosen.urgencies, where),
            given_back(chosen.requests_array, where),
            stream=where,
        )

    def _put_view(self, words: Any, stream: int) -> Any:
        """A view on the device, written by a kernel that has it as an argument, so nothing waits
        and the call can be captured."""
        view = self._views.get(stream)
        if view is None:
            view = self._views[stream] = self._scratch.answer((7,), "float32", stream)
        check(
            library().umbel_cuda_put_view(
                ctypes.c_void_p(words.ctypes.data),
                ctypes.c_void_p(address(view)),
                ctypes.c_void_p(stream),
            )
        )
        return view

    def _make_feedback(self, stream: int) -> tuple[Any, Any]:
        if self._pages is None:
            return None, None
        count = max(self._page_count, 1)
        answer = self._scratch.answer
        return answer((count,), "float32", stream), answer((count,), "int32", stream)

    def _pages_struct(self, resident: int) -> _Pages:
        assert self._pages is not None
        return _Pages(
            address(self._pages["page_of_group"]),
            resident,
            address(self._pages["states"]),
            self._page_count,
        )

    def _checked(self, tables: Tables) -> int:
        import numpy as np

        kept = [
            np.ascontiguousarray(table)
            for table in (tables.levels, tables.groups, tables.clusters, tables.nodes)
        ]
        fields = [value for table in kept for value in (table.ctypes.data, len(table))]
        arrays = _Arrays(ctypes.sizeof(_Arrays), 0, *fields)
        layers = ctypes.c_uint32()
        check(library().umbel_cuda_check_tables(ctypes.byref(arrays), ctypes.byref(layers)))
        return layers.value


def view_words(view: Any) -> Any:
    """(7,) float32: a view as the device has it."""
    import numpy as np

    packed = struct.pack(
        "<I5fI", KINDS[view.kind], view.error, *view.eye, view.threshold, view.level
    )
    return np.frombuffer(packed, np.float32)


def _bytes(table: Any) -> Any:
    import numpy as np

    return np.ascontiguousarray(table).view(np.uint8).reshape(-1)


def _putter(like: Any) -> Any:
    """A function that makes arrays of the package of an array from those of NumPy."""
    if is_on_host(like):
        return lambda array: DeviceMemory.of(array, 0)
    package = type(like).__module__.partition(".")[0]
    if package == "torch":
        import torch  # type: ignore[import-not-found,unused-ignore]

        return lambda array: torch.from_numpy(array.copy()).to(like.device)
    if package == "cupy":
        import cupy  # type: ignore[import-not-found,unused-ignore]

        return cupy.asarray
    if package in ("numba", "numba_cuda"):
        from numba import cuda  # type: ignore[import-not-found,unused-ignore]

        return cuda.to_device
    raise Error(f"arrays of {package} cannot be made here: give `put`, a function of a NumPy array")
