"""What `umbel render --heatmap` draws: boxes of clusters, counted for each pixel."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from umbel.cli.run import fail
from umbel.cluster.clusters import METHODS, cluster_boxes, cluster_mesh, clusters_of
from umbel.trace.shading import matching

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from umbel.geometry.mesh import Mesh
    from umbel.lod.asset import Asset
    from umbel.lod.instances import InstanceCut


def check_heatmap(clusters: str | None, most: int | None, *, of_cut: bool) -> None:
    """Refuses, before any work, flags that do not fit."""
    if most is not None and most < 1:
        fail(f"--most must be at least 1, not {most}")
    if clusters is None:
        return
    if of_cut:
        fail("--clusters is for meshes: an asset's cut has clusters of its own")
    if clusters in METHODS:
        return
    if not clusters.endswith(".npz"):
        fail(f"--clusters must be {', '.join(METHODS)} or a FILE.npz, not {clusters!r}")
    _read(Path(clusters))


def boxes_of_mesh(mesh: Mesh, clusters: str | None, threads: int) -> NDArray[np.float32]:
    """(k, 6) boxes of a mesh's clusters, made by a method or read from a .npz, as `umbel cluster`
    writes it. Relative to the mesh's origin."""
    if clusters is None or clusters in METHODS:
        made = cluster_mesh(mesh, method=clusters or "bisect", threads=threads)
        return cluster_boxes(mesh, made)
    items, offsets = _read(Path(clusters))
    ends = len(offsets) > 0 and offsets[0] == 0 and offsets[-1] == len(items)
    if not ends or (np.diff(offsets.astype(np.int64)) <= 0).any():
        fail(f"{clusters}: offsets must rise from 0 to the number of items, {len(items)}")
    if len(items) and items.max() >= len(mesh.triangles):
        fail(
            f"{clusters} has clusters of triangle {items.max()}, and there are "
            f"{len(mesh.triangles)}: were they made of another mesh?"
        )
    return cluster_boxes(mesh, clusters_of(mesh, items, offsets, threads=threads))


def _read(path: Path) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = [np.asarray(file[name]) for name in ("items", "offsets")]
    except KeyError as error:
        fail(f"{path}: {error.args[0]}")
    except (ValueError, EOFError, zipfile.BadZipFile) as error:
        fail(f"{path} is no .npz file: {error}")
    from umbel.geometry.arrays import indices

    return indices("items", arrays[0]), indices("offsets", arrays[1])


def boxes_of_cuts(
    asset: Asset, shown: Sequence[InstanceCut], hide: Sequence[str] = ()
) -> NDArray[np.float32]:
    """(k, 6) boxes of the clusters that are shown, in the world relative to the asset's origin.
    Materials are hidden by clusters, as `CutRenderer` hides them."""
    found: list[NDArray[Any]] = []
    origin = asset.origin
    hidden = matching(asset.materials, hide) if hide else []  # reading them reads their images
    for one in shown:
        clusters = asset.mesh_tables(one.mesh).clusters[one.cut]
        clusters = clusters[~np.isin(clusters["material"], hidden)]
        low = np.asarray(clusters["box_min"], np.float64)
        high = np.asarray(clusters["box_max"], np.float64)
        matrix = np.asarray(one.transform, np.float64)
        # The box of a turned box (Arvo 1990): about its middle, by absolute values.
        shift = asset._mesh_origin
        middle = ((low + high) / 2 + shift) @ matrix[:, :3].T + matrix[:, 3] - origin
        half = (high - low) / 2 @ np.abs(matrix[:, :3]).T
        found.append(np.hstack([middle - half, middle + half]))
    if not found:
        return np.zeros((0, 6), np.float32)
    return np.concatenate(found).astype(np.float32)
