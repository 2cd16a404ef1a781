"""Kd-trees against every real mesh: every builder and traversal beside brute force in double
precision, with rays that are hard on a kd-tree, and bit by bit the hits of the hierarchy.
UMBEL_FULL=1: the large meshes too, and more rays."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import umbel
from helpers.ray_oracle import (
    FULL,
    READABLE,
    SMALL,
    assert_right,
    hard_rays,
    load_data,
    truth_of,
)
from umbel.accel.kdtree import BUILDERS, TRAVERSALS

LARGE = 60_000  # triangles: more only with UMBEL_FULL=1
Float = NDArray[np.float32]


@dataclass
class Cells:
    """Some leaves of a tree."""

    low: Float
    high: Float
    axis: NDArray[np.int64]  # of the last plane on the way to each
    plane: Float


def _nodes(file: Path) -> NDArray[np.uint32]:
    """(n, 2) words, as docs/kdtree.md has them."""
    data = file.read_bytes()
    offset, size, _ = struct.unpack_from("<QQQ", data, 112)
    return np.frombuffer(data, "<u4", size // 4, offset).reshape(-1, 2)


def _cells(nodes: NDArray[np.uint32], bounds: Float, count: int) -> Cells:
    """Where random ways down the tree end; of half of them, into flat cells where there are any."""
    random = np.random.default_rng(1)
    planes = nodes[:, 0].view(np.float32)
    axes, links = nodes[:, 1] & 3, nodes[:, 1] >> 2
    node = np.zeros(count, np.int64)
    low, high = np.tile(bounds[0], (count, 1)), np.tile(bounds[1], (count, 1))
    axis, plane = np.zeros(count, np.int64), low[:, 0].copy()
    while (inner := np.flatnonzero(axes[node] != 3)).size:
        at, a = planes[node[inner]], axes[node[inner]].astype(np.int64)
        above = random.integers(2, size=inner.size).astype(bool)
        wants_flat = inner % 2 == 0
        above = np.where(wants_flat & (at == low[inner, a]), False, above)
        above = np.where(wants_flat & (at == high[inner, a]), True, above)
        axis[inner], plane[inner] = a, at
        low[inner[above], a[above]] = at[above]
        high[inner[~above], a[~above]] = at[~above]
        node[inner] = np.where(above, links[node[inner]], node[inner] + 1)
    return Cells(low, high, axis, plane)


def _cell_rays(cells: Cells) -> tuple[Float, Float]:
    """From planes and along them, from corners and along edges of cells, and within cells, flat
    ones among them."""
    random = np.random.default_rng(2)
    count = len(cells.low)
    one = np.arange(count)
    size = max(float((cells.high - cells.low).max()), float(np.finfo(np.float32).tiny))
    inside = cells.low + (cells.high - cells.low) * random.random((count, 3)).astype(np.float32)
    inside = np.clip(inside, cells.low, cells.high)
    anywhere = random.uniform(-1, 1, (count, 3)).astype(np.float32)
    on_plane = inside.copy()
    on_plane[one, cells.axis] = cells.plane
    along = anywhere.copy()
    along[one, cells.axis] = 0
    almost = anywhere.copy()
    almost[one, cells.axis] *= 1e-7
    corner = np.where(random.integers(2, size=(count, 3)) == 0, cells.low, cells.high)
    edge = np.zeros((count, 3), np.float32)
    edge[one, random.integers(3, size=count)] = random.choice([-1.0, 1.0], count)
    other = corner[random.permutation(count)]
    kinds = (
        (on_plane, anywhere),
        (on_plane, along),
        (on_plane, almost),
        (corner, anywhere),
        (corner, edge),
        (corner - 4 * size * edge, edge),
        (inside, anywhere),
        (inside, edge),
        (corner, other - corner),
    )
    kind = one % len(kinds)
    origins = np.choose(kind[:, None], [k[0] for k in kinds]).astype(np.float32)
    directions = np.choose(kind[:, None], [k[1] for k in kinds]).astype(np.float32)
    directions[(directions == 0).all(axis=1)] = (0, 1, 0)
    return origins, directions


@pytest.mark.filterwarnings("ignore::umbel.LoadWarning")
@pytest.mark.parametrize("name", READABLE)
def test_rays_hit_what_brute_force_hits(data: Path, name: str, tmp_path: Path) -> None:
    mesh = load_data(data, name)
    triangles = len(mesh.triangles)
    if triangles > LARGE and not FULL:
        pytest.skip("large; set UMBEL_FULL=1")
    if triangles == 0:
        assert not umbel.KdTree(mesh).intersect([0, 0, 0], [[0, 0, 1]]).hit.any()
        return
    bvh = umbel.Bvh(mesh)
    # Of each kind of ray some are judged by brute force, all by the hierarchy.
    judged = (900 if FULL else 90) if triangles <= SMALL else (180 if FULL else 18)
    for builder in BUILDERS:
        tree = umbel.KdTree(mesh, builder=builder)
        assert tree.statistics()["references"] <= 16 * triangles
        tree.save(tmp_path / "tree.umkd")
        assert tree.bounds is not None
        bounds = np.asarray(tree.bounds, np.float32)
        cells = _cells(_nodes(tmp_path / "tree.umkd"), bounds, 9000 if FULL else 1800)
        for origins, directions in (_cell_rays(cells), hard_rays(mesh, 2200 if FULL else 660)):
            expected = bvh.intersect(origins, directions)
            for traversal in TRAVERSALS:
                tree.traversal = traversal
                hits = tree.intersect(origins, directions)
                for field, one in vars(hits).items():
                    wrong = np.flatnonzero(one != getattr(expected, field))
                    assert not wrong.size, f"{builder}, {traversal}: {field} of {wrong[:5]}"
                assert np.array_equal(tree.occluded(origins, directions), hits.hit)
            if builder == BUILDERS[0]:  # the others give the same
                few = slice(0, judged)
                hits = tree.intersect(origins[few], directions[few])
                truth = truth_of(mesh, origins[few], directions[few])
                assert_right(truth, hits, directions[few])
