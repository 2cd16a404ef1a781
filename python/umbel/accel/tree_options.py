"""How trees are built: presets, builders and their settings."""

from __future__ import annotations

from typing import Any, Literal, TypedDict

from umbel import _umbel
from umbel.errors import Error
from umbel.geometry.arrays import configure

PRESETS = ("fast", "quality", "best")
DISTANCES = ("euclidean", "manhattan")


class TreeOptions(TypedDict, total=False):
    """How a tree is built; what is left out, or None, is as the preset or builder has it."""

    cost: tuple[float, float] | None
    """(traversal, intersection) of the surface-area heuristic."""
    max_leaf_size: int | None
    """Most triangles a leaf, 1 to 255."""
    max_depth: int | None
    """Deepest level of a leaf, 8 to 255."""
    invalid: Literal["refuse", "drop"] | None
    """What to do with triangles that have a NaN or infinite vertex."""
    reinsertion_rounds: int | None
    """Rounds of reinsertion after any builder, 0 to 64."""
    bins: int | None
    """binned: bins an axis, 4 to 256."""
    spatial_budget: float | None
    """sbvh: references beyond the mesh's triangles, as a fraction, 0 to 4."""
    spatial_overlap: float | None
    """sbvh: the overlap from which on spatial splits are tried, 0 to 1."""
    morton_bits: int | None
    """lbvh: 30, 60 or 63."""
    hlbvh_bits: int | None
    """hlbvh: leading bits of the code that are built by SAH, 3 to 30."""
    ploc_radius: int | None
    """ploc: neighbours searched each way, 1 to 128."""
    ploc_sweep: int | None
    """ploc: the levels above clusters of at most so many triangles are also built by the sweep, and
    the cheaper of the two is kept, 0 to 255; 0 as published."""
    atrbvh_bits: int | None
    """atrbvh: as hlbvh_bits, of the tree to begin with, 3 to 30; 0: a plain lbvh, as published."""
    treelet_size: int | None
    """atrbvh: leaves of a treelet, 3 to 15."""
    treelet_rounds: int | None
    """atrbvh: 1 to 16."""
    clusters: int | None
    """kmeans: k, 2 to 1024; 64 at most in k-ary trees."""
    candidates: int | None
    """kmeans: p, 1 to 64."""
    iterations: int | None
    """kmeans: i, 0 to 100."""
    distance: Literal["euclidean", "manhattan"] | None
    """kmeans: of the boxes' corners; with "manhattan", medians instead of means."""
    forwarded_clusters: int | None
    """kmeans: clusters that a node's treelet forwards to its parent's, 0 to 64; 1 as published,
    0 as many as a treelet can take."""
    aac_leaf_size: int | None
    """aac: fewer triangles are not halved any more, 2 to 128."""
    aac_epsilon: float | None
    """aac: n triangles forward some n^(0.5 - epsilon) nodes, 0 to 0.5."""


def builders() -> tuple[str, ...]:
    """The names of all builders that the library was built with."""
    return tuple(_umbel.bvh_builders())


def tree_config(builder: str, options: TreeOptions) -> _umbel.BvhConfig:
    """The config of a preset or of a builder, with what is not None in `options`."""
    unknown = next((name for name in options if name not in TreeOptions.__annotations__), None)
    if unknown is not None:
        raise TypeError(f"there is no option {unknown!r}")
    changes = {name: value for name, value in options.items() if value is not None}
    config = _preset(builder)
    config.drop_invalid = _choice("invalid", changes, ("refuse", "drop")) == "drop"
    if "distance" in changes:
        config.manhattan = _choice("distance", changes, DISTANCES) == "manhattan"
    configure(config, changes)
    return config


def _preset(name: str) -> _umbel.BvhConfig:
    if not isinstance(name, str):
        raise Error(f"builder must be a name, not {name!r}")
    if name in PRESETS:
        return _umbel.bvh_preset(name)
    if name.partition("-")[0] not in builders():
        names = ", ".join((*PRESETS, *builders()))
        raise Error(f"builder is {name!r}, but must be one of {names}")
    return _umbel.bvh_builder_preset(name)


def _choice(name: str, changes: dict[str, Any], values: tuple[str, ...]) -> str:
    """Takes an option out of `changes`; the first of its values where it is not there."""
    value = changes.pop(name, values[0])
    if value not in values:
        raise Error(f"{name} must be {' or '.join(map(repr, values))}, not {value!r}")
    return str(value)
