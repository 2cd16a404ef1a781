"""Writing meshes with their levels of detail as one .umbel file."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbel import _umbel
from umbel.errors import Error
from umbel.geometry.arrays import check_affine, numbers, thread_count, whole
from umbel.geometry.mesh import Material
from umbel.geometry.origin import origin_of, relative_transform, zero_origin
from umbel.lod.attribute_precision import attribute_precision
from umbel.lod.materials import write_materials
from umbel.lod.placements import Placements
from umbel.plain_json import encode

if TYPE_CHECKING:
    from umbel.geometry.repair import Progress
    from umbel.lod.lod import Lod

PAGE_BYTES = 0
"""Most bytes of a page of several groups, unless the caller chooses; 0: as the file's size asks."""


class Savable(ABC):
    """What can be saved as an asset: one mesh or a scene, with levels of detail."""

    origin: NDArray[np.float64]
    report: dict[str, Any]
    config: dict[str, Any]
    source: dict[str, Any]
    coordinates: dict[str, str]
    _name: str

    def metadata(self) -> dict[str, Any]:
        """What `save` writes beside the geometry: the same for two builds of the same mesh, so
        without their times."""
        said: dict[str, Any] = {
            "generator": f"umbel {_umbel.version()}",
            "name": self._name,
            "config": self.config,
            "source": self.source,
            "report": {key: value for key, value in self.report.items() if key != "seconds"},
        }
        return said | ({"coordinates": self.coordinates} if self.coordinates else {})

    @abstractmethod
    def _saved(self) -> dict[str, Any]:
        """The arguments of `save_asset` for meshes, instances and scene."""

    def save(
        self,
        path: str | os.PathLike[str],
        *,
        exact: bool | None = None,
        attribute_bits: Mapping[str, int] | None = None,
        textures: str = "embed",
        page_bytes: int = PAGE_BYTES,
        progress: Progress | None = None,
        threads: int = 0,
    ) -> int:
        """Writes the asset beside `path` and renames it, so that a file of that name is always
        whole. Returns its bytes.

        exact: keep every bit of normals, tangents, UVs and colours, or store them in fewer bits
            (docs/format.md); None: as the build did with positions, exactly without `precision`.
        attribute_bits: of some attributes, instead; 0 keeps every bit. "normal": of each of two
            octahedral components, 2 to 16; "tangent": of the angle about the normal, 2 to 16 (all,
            where normals keep all); "color": of red, green, blue and alpha, 2 to 16; "uv": after
            the point, 1 to 24. Those not given have, where not exact, 8, 8, 8 and 12 bits with
            positions of up to 16, one more (but for colours) with 17, two with 18 and more.
        textures: "embed" the materials' images, leave them "external" where they are files in
            the asset's folder or below, or "none".
        page_bytes: what is read at once, at most, where one group does not take more. 0: 40 KiB,
            64 KiB where the file takes over 4 GB, 256 KiB over 16 GB.
        """
        return save_asset(
            path,
            metadata=self.metadata(),
            origin=self.origin,
            exact=exact,
            attribute_bits=attribute_bits,
            textures=textures,
            page_bytes=page_bytes,
            progress=progress,
            threads=threads,
            **self._saved(),
        )


def save_asset(
    path: str | os.PathLike[str],
    lods: Sequence[Lod],
    instances: Sequence[tuple[int, ArrayLike]] | Placements | None = None,
    *,
    metadata: dict[str, Any] | None = None,
    exact: bool | None = None,
    attribute_bits: Mapping[str, int] | None = None,
    textures: str = "embed",
    page_bytes: int = PAGE_BYTES,
    origin: ArrayLike | None = None,
    scene: dict[str, Any] | None = None,
    progress: Progress | None = None,
    threads: int = 0,
) -> int:
    """Writes several meshes as one asset, each with its materials; equal ones are stored once.
    Returns its bytes.

    instances: which mesh is where: (index into `lods`, (3, 4) or (4, 4) matrix that takes column
        vectors from the mesh to the world); or `Placements`, for millions of them. None: every mesh
        once, where it is. More than 65,536 are stored as a tree, which is read as views need
        it (docs/instances.md): in another order than they were given.
    metadata: what `Asset.info["metadata"]` shall be.
    origin: where the asset lies: it is kept relative to that. None: where the first mesh lies.
    scene: what `Asset.scene` shall be.
    The rest is as `Lod.save` has it.
    """
    if instances is not None and not len(instances):
        raise Error(
            "there are no instances, but an asset shows at least one; None shows every mesh once"
        )
    for name, given in (("metadata", metadata), ("scene", scene)):
        if given is not None and not isinstance(given, dict):
            raise Error(f"{name} must be a dict, not {type(given).__name__}")
    around = origin_of(origin if origin is not None else lods[0].origin if lods else zero_origin())
    if instances is None and any(not np.array_equal(lod.origin, around) for lod in lods):
        instances = [(k, np.eye(4)) for k in range(len(lods))]
    meshes, transforms = _placed(lods, () if instances is None else instances, around)
    folder = Path(os.fspath(path)).absolute().parent
    all_materials, firsts = _joined([lod._materials for lod in lods])
    materials, files = write_materials(all_materials, textures, folder, thread_count(threads))
    return _umbel.write_asset(
        os.fspath(path),
        [lod._native for lod in lods],
        encode(metadata if metadata is not None else {"generator": f"umbel {_umbel.version()}"}),
        materials,
        np.array(firsts, np.uint32),
        files,
        meshes.astype(np.uint32),
        transforms.reshape(-1, 12),
        attribute_precision(lods, exact, attribute_bits),
        page_bytes,
        progress,
        thread_count(threads),
        around.tolist(),
        encode(scene) if scene else "",
    )


def _placed(
    lods: Sequence[Lod],
    instances: Sequence[tuple[int, ArrayLike]] | Placements,
    origin: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """The instances' meshes, and the matrices that take meshes without their own origins to the
    world without `origin`."""
    if isinstance(instances, Placements):
        return instances.relative([lod.origin for lod in lods], origin)
    for instance in instances:
        if not isinstance(instance, Sequence) or len(instance) != 2:
            raise Error("instances must be pairs of a mesh's index and a matrix")
    meshes = np.array([whole("an instance's mesh", mesh) for mesh, _ in instances], np.int64)
    given = [numbers("an instance's transform", matrix) for _, matrix in instances]
    if any(matrix.shape not in ((3, 4), (4, 4)) for matrix in given):
        raise Error("an instance's transform must have shape (3, 4) or (4, 4)")
    for matrix in given:
        check_affine("an instance's transform", matrix)
    if len(meshes) and not 0 <= meshes.min() <= meshes.max() < len(lods):
        raise Error(f"an instance is of mesh {meshes.max()}, but there are {len(lods)}")
    local = [
        relative_transform(matrix, lods[mesh].origin, origin)
        for mesh, matrix in zip(meshes, given, strict=True)
    ]
    return meshes, np.array(local, np.float32)


def _joined(lists: list[list[Material]]) -> tuple[list[Material], list[int]]:
    """All materials, and where those of each list begin. Who has none gets the default."""
    if any(lists):
        lists = [materials or [Material()] for materials in lists]
    joined: list[Material] = []
    firsts: list[int] = []
    for i, materials in enumerate(lists):
        same = next((j for j in range(i) if lists[j] == materials), None)
        firsts.append(len(joined) if same is None else firsts[same])
        if same is None:
            joined += materials
    return joined, firsts
