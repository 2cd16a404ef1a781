"""How far the clusters of a moving mesh have drifted, and when to build them anew."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Drift:
    """How far clusters have drifted since they were built."""

    area_ratio: float
    """Sum of the clusters' box areas over that of the box of all."""
    area_ratio_at_build: float
    """The same when each cluster was built."""

    @property
    def growth(self) -> float:
        """The first over the second."""
        before = self.area_ratio_at_build
        return self.area_ratio / before if before > 0 else 1.0


@dataclass(frozen=True)
class RebuildPolicy:
    """When to build clusters of a moving mesh anew, from how far they have drifted."""

    threshold: float = 1.25
    """Rebuild when the growth of the area ratio reaches this (> 1)."""
    least_period: int = 1
    """Frames between two rebuilds, at least."""
    most_period: int = 0
    """Frames after which to rebuild in any case; 0: never."""
    budget: float = 1.0
    """Share of the clusters that a rebuild may build anew, the worst ones; 1: all of them."""

    def decide(self, drift: Drift, frames: int) -> str:
        """What to do `frames` after the last rebuild: "keep", "rebuild" or "rebuild_worst"."""
        due = 0 < self.most_period <= frames
        drifted = drift.growth >= self.threshold and frames >= self.least_period
        if not due and not drifted:
            return "keep"
        return "rebuild_worst" if self.budget < 1.0 else "rebuild"
