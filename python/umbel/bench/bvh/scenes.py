"""The scenes of the comparison of hierarchies: where they are seen from, and the parameters of
k-means that suit them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from umbel._umbel import TraceCamera
from umbel.bench.bvh.paths import HEIGHT, WIDTH, Size, views_around
from umbel.errors import Error
from umbel.geometry.mesh import Mesh
from umbel.trace.renderer import Renderer

COSTS = (3.0, 2.0)
"""Of traversal and intersection, as on the slides."""
GENERATED = "plant"
"""The name of the generated scene."""


@dataclass(frozen=True)
class Kmeans:
    """Parameters of the builder `kmeans`."""

    clusters: int
    candidates: int
    iterations: int

    def __str__(self) -> str:
        return f"k {self.clusters}, p {self.candidates}, i {self.iterations}"

    def arguments(self) -> dict[str, Any]:
        """For `umbel.Bvh`."""
        return {
            "clusters": self.clusters,
            "candidates": self.candidates,
            "iterations": self.iterations,
        }


PRESETS = {
    "Q1": Kmeans(8, 5, 0),
    "Q2": Kmeans(8, 5, 2),
    "Q3": Kmeans(16, 5, 5),
    "Q4": Kmeans(32, 20, 10),
    "Q5": Kmeans(64, 30, 15),
}


@dataclass(frozen=True)
class Setting:
    """What is known of a scene."""

    prefix: str
    """Of the names that it goes by."""
    kmeans: Kmeans = PRESETS["Q2"]
    cameras: Sequence[str] = ()
    """As `umbel render` takes them; without any, three are found."""


SETTINGS = (
    Setting("sponza", PRESETS["Q4"], ("auto", "0,2,-0.5:12,4,-0.5:65", "-14,7.5,-4.5:10,6,4:60")),
    Setting(
        "conference",
        PRESETS["Q2"],
        ("auto", "900,450,300:0,150,-400:65", "200,350,500:0,100,-600:65"),
    ),
    Setting(
        "sibenik",
        cameras=("-16,-11,0:0,-8,0:65", "16,-10,0:-5,-7,0:60", "-16,-11,3:10,-6,-3:65"),
    ),
    Setting("bench_arch", cameras=("auto", "-18,2,0:10,3,0:60", "10,2,8:-5,3,-6:65")),
    Setting(
        GENERATED,
        PRESETS["Q3"],
        ("230,60,190:0,5,0:50", "100,12,-20:-60,15,30:60", "-60,90,-260:20,0,40:45"),
    ),
)


@dataclass(frozen=True)
class Scene:
    """A mesh to build over, and what is done with it."""

    name: str
    mesh: Mesh
    """Positions and triangles."""
    kmeans: Kmeans
    cameras: list[TraceCamera]


def scene(
    name: str,
    load: Callable[[], Mesh],
    kmeans: Kmeans | None = None,
    threads: int = 0,
    size: Size = (WIDTH, HEIGHT),
) -> Scene:
    """Loads a scene. `kmeans` replaces what is known to suit it."""
    given = load()
    mesh = Mesh(given.positions, given.triangles)
    if not len(mesh.triangles):
        raise Error(f"{name} has no triangles to build a hierarchy over")
    known = next((s for s in SETTINGS if name.lower().startswith(s.prefix)), Setting(""))
    cameras = _cameras(mesh, known.cameras, threads, size)
    return Scene(name, mesh, kmeans or known.kmeans, cameras)


def _cameras(mesh: Mesh, texts: Sequence[str], threads: int, size: Size) -> list[TraceCamera]:
    renderer = Renderer(mesh, preset="fast", threads=threads)
    if texts:
        return [renderer.camera(text, *size) for text in texts]
    camera = renderer.camera("auto", *size)
    low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
    position = np.array(camera.position)
    return views_around(
        camera, bool((low < position).all() and (position < high).all()), (0, 120, 240)
    )
