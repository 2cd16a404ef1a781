"""`umbel build` in units: several inputs, what is up to date, and flags that count there."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import umbel
from helpers.commands import Umbel
from umbel.testing import giant

UNIT = ("--unit-triangles", 4000)


@pytest.fixture
def hill(tmp_path: Path) -> Path:
    giant.write(giant.terrain(6000, seed=3), tmp_path / "hill.ply")
    return tmp_path / "hill.ply"


Built = Callable[..., dict[str, Any]]


@pytest.fixture
def built(umbel_command: Umbel) -> Built:
    def build(*words: object) -> dict[str, Any]:
        done = umbel_command("build", *words, "--json")
        assert done.status == 0, done.err
        return done.json

    return build


@pytest.fixture
def parts(hill: Path, tmp_path: Path) -> list[Path]:
    """The hill in three files, each with the vertices that it needs."""
    mesh = umbel.load(hill)
    folder = tmp_path / "parts"
    folder.mkdir()
    for k, some in enumerate(np.array_split(mesh.triangles, 3)):
        used, triangles = np.unique(some, return_inverse=True)
        part = umbel.Mesh(mesh.positions[used], triangles.reshape(-1, 3).astype(np.uint32))
        umbel.save(folder / f"{k}.ply", part)
    return sorted(folder.iterdir())


def test_inputs_become_one_asset_where_it_is_named(
    built: Built, hill: Path, parts: list[Path], tmp_path: Path
) -> None:
    output = tmp_path / "scan.umbel"
    report = built(*parts, "-o", output, *UNIT)
    assert report["input"] == [str(path) for path in parts]
    assert report["input_triangles"] == len(umbel.load(hill).triangles)
    assert umbel.verify(output).ok
    source = umbel.Asset(output).info["metadata"]["source"]
    assert source["files"] == [path.name for path in parts]
    # The parts have joined: all is as in one file.
    built(hill, "-o", tmp_path / "one.umbel", *UNIT)
    one = umbel.Asset(tmp_path / "one.umbel")
    assert np.array_equal(umbel.Asset(output).tables.groups, one.tables.groups)
    # The folder is the same files in the same order.
    built(parts[0].parent, "-o", tmp_path / "again.umbel", *UNIT)
    assert (tmp_path / "again.umbel").read_bytes() == output.read_bytes()


def test_no_input_of_one_mesh_is_left_out(
    umbel_command: Umbel, parts: list[Path], tmp_path: Path
) -> None:
    folder, output = parts[0].parent, tmp_path / "scan.umbel"
    parts[1].unlink()
    parts[1].symlink_to("unmounted/1.ply")
    done = umbel_command("build", folder, "-o", output, *UNIT)
    assert done.status == 1 and "1.ply" in done.err and not output.exists()
    for flags in (UNIT, ("--ray", "local")):
        done = umbel_command("build", folder, "-o", output, *flags, "--keep-going")
        assert done.status == 1 and "needs all of its inputs" in done.err


def test_addresses_are_written_on_clusters_only(
    umbel_command: Umbel, hill: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for flags in (("-o", "memory://a.umbel"), ("-o", "a.umbel", "--work", "memory://work")):
        done = umbel_command("build", hill, *flags, *UNIT)
        assert done.status == 1 and "only --ray and --dask write to addresses" in done.err
    assert os.listdir(tmp_path) == ["hill.ply"]


def test_inputs_without_a_limit_are_assets_of_their_own(
    umbel_command: Umbel, hill: Path, tmp_path: Path
) -> None:
    done = umbel_command("build", hill, hill, "-o", tmp_path / "a.umbel")
    assert done.status == 1 and "with --memory" in done.err
    done = umbel_command("build", hill, "-o", f"{tmp_path}/", "--memory", "1GB")
    assert done.status == 1 and "-o OUT.umbel" in done.err


def test_what_is_up_to_date_is_left(built: Built, hill: Path, tmp_path: Path) -> None:
    output = tmp_path / "a.umbel"
    command = (hill, hill, "-o", output, *UNIT, "--skip-unchanged")
    assert built(*command)["status"] == "built"
    before = os.stat(output).st_mtime_ns
    assert built(*command)["status"] == "unchanged"
    assert os.stat(output).st_mtime_ns == before
    assert built(*command, "--overlap", 0.5)["status"] == "built"
    data = bytearray(hill.read_bytes())
    data[-4] ^= 1
    hill.write_bytes(data)
    assert built(*command, "--overlap", 0.5)["status"] == "built"


def test_assets_built_in_memory_are_up_to_date(built: Built, hill: Path, tmp_path: Path) -> None:
    output = tmp_path / "a.umbel"
    built(hill, "-o", output)
    assert built(hill, "-o", output, "--memory", "1GB", "--skip-unchanged")["status"] == "unchanged"


def test_costs_and_bits_count_in_units(built: Built, hill: Path, tmp_path: Path) -> None:
    mesh = umbel.load(hill)
    mesh.normals = mesh.positions * 0 + [0, 0, 1]
    umbel.save(tmp_path / "b.glb", mesh)
    flags = ("--underfill", 0, "--vertex-underfill", 0, "--overlap", 1, "--normal-bits", 8)
    one = built(tmp_path / "b.glb", "-o", tmp_path / "a.umbel", *UNIT)
    other = built(tmp_path / "b.glb", "-o", tmp_path / "b.umbel", *UNIT, *flags)
    assert other["clusters"] != one["clusters"]
    assert other["input_vertices"] == len(mesh.positions)
    info = umbel.Asset(tmp_path / "b.umbel").info
    assert info["normal_bits"] == 8
    assert info["metadata"]["config"]["overlap_cost"] == 1
    assert umbel.verify(tmp_path / "b.umbel").ok


def test_flags_that_units_do_not_have_are_named(
    umbel_command: Umbel, hill: Path, tmp_path: Path
) -> None:
    output = tmp_path / "a.umbel"
    done = umbel_command("build", hill, "-o", output, *UNIT, "--lock-borders")
    assert done.status == 1
    assert "--unit-triangles builds unit by unit, where --lock-borders is not possible" in done.err
    (tmp_path / "a.umbel.work").mkdir()
    done = umbel_command("build", hill, "-o", output, "--resume", "--precision", "16bits")
    assert done.status == 1
    assert "begun unit by unit, where --precision is not possible" in done.err


def test_peak_memory_of_workers_is_their_own(built: Built, hill: Path, tmp_path: Path) -> None:
    """They begin as copies of the process that starts them, which does not count."""
    ballast = np.ones(50_000_000)
    api = umbel.build_asset(hill, tmp_path / "a.umbel", unit_triangles=1000, workers=2)
    assert 5e6 < api["worker_peak_rss_bytes"] < ballast.nbytes / 2
    report = built(hill, "-o", tmp_path / "b.umbel", *UNIT)
    assert "worker_peak_rss_bytes" not in report
    assert report["peak_rss_bytes"] > report["workers"] * 5e6
