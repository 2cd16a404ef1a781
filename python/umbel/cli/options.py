"""Short ways to write a command's options, as the values of its arguments; and the words that some
of them take."""

from __future__ import annotations

import enum
from typing import Any

import typer


def option(value: Any, metavar: str | None, text: str, *names: str, **more: Any) -> Any:
    """An option with its value where it is not given: None where there is none."""
    return typer.Option(value, *names, metavar=metavar, help=text, **more)


def switch(name: str, text: str) -> Any:
    """An option without a value, off unless it is given."""
    return typer.Option(False, name, help=text)


def file_to_keep(metavar: str) -> Any:
    """Where to write what was built, which is only measured otherwise."""
    return option(None, metavar, "Keep it.", "-o", "--output")


class Method(str, enum.Enum):
    bisect = "bisect"
    morton = "morton"
    hybrid = "hybrid"


class Preset(str, enum.Enum):
    quality = "quality"
    fast = "fast"
    exact = "exact"


class Attributes(str, enum.Enum):
    auto = "auto"
    none = "none"


class SeamRule(str, enum.Enum):
    protect = "protect"
    allow = "allow"
    ignore = "ignore"


class Instances(str, enum.Enum):
    auto = "auto"
    on = "on"
    off = "off"


class Distance(str, enum.Enum):
    euclidean = "euclidean"
    manhattan = "manhattan"


class Traversal(str, enum.Enum):
    stack = "stack"
    ropes = "ropes"
    short_stack = "short-stack"


class Heatmap(str, enum.Enum):
    overlap = "overlap"


class Accel(str, enum.Enum):
    bvh = "bvh"
    kdtree = "kdtree"
    grid = "grid"
    octree = "octree"
    bih = "bih"
    lod = "lod"


class Up(str, enum.Enum):
    y = "y"
    z = "z"


class ExportFormat(str, enum.Enum):
    tiles = "3dtiles"
    glb = "glb"
    viewer = "viewer"
