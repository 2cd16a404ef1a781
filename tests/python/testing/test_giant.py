"""Meshes of any size: counts, borders, order, files and memory."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import umbel
from umbel.testing import giant
from umbel.testing.giant.files import _check_glb_size
from umbel.testing.giant.variants import Permutation

COUNT = 20_001


def corners(mesh: giant.Giant, **how: Any) -> np.ndarray:
    """All triangles as nine numbers each, in order."""
    blocks = mesh.blocks(**how)
    return np.concatenate([b.positions[b.triangles].reshape(-1, 9) for b in blocks])


def as_set(rows: np.ndarray) -> np.ndarray:
    return rows[np.lexsort(rows.T)]


def edges_used(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """How often each edge between two places is used."""
    _, ids = np.unique(positions, axis=0, return_inverse=True)
    t = ids.reshape(-1)[triangles]
    pairs = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    return np.unique(np.sort(pairs, axis=1), axis=0, return_counts=True)[1]


@pytest.mark.parametrize("kind", giant.KINDS)
@pytest.mark.parametrize("count", [1, 2, 3, 767, 1536, COUNT])
def test_has_as_many_triangles_as_asked_for(kind: str, count: int) -> None:
    mesh = giant.make(kind, count)
    assert mesh.triangle_count == count
    blocks = list(mesh.blocks(size=1000))
    assert sum(len(b.triangles) for b in blocks) == count
    assert all((b.triangles < len(b.positions)).all() for b in blocks)


@pytest.mark.parametrize("kind", giant.KINDS)
@pytest.mark.parametrize("seams", [False, True])
def test_any_block_size_gives_the_same_triangles(kind: str, seams: bool) -> None:
    mesh = giant.make(kind, COUNT, 3, seams=seams)
    whole = corners(mesh)
    assert np.array_equal(whole, corners(mesh, size=777))
    assert np.array_equal(whole[5000:9000], corners(mesh, begin=5000, end=9000, size=1111))
    assert not np.array_equal(whole, corners(giant.make(kind, COUNT, 4, seams=seams)))


@pytest.mark.parametrize("kind", giant.KINDS)
def test_vertices_are_the_same_by_range_and_by_number(kind: str) -> None:
    mesh = giant.make(kind, COUNT, seams=True)
    ids = np.arange(1234, 5678)
    a, b = mesh.vertices(1234, 5678), mesh.vertices_of(ids)
    assert np.array_equal(a.positions, b.positions)
    assert np.array_equal(a.uvs, b.uvs)
    t = np.arange(555, 4321)
    assert np.array_equal(mesh.triangles(555, 4321), mesh.triangles_of(t))


@pytest.mark.parametrize("kind", giant.KINDS)
def test_variants_have_the_same_triangles(kind: str) -> None:
    plain = as_set(corners(giant.make(kind, COUNT)))
    for options in ({"shuffled": True}, {"soup": True}, {"shuffled": True, "soup": True}):
        mesh = giant.make(kind, COUNT, **options)
        assert np.array_equal(plain, as_set(corners(mesh, size=3333)))
    shuffled = giant.make(kind, COUNT, shuffled=True)
    jumps = np.abs(np.diff(shuffled.triangles(0, COUNT)[:, 0]))
    assert np.median(jumps) > shuffled.vertex_count / 8


def test_permutations_are_bijections() -> None:
    for count in (1, 2, 3, 1000, 4097):
        some = Permutation(count, 5)
        ids = np.arange(count)
        assert np.array_equal(np.sort(some.forward(ids)), ids)
        assert np.array_equal(some.inverse(some.forward(ids)), ids)


def test_a_terrain_is_one_sheet_and_stays_one_with_seams() -> None:
    mesh = giant.terrain(2 * 200 * 200)
    block = mesh.block(0, mesh.triangle_count)
    used = edges_used(block.positions, block.triangles)
    assert used.max() == 2
    assert (used == 1).sum() == 4 * 200
    seamed = giant.terrain(2 * 256 * 256, seams=True)
    block = seamed.block(0, seamed.triangle_count)
    assert len(np.unique(block.positions, axis=0)) == 257 * 257 < len(block.positions)
    assert (edges_used(block.positions, block.triangles) == 1).sum() == 4 * 256


def test_tiles_of_a_scan_join_to_the_bit(tmp_path: Path) -> None:
    mesh = giant.scan(4 * 2 * 64 * 64, tile=64)
    paths = giant.write_tiles(mesh, tmp_path)
    assert len(paths) == 4
    tiles = [umbel.load(path) for path in paths]
    assert all(tile.origin.any() for tile in tiles)
    places = [np.unique(tile.world_positions, axis=0) for tile in tiles]
    every = np.concatenate(places)
    assert [len(p) for p in places] == [65 * 65] * 4
    assert len(np.unique(every, axis=0)) == 129 * 129
    exact = np.concatenate([b.positions for b in mesh.blocks()])
    assert np.array_equal(np.unique(every, axis=0), np.unique(exact, axis=0))


def test_buildings_are_closed_and_apart() -> None:
    mesh = giant.city(10 * 768)
    block = mesh.block(0, mesh.triangle_count)
    assert (edges_used(block.positions, block.triangles) == 2).all()
    p = block.positions[block.triangles]
    volume = np.einsum("ij,ij->i", p[:, 0], np.cross(p[:, 1], p[:, 2])).reshape(10, -1).sum(axis=1)
    assert (volume > 0).all()
    assert set(np.unique(block.materials)) == {0, 1}


def test_leaves_share_nothing() -> None:
    mesh = giant.foliage(5000)
    block = mesh.block(0, mesh.triangle_count)
    assert len(np.unique(block.positions, axis=0)) == len(block.positions) == 10_000


@pytest.mark.parametrize("kind", giant.KINDS)
@pytest.mark.parametrize("extension", [".ply", ".stl", ".obj", ".glb"])
@pytest.mark.parametrize("seams", [False, True])
def test_files_hold_the_mesh(tmp_path: Path, kind: str, extension: str, seams: bool) -> None:
    mesh = giant.make(kind, 3000, seams=seams)
    path = tmp_path / f"mesh{extension}"
    giant.write(mesh, path)
    read = umbel.load(path)
    rows = read.world_positions[read.triangles].reshape(-1, 9)
    if extension == ".stl":
        rows += np.tile(mesh.origin, 3)
    assert np.array_equal(as_set(rows), as_set(corners(mesh)))
    assert (read.uvs is not None) == (mesh.has_uvs and extension != ".stl")
    if kind == "city" and extension in (".ply", ".glb"):
        assert np.array_equal(
            np.bincount(read.material_ids), np.bincount(mesh.materials_of(np.arange(3000)))
        )


def test_large_glb_files_have_many_meshes(tmp_path: Path) -> None:
    mesh = giant.scan(5 << 18, tile=128)  # more than a block
    giant.write(mesh, tmp_path / "a.glb")
    scene = umbel.load_scene(tmp_path / "a.glb")
    assert len(scene.meshes) == 2
    merged = scene.flatten()
    side = len(np.unique(merged.world_positions, axis=0))
    exact = np.concatenate([b.positions for b in mesh.blocks()])
    assert side == len(np.unique(exact, axis=0))


def test_mistakes_are_sentences(tmp_path: Path) -> None:
    with pytest.raises(umbel.Error, match="kind is 'sea'"):
        giant.make("sea", 10)
    with pytest.raises(umbel.Error, match="triangles is 0"):
        giant.terrain(0)
    with pytest.raises(umbel.Error, match=r"a.xyz: giants are written as"):
        giant.write(giant.terrain(10), tmp_path / "a.xyz")
    with pytest.raises(umbel.Error, match="32-bit indices"):
        giant.write(giant.terrain(2 * 10**9, soup=True), tmp_path / "a.ply")
    with pytest.raises(umbel.Error, match="bytes are more than a"):
        _check_glb_size(2**33, tmp_path / "a.glb")
    assert not list(tmp_path.iterdir())


def test_memory_does_not_grow_with_the_mesh(tmp_path: Path) -> None:
    program = """
import resource, sys
from umbel.testing import giant
from umbel.testing.giant.files import _check_glb_size
mesh = giant.make(sys.argv[1], int(sys.argv[2]))
giant.write(mesh, sys.argv[3])
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""

    def peak(count: int) -> int:
        command = [sys.executable, "-c", program, "terrain", str(count), str(tmp_path / "a.ply")]
        return int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)

    assert peak(6 << 20) < 1.1 * peak(3 << 20)
