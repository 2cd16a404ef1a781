"""Procedural meshes to try things on: welded and consistently oriented unless said otherwise."""

from __future__ import annotations

from umbel import _umbel
from umbel.geometry.arrays import mesh_of
from umbel.geometry.mesh import Mesh


def grid(columns: int, rows: int) -> Mesh:
    """The unit square in z = 0."""
    return mesh_of(_umbel.shape_grid(columns, rows), [])


def sphere(subdivisions: int) -> Mesh:
    """An icosphere of 20 * 4**subdivisions triangles."""
    return mesh_of(_umbel.shape_sphere(subdivisions), [])


def torus(rings: int, sides: int) -> Mesh:
    """A torus of radii 1 and 0.35."""
    return mesh_of(_umbel.shape_torus(rings, sides), [])


def moebius(segments: int, width: int) -> Mesh:
    """A Möbius strip: one border, not orientable."""
    return mesh_of(_umbel.shape_moebius(segments, width), [])


def fan(triangles: int) -> Mesh:
    """One vertex of that valence."""
    return mesh_of(_umbel.shape_fan(triangles), [])


def soup(triangles: int, seed: int = 1) -> Mesh:
    """Random triangles that share nothing."""
    return mesh_of(_umbel.shape_soup(triangles, seed), [])


def tetrahedra(count: int) -> Mesh:
    """That many closed components."""
    return mesh_of(_umbel.shape_tetrahedra(count), [])


def terrain(columns: int, rows: int, seed: int = 1) -> Mesh:
    """Fractal heights."""
    return mesh_of(_umbel.shape_terrain(columns, rows, seed), [])


def blob(subdivisions: int, seed: int = 1) -> Mesh:
    """A sphere displaced by noise: closed, irregular, 20 * 4**subdivisions triangles."""
    return mesh_of(_umbel.shape_blob(subdivisions, seed), [])
