"""How much the boxes of a moving mesh's clusters have grown, and when to rebuild the clusters."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real

from umbel.errors import Error


@dataclass(frozen=True)
class AreaGrowth:
    """How much the areas of clusters' boxes have grown since the clusters were built."""

    area_ratio: float
    """Sum of the clusters' box areas over that of the box of all."""
    area_ratio_at_build: float
    """The same when each cluster was built."""

    @property
    def growth(self) -> float:
        """`area_ratio` over `area_ratio_at_build`."""
        before = self.area_ratio_at_build
        return self.area_ratio / before if before > 0 else 1.0


@dataclass(frozen=True)
class RebuildPolicy:
    """When to rebuild the clusters of a moving mesh, from the growth of their boxes' areas."""

    threshold: float = 1.25
    """Rebuild when the growth of the area ratio reaches this (> 1)."""
    least_period: int = 1
    """Frames between two rebuilds, at least."""
    most_period: int = 0
    """Frames after which to rebuild in any case; 0: never."""
    budget: float = 1.0
    """Share of the clusters that a rebuild may replace, the worst ones first; 1: all of them."""

    def __post_init__(self) -> None:
        least = {"threshold": 1, "least_period": 0, "most_period": 0, "budget": 0}
        for name, limit in least.items():
            value = getattr(self, name)
            if not isinstance(value, Real) or not float(value) >= limit:
                raise Error(f"{name} must be a number of at least {limit}, not {value!r}")

    def decide(self, growth: AreaGrowth, frames: int) -> str:
        """What to do `frames` after the last rebuild: "keep", "rebuild" or "rebuild_worst"."""
        due = 0 < self.most_period <= frames
        grown = growth.growth >= self.threshold and frames >= self.least_period
        if not due and not grown:
            return "keep"
        return "rebuild_worst" if self.budget < 1.0 else "rebuild"
