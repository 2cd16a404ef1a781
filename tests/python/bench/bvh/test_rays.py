"""Rays to measure with."""

from __future__ import annotations

import numpy as np
import pytest

from umbel.bench.bvh.rays import primary_rays


@pytest.mark.parametrize("size", [0.0, 1.0])
@pytest.mark.parametrize("place", [0.0, 3.0, 1e6])
def test_primary_rays_have_directions_also_of_a_point(place: float, size: float) -> None:
    low = np.full(3, place, np.float32)
    origins, directions = primary_rays(low, low + np.float32(size), 16)
    assert np.isfinite(origins).all()
    assert np.abs(np.linalg.norm(directions, axis=1) - 1).max() < 1e-6
