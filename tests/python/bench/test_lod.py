"""`umbel bench lod`: what it measures, and what it writes."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import umbel
from helpers.commands import Umbel
from umbel.bench import lod as bench
from umbel.bench.lod import _Surface
from umbel.bench.peers import has_clusterlod


def with_uvs(mesh: umbel.Mesh) -> umbel.Mesh:
    return umbel.Mesh(mesh.positions, mesh.triangles, uvs=mesh.positions[:, :2].copy())


def test_a_surface_is_no_way_from_itself() -> None:
    mesh = with_uvs(umbel.shapes.blob(3, 1))
    same = _Surface(mesh, 2000).compare(_Surface(mesh, 2000))
    assert same["max_distance"] < 1  # millionths of the diagonal
    assert same["normal_degrees"] < 0.1
    assert same["uv_error"] < 0.01


def test_distances_are_those_of_a_shifted_plane() -> None:
    grid = with_uvs(umbel.shapes.grid(10, 10))
    lifted = umbel.Mesh(
        grid.positions + np.float32([0, 0, 0.01]), grid.triangles, uvs=grid.uvs + np.float32(0.005)
    )
    found = _Surface(grid, 5000).compare(_Surface(lifted, 5000))
    assert found["mean_distance"] == pytest.approx(0.01 / np.sqrt(2) * 1e6, rel=1e-3)
    assert found["max_distance"] == pytest.approx(0.01 / np.sqrt(2) * 1e6, rel=1e-3)
    assert found["normal_degrees"] == pytest.approx(0, abs=1e-3)
    assert found["uv_error"] == pytest.approx(0.005 * np.sqrt(2) * 1e3, rel=1e-3)


def test_coverage_is_the_silhouette_from_all_around() -> None:
    blob = _Surface(umbel.shapes.blob(4, 1), 100)
    assert blob.compare(blob)["coverage"] == 1
    half = umbel.Mesh(blob.mesh.positions * np.float32(0.5), blob.mesh.triangles)
    assert blob.compare(_Surface(half, 100))["coverage"] == pytest.approx(0.25, rel=0.02)


@pytest.mark.parametrize("name", ["smallpine.glb", "bridge_garden.glb"])
def test_foliage_covers_what_it_did(name: str, data: Path) -> None:
    path = data / name
    if not path.exists():
        pytest.skip(f"{name} is not there")
    mesh = umbel.load(path)
    rows = bench.compare({name: lambda: mesh}, samples=1000).rows
    ours = [row["coverage"] for row in rows if row["method"] == "umbel" and row["share"] == 0.1]
    theirs = [row["coverage"] for row in rows if row["method"] == bench.PEER]
    assert all(0.93 < coverage < 1.1 for coverage in ours)
    assert not theirs or abs(1 - ours[0]) < abs(1 - theirs[0])


def test_tables_hold_both_methods_and_their_ratio(tmp_path: Path) -> None:
    meshes = {"blob": lambda: with_uvs(umbel.shapes.blob(4, 1))}
    found = bench.compare(meshes, samples=2000)
    methods = {row["method"] for row in found.rows}
    assert methods == {"umbel", *(bench.PEERS if has_clusterlod() else [])}
    for row in found.rows:
        assert row["mean_distance"] > 0 and row["max_distance"] >= row["mean_distance"]
        assert row["triangles"] <= row["share"] * 5120
    if has_clusterlod():
        assert [row["peer"] for row in found.ratios] == list(bench.PEERS)
        assert all(row["mean_distance"] > 0 for row in found.ratios)
    bench.write(found, tmp_path)
    assert "| blob | umbel |" in (tmp_path / "lod.md").read_text()
    rows = list(csv.DictReader((tmp_path / "lod.csv").open()))
    assert len(rows) == len(found.rows)


def test_the_command_gives_json(umbel_command: Umbel, tmp_path: Path) -> None:
    path = tmp_path / "blob.ply"
    umbel.save(path, umbel.shapes.blob(4, 2))
    outcome = umbel_command("bench", "lod", path, "--samples", 500, "--json")
    assert outcome.status == 0, outcome.err
    fields = outcome.json
    assert {row["mesh"] for row in fields["rows"]} == {"blob"}
    assert fields["machine"]
