"""Cutting at planes."""

from __future__ import annotations

import numpy as np

import umbel
from umbel.export.piece import Piece


def area(piece: Piece) -> float:
    a, b, c = (piece.points[piece.triangles[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def soup(seed: int) -> Piece:
    """Triangles of all sizes, with vertices on the plane x = 0.5 and some wholly in it."""
    random = np.random.default_rng(seed)
    points = random.random((300, 3))
    points[random.random(300) < 0.3, 0] = 0.5
    triangles = random.integers(0, 300, (500, 3)).astype(np.uint32)
    column = (points @ random.random((3, 2))).astype(np.float64)
    return Piece(points, triangles, np.arange(500, dtype=np.uint32), {"TEXCOORD_0": column})


def test_both_sides_together_are_the_whole() -> None:
    for seed in range(10):
        whole = soup(seed)
        low, high = whole.half(0, 0.5, False), whole.half(0, 0.5, True)
        assert np.isclose(area(low) + area(high), area(whole))
        assert low.points[low.triangles][:, :, 0].max() <= 0.5
        assert high.points[high.triangles][:, :, 0].min() >= 0.5
        for k in range(500):
            parts = [Piece(p.points, p.triangles[p.materials == k], None, {}) for p in (low, high)]
            own = Piece(whole.points, whole.triangles[[k]], None, {})
            assert np.isclose(sum(map(area, parts)), area(own), atol=1e-12)


def test_attributes_are_interpolated_and_windings_kept() -> None:
    whole = soup(3)
    weights = np.linalg.lstsq(whole.points, whole.columns["TEXCOORD_0"], rcond=None)[0]
    for upper in (False, True):
        part = whole.half(0, 0.5, upper)
        used = np.unique(part.triangles)
        assert np.allclose(part.points[used] @ weights, part.columns["TEXCOORD_0"][used])

        def normals(piece: Piece) -> np.ndarray:
            a, b, c = (piece.points[piece.triangles[:, k]] for k in range(3))
            return np.cross(b - a, c - a)

        before = normals(whole)[part.materials]
        assert (np.einsum("ij,ij->i", normals(part), before) >= -1e-15).all()


def test_a_closed_surface_is_cut_along_the_same_edges_on_both_sides() -> None:
    whole = Piece.of(umbel.shapes.blob(4, seed=1))
    value = 0.1234
    sides = [whole.half(2, value, upper) for upper in (False, True)]
    edges = []
    for part in sides:
        t = part.triangles
        all_edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
        inside = (part.points[all_edges][:, :, 2] == value).all(axis=1)
        edges.append({tuple(map(tuple, e)) for e in part.points[all_edges[inside]].tolist()})
    assert len(edges[0]) > 20
    assert edges[0] == {(b, a) for a, b in edges[1]}
