"""Rays against every real mesh: beside brute force in double precision, and from every builder,
width and instruction set bit by bit the same. UMBEL_FULL=1: more rays, and every builder on the
large meshes too."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import umbel
from helpers.hierarchies import instructions
from helpers.ray_oracle import (
    FULL,
    MESHES,
    READABLE,
    SMALL,
    assert_right,
    hard_rays,
    load_data,
    truth_of,
)

BUILDERS = umbel.bvh.builders()


@pytest.mark.filterwarnings("ignore::umbel.LoadWarning")
@pytest.mark.parametrize("name", READABLE)
def test_rays_hit_what_brute_force_hits(data: Path, name: str) -> None:
    mesh = load_data(data, name)
    small = len(mesh.triangles) <= SMALL
    first = umbel.Bvh(mesh)
    if len(mesh.triangles) == 0:
        assert not first.intersect([0, 0, 0], [[0, 0, 1]]).hit.any()
        return
    origins, directions = hard_rays(
        mesh, (990 if FULL else 110) if small else (330 if FULL else 22)
    )
    hits = first.intersect(origins, directions)
    assert_right(truth_of(mesh, origins, directions), hits, directions)

    # All others give the same, bit by bit; on large meshes two builders, not the same each time.
    origins, directions = hard_rays(mesh, 2200 if FULL else 660)
    hits = first.intersect(origins, directions)
    turn = MESHES.index(name)
    every = BUILDERS if small or FULL else [BUILDERS[(turn + k) % len(BUILDERS)] for k in (0, 5)]
    for builder in every:
        tree = umbel.build_bvh2(mesh, builder=builder)
        for width in (2, 4, 8):
            for simd in instructions() if small or FULL else ["auto"]:
                for compact in (False, True):
                    other = umbel.Bvh.from_tree(
                        tree, mesh, width=width, compact=compact, simd=simd
                    ).intersect(origins, directions)
                    where = f"{builder}, width {width}, {simd}, compact {compact}"
                    for field, one in vars(other).items():
                        wrong = np.flatnonzero(one != getattr(hits, field))
                        assert not wrong.size, f"{where}: {field} of rays {wrong[:5]}"
