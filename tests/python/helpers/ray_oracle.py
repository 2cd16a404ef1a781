"""Rays beside brute force in double precision, on every real mesh."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import umbel
from helpers.commands import DATA

Array = NDArray[np.float64]

MESHES = sorted(p.name for p in DATA.glob("*.*") if p.suffix in {".ply", ".obj", ".glb", ".gltf"})
INVALID = {"nasty_synth_nan_inf.ply"}
UNREADABLE = {"nasty_synth_index_out_of_range.ply"}
READABLE = sorted(set(MESHES) - UNREADABLE)
FULL = bool(os.environ.get("UMBEL_FULL"))
SMALL = 12_000  # triangles
PAIRS = 4_000_000  # of rays and triangles, at a time


@dataclass
class Truth:
    """What double precision says of each ray and triangle that are no clear miss."""

    ray: NDArray[np.int64]
    triangle: NDArray[np.int64]
    t: Array
    slack: Array  # how uncertain t is, in single precision
    certain: NDArray[np.bool_]  # well inside the triangle, at an angle


def hard_rays(mesh: umbel.Mesh, count: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Random ones, along axes, through vertices and edges, in planes, grazing, from the surface."""
    random = np.random.default_rng(count)
    used = mesh.positions[np.unique(mesh.triangles)].astype(np.float64)
    low, high = used.min(axis=0), used.max(axis=0)
    size = max(float((high - low).max()), float(np.finfo(np.float32).tiny))
    middle = (low + high) / 2
    origins = middle + size * random.uniform(-1.5, 1.5, (count, 3))
    picked = mesh.positions[mesh.triangles[random.integers(len(mesh.triangles), size=count)]]
    a, b, c = picked.astype(np.float64).transpose(1, 0, 2)
    inside = middle + (high - low) * random.uniform(-0.5, 0.5, (count, 3))
    axis = np.eye(3)[random.integers(3, size=count)] * random.choice([-1.0, 1.0], (count, 1))
    tilt = 1e-4 * size * random.uniform(-1, 1, (count, 3))
    flat = random.uniform(-1, 1, (count, 3)) * (axis == 0)
    kinds = (
        (origins, inside - origins),
        (origins, a - origins),
        (origins, (a + b) / 2 - origins),
        (inside - 2 * size * axis, axis),
        (a - 2 * size * axis, axis),
        (a, b - a),
        ((a + b) / 2, c - b),
        ((a + b + c) / 3, random.uniform(-1, 1, (count, 3))),
        ((a + c) / 2, b - a + tilt),
        (inside, flat),
        (inside, size * 1e-3 * random.uniform(-1, 1, (count, 3))),
    )
    kind = np.arange(count) % len(kinds)
    starts = np.choose(kind[:, None], [k[0] for k in kinds]).astype(np.float32)
    ways = np.choose(kind[:, None], [k[1] for k in kinds]).astype(np.float32)
    ways[(ways == 0).all(axis=1)] = (0, 0, 1)
    return starts, ways


def _chunks(mesh: umbel.Mesh, rays: int) -> Iterator[slice]:
    step = max(PAIRS // rays, 1)
    for begin in range(0, len(mesh.triangles), step):
        yield slice(begin, begin + step)


def truth_of(
    mesh: umbel.Mesh, origins: NDArray[np.float32], directions: NDArray[np.float32]
) -> Truth:
    """On which side of each edge a line passes is a product of their Pluecker coordinates."""
    o, d = origins.astype(np.float64), directions.astype(np.float64)
    d = d / np.linalg.norm(d, axis=1, keepdims=True)
    found: list[tuple[Array, ...]] = []
    for part in _chunks(mesh, len(o)):
        corners = mesh.positions[mesh.triangles[part]].astype(np.float64)
        # Around the ray's own origin nothing cancels, but that is one ray at a time; around the
        # middle of the corners it is exact enough for coordinates that are floats.
        middle = corners.mean(axis=(0, 1))
        p = corners - middle
        starts = o - middle
        lines = np.hstack([np.cross(starts, d), d])
        reach = np.abs(p).max() + np.linalg.norm(starts, axis=1)
        slack = 32 * 6e-8 * reach
        low = np.full((len(p), len(o)), np.inf)
        high = -low
        for k in range(3):
            start, end = p[:, k], p[:, (k + 1) % 3]
            edge = end - start
            length = np.maximum(np.linalg.norm(edge, axis=1), 1e-300)
            side = np.hstack([edge, np.cross(start, end)]) @ lines.T / length[:, None]
            np.minimum(low, side, out=low)
            np.maximum(high, side, out=high)
        possible = (low >= -2 * slack) | (high <= 2 * slack)
        triangle, ray = np.nonzero(possible)
        normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])[triangle]
        area = np.linalg.norm(normal, axis=1)
        steep = np.einsum("ij,ij->i", normal, d[ray])
        with np.errstate(all="ignore"):
            slope = np.abs(steep) / area
            t = np.einsum("ij,ij->i", normal, p[triangle, 0] - starts[ray]) / steep
            spread = slack[ray] / slope
            # Where a triangle is so thin that its weights are uncertain, so is the place along it.
            depths = np.einsum("ikj,ij->ik", p[triangle], d[ray])
            edge = np.linalg.norm(p - np.roll(p, 1, axis=1), axis=2).max(axis=1)[triangle]
            slide = np.minimum(1.0, slack[ray] * edge / (area * slope)) * np.ptp(depths, axis=1)
        inside = np.maximum(low[triangle, ray], -high[triangle, ray])
        certain = (inside > 4 * slack[ray]) & (slope > 1e-2)
        found.append((ray, triangle + part.start, t, slack[ray] + spread + slide, certain))
    return Truth(*(np.concatenate(column) for column in zip(*found, strict=True)))


def assert_right(truth: Truth, hits: umbel.bvh.Hits, directions: NDArray[np.float32]) -> None:
    count = len(directions)
    t = hits.t.astype(np.float64) * np.linalg.norm(directions.astype(np.float64), axis=1)
    # Nothing that is hit for certain is missed, or lies clearly before what is reported.
    in_front = truth.certain & (truth.t > truth.slack)
    nearest = np.full(count, np.inf)
    np.minimum.at(nearest, truth.ray[in_front], truth.t[in_front] + 8 * truth.slack[in_front])
    wrong = np.flatnonzero(np.where(hits.hit, t, np.inf) > nearest * (1 + 1e-5))
    assert not wrong.size, f"rays {wrong[:5]} pass what is at {nearest[wrong[:5]]}"
    # What is hit is on the ray, and where the answer says.
    key = truth.ray * (1 << 32) + truth.triangle
    order = np.argsort(key)
    hit = np.flatnonzero(hits.hit)
    wanted = hit * (1 << 32) + hits.primitive[hit]
    place = np.minimum(np.searchsorted(key, wanted, sorter=order), len(key) - 1)
    assert np.array_equal(key[order[place]], wanted), "a triangle that is not on the ray"
    pair = order[place]
    clear = truth.certain[pair]
    error = np.abs(t[hit] - truth.t[pair])[clear]
    assert (error <= (8 * truth.slack + 1e-5 * np.abs(truth.t))[pair][clear]).all()


def load_data(data: Path, name: str) -> umbel.Mesh:
    """The mesh, without its origin: these rays are float32."""
    mesh = replace(umbel.load(data / name), origin=np.zeros(3))
    return umbel.drop_invalid(mesh)[0] if name in INVALID else mesh
