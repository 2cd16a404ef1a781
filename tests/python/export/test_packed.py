"""Surfaces as they are stored in files."""

from __future__ import annotations

import time

import numpy as np

from umbel.export.packed import Quantized, ordered


def test_ordering_many_materials_takes_no_square_of_time() -> None:
    count = 60_000
    corners = np.arange(3 * count, dtype=np.uint32)
    rows = {"POSITION": np.repeat(corners[:, None], 3, axis=1)}
    triangles, materials = corners.reshape(-1, 3), np.arange(count, dtype=np.uint32)
    begin = time.process_time()
    made = ordered(Quantized(rows, triangles, materials[::-1].copy()))
    assert time.process_time() - begin < 20  # looking at all vertices for each takes minutes
    assert np.array_equal(made.materials, materials)
    assert np.array_equal(made.rows["POSITION"][made.triangles, 0], triangles[::-1])
