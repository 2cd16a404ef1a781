"""Ctrl-C ends queries of any number of rays and points."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import umbel
from helpers.interrupts import interrupted

# A fan: every triangle is near its hub.
ANGLES = np.linspace(0, 2 * np.pi, 20_001, dtype=np.float32)
RIM = np.stack([np.cos(ANGLES), np.sin(ANGLES), np.sin(40 * ANGLES)], axis=1)
FAN = np.stack([np.zeros(20_000), np.arange(1, 20_001), np.arange(2, 20_002)], axis=1)
POINTS = np.random.default_rng(1).normal(size=(1 << 20, 3)).astype(np.float32) * np.float32(1e-3)


@pytest.mark.parametrize(
    "ask",
    [
        lambda fan: fan.closest_point(POINTS),
        lambda fan: fan.signed_distance(POINTS),
        lambda fan: fan.contains(POINTS),
        lambda fan: fan.intersect(POINTS, -POINTS),
        lambda fan: fan.all_hits(POINTS, -POINTS),
    ],
    ids=["closest_point", "signed_distance", "contains", "intersect", "all_hits"],
)
def test_ctrl_c_ends_a_query(ask: Callable[[umbel.Bvh], Any]) -> None:
    fan = umbel.Bvh(np.vstack([np.zeros((1, 3)), RIM]).astype(np.float32), FAN.astype(np.uint32))
    with interrupted(within=20):
        while True:
            ask(fan)
    # The next one is whole.
    assert len(fan.closest_point(POINTS[:1000])) == 1000
