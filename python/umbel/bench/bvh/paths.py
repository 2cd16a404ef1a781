"""The rays that path tracing sends through a scene: the same for every hierarchy over it.

Paths start at the pixels of a picture, bounce off matte surfaces, and end by Russian roulette or in
the sky; at each hit two shadow rays go to the light: one to the sun and one to the sky or, where
the picture shows no sky, both to a lamp by the camera. The rays are found once and kept, so that
what is timed afterwards is the tracing alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from umbel._umbel import TraceCamera
from umbel.accel.queries import TriangleQueries
from umbel.bench.bvh.rays import Rays, cosine_directions, surface
from umbel.geometry.mesh import Mesh

Floats = NDArray[np.float64]

Size = tuple[int, int]
"""Width and height of a picture, multiples of a tile's."""

WIDTH, HEIGHT = 1024, 768
SHADOW_SAMPLES = 2
TILE = 16
_ALBEDO = 0.75
_ROULETTE_FROM, _MOST_BOUNCES = 2, 32
_TO_SUN, _SUN_RADIUS = (0.66, 0.74, 0.12), 0.0093
_LAMP = 0.01  # its size, times the greatest distance to it
_SKY = 0.002  # the share of a picture that makes it one with sky
_GOLDEN = (math.sqrt(5) - 1) / 2


@dataclass(frozen=True)
class Batch:
    """Rays that are traced together."""

    rays: Rays
    t_max: float
    shadow: bool
    """Whether any hit will do; else the nearest is wanted."""

    def __len__(self) -> int:
        return len(self.rays[0])


@dataclass(frozen=True)
class View:
    """The rays of one picture."""

    paths: int
    batches: list[Batch]

    @property
    def rays(self) -> int:
        """How many."""
        return sum(len(batch) for batch in self.batches)


def trace(structure: TriangleQueries, view: View, threads: int = 0) -> None:
    """Sends all rays of a view through a hierarchy."""
    for batch in view.batches:
        query = structure.occluded if batch.shadow else structure.intersect
        query(*batch.rays, t_max=batch.t_max, threads=threads)


def path_view(
    structure: TriangleQueries,
    mesh: Mesh,
    camera: TraceCamera,
    *,
    samples: int = 1,
    share: float = 1.0,
    seed: int | Sequence[int] = 1,
    size: Size = (WIDTH, HEIGHT),
    threads: int = 0,
) -> View:
    """The rays of so many paths a pixel, in this share of the picture's tiles."""
    dice = np.random.default_rng(seed)
    rays = camera_rays(camera, samples, share, dice, size)
    paths, batches, lamp = len(rays[0]), [], None
    for bounce in range(_MOST_BOUNCES + 1):
        batches.append(Batch(rays, math.inf, shadow=False))
        hits = structure.intersect(*rays, threads=threads)
        hit = hits.hit
        if bounce == 0 and hit.mean() > 1 - _SKY:
            lamp = np.array(camera.position)
        if not hit.any():
            break
        points, normals = surface(
            mesh, (rays[0][hit], rays[1][hit]), hits.t[hit], hits.primitive[hit]
        )
        batches += _shadows(points, normals, lamp, dice)
        onward = np.ones(len(points), np.bool_)
        if bounce >= _ROULETTE_FROM:
            onward = dice.random(len(points)) < _ALBEDO
        if not onward.any():
            break
        rays = _rays(points[onward], cosine_directions(normals[onward], dice))
    return View(paths, batches)


def _shadows(
    points: Floats, normals: Floats, lamp: Floats | None, dice: np.random.Generator
) -> list[Batch]:
    """The rays to the light that start above the surface."""
    if lamp is None:
        sun = np.array(_TO_SUN) / np.linalg.norm(_TO_SUN)
        ways, t_max = (_near(sun, len(points), dice), _upper_half(len(points), dice)), math.inf
    else:
        spots = [dice.normal(size=points.shape) * _LAMP for _ in range(SHADOW_SAMPLES)]
        ways, t_max = tuple(lamp + spot * np.abs(lamp - points).max() - points for spot in spots), 1
    found = []
    for way in ways:
        lit = np.einsum("ij,ij->i", way, normals) > 0
        if lit.any():
            found.append(Batch(_rays(points[lit], way[lit]), t_max, shadow=True))
    return found


