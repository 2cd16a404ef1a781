"""Meshes that are drawn several times, stored once: EXT_mesh_gpu_instancing."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from umbel.export.packed import (
    INSTANCING,
    Json,
    PackedArrays,
    Quantized,
    ordered,
    quantized,
)
from umbel.export.piece import Doubles
from umbel.export.source import Y_TO_Z, Source
from umbel.io.gltf.nodes import composed

_LEAST_SAVED = 256
"""Triangles that a file must not hold because of it: each mesh is one more call to draw."""

_STEPS = 0xFFFF
_MOST_SKEW = 2.0**-21
"""How much a matrix may differ from a rotation and a scale, of its scale: a 20th of a step."""

_MOST_KEPT = 1_000_000
"""Triangles of meshes that are kept for the next tiles."""

_FINER = 0.9
"""A step of a mesh must be so much finer than that of the file: rounding then moves no vertex
further there, what the skew moves it included."""


@dataclass(frozen=True)
class Repeat:
    """A cut of a mesh, and where it is drawn, in glTF's axes."""

    surface: Quantized
    places: dict[str, NDArray[np.float32]]  #: the extension's attributes, from the file's corner
    instances: NDArray[np.intp]  #: their numbers
    box: Doubles  #: (2, 3): around all of them, in the axes of tiles

    @property
    def triangles(self) -> int:
        """All that are drawn."""
        return len(self.surface.triangles) * len(self.instances)

    def node(self, arrays: PackedArrays, mesh: int, corner: Doubles) -> Json:
        """The node that draws it."""
        attributes = {name: arrays.attribute(name, rows) for name, rows in self.places.items()}
        extensions = {INSTANCING: {"attributes": attributes}}
        return {"translation": corner.tolist(), "mesh": mesh, "extensions": extensions}


class Repeats:
    """Which instances of a source can be drawn by a rotation, a scale and a translation."""

    def __init__(self, source: Source) -> None:
        self.source = source
        boxes = source.mesh_boxes
        self._low = boxes[:, :3]
        self._steps = (boxes[:, 3:] - boxes[:, :3]).max(axis=1) / _STEPS
        self._meshes = np.array(source.meshes, np.intp)
        matrices = Y_TO_Z.T @ source.turned
        self._linear, self._shift = matrices[:, :, :3], matrices[:, :, 3]
        with np.errstate(all="ignore"):
            self._scale = np.linalg.norm(self._linear, axis=1)
            self._largest = self._scale.max(axis=1, initial=0.0)
            self._turns = _quaternions(self._linear / self._scale[:, None, :])
            again = composed(np.zeros((len(matrices), 3)), self._turns, self._scale)
            skew = np.abs(again[:, :3, :3] - self._linear).max(axis=(1, 2), initial=0.0)
            step = self._steps[self._meshes]
            fits = (skew <= _MOST_SKEW * self._largest) & (self._scale > 0).all(axis=1)
            self._fits = fits & (step > 0) & np.isfinite(step)
        self._lock = threading.Lock()
        self._kept: dict[tuple[int, bytes], Quantized | None] = {}
        self._kept_triangles = 0

    def of(
        self, instances: NDArray[np.intp], error: float, corner: Doubles, step: float
    ) -> list[Repeat]:
        """What is drawn often enough of some instances, each at a cut of at most this error.
        `corner` and `step` are those of the file's grid, in glTF's axes."""
        fine = self._steps[self._meshes[instances]] * self._largest[instances] <= _FINER * step
        chosen = instances[self._fits[instances] & fine]
        made = (self._made(group, error, corner, step) for group in self._groups(chosen, error))
        return [one for one in made if one is not None]

    def _groups(self, chosen: NDArray[np.intp], error: float) -> Iterator[NDArray[np.intp]]:
        """Instances of one mesh whose cuts are about the same: within a factor of the square root
        of two of scale where the cut depends on it."""
        scale = np.zeros(len(chosen))
        if error > 0:
            scale = np.floor(2 * np.log2(self._largest[chosen]))
        keys = np.stack([self._meshes[chosen], scale], axis=1)
        _, number = np.unique(keys, axis=0, return_inverse=True)
        order = np.argsort(number.reshape(-1), kind="stable")
        ends = np.flatnonzero(np.diff(number.reshape(-1)[order])) + 1
        for group in np.split(chosen[order], ends):
            if len(group) > 1:
                yield group

    def _made(
        self, group: NDArray[np.intp], error: float, corner: Doubles, around: float
    ) -> Repeat | None:
        finest = int(group[np.argmax(self._largest[group])])
        mesh = self._meshes[finest]
        least = -(-_LEAST_SAVED // (len(group) - 1))
        step = float(self._steps[mesh])
        surface = self._surface(finest, error)
        if surface is None or len(surface.triangles) < least:
            return None
        shift = np.einsum("nij,j->ni", self._linear[group], self._low[mesh]) + self._shift[group]
        places = {
            "TRANSLATION": (shift - corner).astype(np.float32),
            "ROTATION": self._turns[group],
            "SCALE": (self._scale[group] * step).astype(np.float32),
        }
        boxes = self.source.boxes[group]
        box = np.stack([boxes[:, :3].min(axis=0) - around, boxes[:, 3:].max(axis=0) + around])
        return Repeat(surface, places, group, box)

    def _surface(self, instance: int, error: float) -> Quantized | None:
        """The cut of an instance's mesh on its grid, in the order of files. Many tiles have the
        same one, so some are kept."""
        mesh = int(self._meshes[instance])
        found = self.source.find(instance, error)
        if found.triangles == 0:
            return None
        key = (mesh, found.clusters().tobytes())
        with self._lock:
            if key in self._kept:
                return self._kept[key]
        piece = self.source.piece(mesh, found)
        surface = quantized(piece, self._low[mesh], float(self._steps[mesh]))
        surface = None if surface is None else ordered(surface)
        with self._lock:
            self._kept_triangles += _size(surface) - _size(self._kept.get(key))
            self._kept[key] = surface
            while len(self._kept) > 1 and self._kept_triangles > _MOST_KEPT:
                self._kept_triangles -= _size(self._kept.pop(next(iter(self._kept))))
        return surface


def _size(surface: Quantized | None) -> int:
    return 0 if surface is None else len(surface.triangles)


def _quaternions(turns: Doubles) -> NDArray[np.float32]:
    """(n, 4), x, y, z, w, of rotations (n, 3, 3): of four ways to compute each the one that divides
    by the most (Shepperd, *Quaternion from rotation matrix*, 1978)."""
    m = turns
    trace = m[:, 0, 0] + m[:, 1, 1] + m[:, 2, 2]
    four = np.zeros((len(m), 4, 4))  # row k: times four times component k
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        four[:, k, k] = 1 + 2 * m[:, k, k] - trace
        four[:, k, i] = four[:, i, k] = m[:, i, k] + m[:, k, i]
        four[:, k, 3] = four[:, 3, k] = m[:, j, i] - m[:, i, j]
    four[:, 3, 3] = 1 + trace
    diagonal = np.nan_to_num(np.einsum("nkk->nk", four))
    best = np.take_along_axis(four, diagonal.argmax(axis=1)[:, None, None], axis=1)[:, 0]
    with np.errstate(all="ignore"):
        unit: Doubles = best / np.linalg.norm(best, axis=1, keepdims=True)
    return np.asarray(np.nan_to_num(unit), np.float32)