def camera_rays(
    camera: TraceCamera,
    samples: int,
    share: float,
    dice: np.random.Generator,
    size: Size = (WIDTH, HEIGHT),
) -> Rays:
    """Rays through each pixel of so many tiles of 16 x 16, spread over the picture."""
    pixels = (np.repeat(numbers, samples) for numbers in _pixels(share, size))
    x, y = (numbers + dice.random(len(numbers)) for numbers in pixels)
    return _through(camera, x / size[0], y / size[1], size[0] / size[1])


def _through(camera: TraceCamera, x: Floats, y: Floats, aspect: float = WIDTH / HEIGHT) -> Rays:
    """Rays through points of a picture, from 0 to 1, the top left first."""
    position, target = np.array(camera.position), np.array(camera.target)
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    upwards = np.cross(right, forward)
    high = math.tan(camera.fov_y / 2)
    wide = high * aspect
    directions = (
        forward + ((x * 2 - 1) * wide)[:, None] * right - ((y * 2 - 1) * high)[:, None] * upwards
    )
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return _rays(np.broadcast_to(position, directions.shape), directions)


def preview(
    structure: TriangleQueries, mesh: Mesh, camera: TraceCamera, height: int = 180
) -> NDArray[np.uint8]:
    """(height, height * 4 / 3) grey: what a camera sees, shaded by the slope of the surface."""
    width, fine = height * WIDTH // HEIGHT, 3
    y, x = ((numbers.ravel() + 0.5) / fine for numbers in np.indices((height * fine, width * fine)))
    rays = _through(camera, x / width, y / height)
    hits = structure.intersect(*rays)
    grey = np.full(len(x), 1.0)
    hit = hits.hit
    if hit.any():
        seen = rays[0][hit], rays[1][hit]
        _, normals = surface(mesh, seen, hits.t[hit], hits.primitive[hit])
        facing = np.abs(np.einsum("ij,ij->i", normals, seen[1].astype(np.float64)))
        grey[hit] = 0.15 + 0.55 * facing + 0.2 * np.abs(normals[:, 1])
    mean = grey.reshape(height, fine, width, fine).mean(axis=(1, 3))
    rounded: NDArray[np.uint8] = np.round(mean * 255).astype(np.uint8)
    return rounded


def _pixels(
    share: float, size: Size = (WIDTH, HEIGHT)
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    across, down = size[0] // TILE, size[1] // TILE
    count = max(round(across * down * share), 1)
    # Multiples of the golden ratio spread evenly, however many are taken.
    order = np.argsort(np.arange(across * down) * _GOLDEN % 1.0, kind="stable")
    tiles = np.sort(order[:count])
    y, x = np.divmod(np.arange(TILE * TILE), TILE)
    return (
        (tiles[:, None] % across * TILE + x).ravel(),
        (tiles[:, None] // across * TILE + y).ravel(),
    )


def views_around(camera: TraceCamera, inside: bool, angles: Sequence[float]) -> list[TraceCamera]:
    """The camera turned about the vertical axis by these angles, in degrees: where it is if it
    is inside, else around its target."""
    turned = []
    for degrees in angles:
        radians = math.radians(degrees)
        spin = np.array(
            [
                [math.cos(radians), 0, math.sin(radians)],
                [0, 1, 0],
                [-math.sin(radians), 0, math.cos(radians)],
            ]
        )
        position, target = np.array(camera.position), np.array(camera.target)
        view = TraceCamera()
        away = spin @ (target - position)
        view.position = tuple(position if inside else target - away)
        view.target = tuple(position + away if inside else target)
        view.up, view.fov_y = camera.up, camera.fov_y
        turned.append(view)
    return turned


def _near(direction: Floats, count: int, dice: np.random.Generator) -> Floats:
    out = direction + dice.normal(size=(count, 3)) * (_SUN_RADIUS / 2)
    unit: Floats = out / np.linalg.norm(out, axis=1, keepdims=True)
    return unit


def _upper_half(count: int, dice: np.random.Generator) -> Floats:
    out = dice.normal(size=(count, 3))
    out[:, 1] = np.abs(out[:, 1])
    unit: Floats = out / np.linalg.norm(out, axis=1, keepdims=True)
    return unit


def _rays(origins: Floats, directions: Floats) -> Rays:
    return (
        np.ascontiguousarray(origins, dtype=np.float32),
        np.ascontiguousarray(directions, dtype=np.float32),
    )
