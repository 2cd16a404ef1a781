"""`umbel bench clusters`: what it compares, what it writes, how it ends."""

from __future__ import annotations

import contextlib
import csv
import importlib.util
import json
import math
import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import umbel
from helpers.commands import COMMAND, Outcome, Umbel
from umbel import _peers as peers
from umbel import _umbel
from umbel.bench import charts, table, timing
from umbel.bench.clusters import BASELINE, PROCEDURAL, compare, methods, write
from umbel.geometry.arrays import native

ROW_FIELDS = {
    "mesh",
    "triangles",
    "method",
    "threads",
    "seconds",
    "mtriangles_per_second",
    "ratio",
    "clusters",
    "mean_fill",
    "mean_vertices",
    "surface_area_ratio",
    "sah",
    "overlap",
}
HAS_MATPLOTLIB = importlib.util.find_spec("matplotlib") is not None


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two small meshes in files of the same stem."""
    folder = tmp_path_factory.mktemp("small")
    paths = [folder / "a mesh.ply", folder / "a mesh.obj"]
    umbel.save(paths[0], umbel.shapes.blob(4))
    umbel.save(paths[1], umbel.shapes.terrain(40, 40))
    return paths


def assert_partition(items: np.ndarray, ranges: np.ndarray, triangles: int) -> None:
    assert np.array_equal(np.sort(items), np.arange(triangles))
    assert np.array_equal(ranges[:, 0], np.cumsum(ranges[:, 1]) - ranges[:, 1])
    assert ranges[:, 1].sum() == triangles


@pytest.mark.parametrize("name", [method.name for method in methods(2)])
def test_every_method_makes_clusters_of_the_same_mesh(name: str) -> None:
    (method,) = [method for method in methods(2) if method.name == name]
    mesh = umbel.shapes.blob(4)
    items, ranges, seconds = method.make(native(mesh))
    assert_partition(items, ranges, len(mesh.triangles))
    assert ranges[:, 1].max() <= 128 and seconds >= 0
    if "v128" in method.name:
        for offset, count in ranges:
            assert len(np.unique(mesh.triangles[items[offset : offset + count]])) <= 128


def test_ours_are_what_the_package_builds() -> None:
    mesh = umbel.shapes.blob(4)
    for preset in ("quality", "fast", "exact"):
        config = _umbel.cluster_preset(preset, 128)
        items, _, _ = _umbel.timed_cluster_mesh(native(mesh), config)
        assert np.array_equal(items, umbel.cluster_mesh(mesh, preset=preset).items)
    items, _, _ = _umbel.timed_cluster_mesh(native(mesh), config, morton=True)
    assert np.array_equal(items, umbel.cluster_mesh(mesh, method="morton").items)


def test_meshlets_of_equal_triangles_are_told_apart() -> None:
    mesh = umbel.shapes.blob(3)
    twice = umbel.Mesh(mesh.positions, np.vstack([mesh.triangles, np.roll(mesh.triangles, 1, 1)]))
    for make in (peers.meshlets_spatial, peers.meshlets_flex):
        items, ranges, _ = make(native(twice))
        assert_partition(items, ranges, len(twice.triangles))


@pytest.mark.parametrize(
    ("limits", "word"),
    [
        ({"max_vertices": 2}, "max_vertices"),
        ({"max_vertices": 257}, "max_vertices"),
        ({"max_triangles": 513}, "max_triangles"),
        ({"min_triangles": 0}, "min_triangles"),
        ({"min_triangles": 129}, "min_triangles"),
        ({"fill_weight": -1.0}, "weight"),
        ({"fill_weight": math.nan}, "weight"),
    ],
)
def test_limits_that_meshoptimizer_refuses_are_named(limits: dict, word: str) -> None:
    with pytest.raises(umbel.Error, match=word):
        peers.meshlets_spatial(native(umbel.shapes.grid(2, 2)), **limits)


def test_meshlets_of_a_broken_mesh_are_refused() -> None:
    broken = umbel.Mesh(np.zeros((3, 3), np.float32), np.array([[0, 1, 7]], np.uint32))
    for make in (peers.meshlets_spatial, peers.meshlets_flex):
        with pytest.raises(umbel.Error, match="7"):
            make(native(broken))


def test_no_triangles_make_no_meshlets() -> None:
    empty = umbel.Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    for make in (peers.meshlets_spatial, peers.meshlets_flex):
        items, ranges, _ = make(native(empty))
        assert len(items) == 0 and len(ranges) == 0


def test_methods_take_turns_and_medians_are_kept() -> None:
    order: list[str] = []

    def entry(name: str, seconds: list[float]) -> timing.Timed[str]:
        def work() -> tuple[str, float]:
            order.append(name)
            return name, seconds.pop()

        return timing.Timed(name, work)

    told: list[tuple[float, str]] = []
    entries = [entry("a", [3.0, 1.0, 2.0]), entry("b", [9.0, 0.0, 0.0])]
    found = timing.take_turns(entries, 3, lambda fraction, what: told.append((fraction, what)))
    assert order == list("ababab")
    assert [(timed.result, timed.seconds) for timed in found] == [
        ("a", 2.0),
        ("b", timing.RESOLUTION),
    ]
    assert [what for _, what in told] == order
    assert [fraction for fraction, _ in told] == pytest.approx([i / 6 for i in range(6)])


def test_rows_hold_together() -> None:
    found = compare({"blob": lambda: umbel.shapes.blob(4)}, runs=1, threads=2)
    names = [row["method"] for row in found.rows]
    assert names == [method.name for method in methods(2)] and len(set(names)) == len(names)
    baseline = found.rows[names.index(BASELINE)]
    for row in found.rows:
        assert set(row) == ROW_FIELDS
        assert row["triangles"] == 5120 and row["seconds"] > 0
        assert row["mtriangles_per_second"] == pytest.approx(5120e-6 / row["seconds"])
        assert row["ratio"] == pytest.approx(baseline["seconds"] / row["seconds"])
        assert row["mean_fill"] == pytest.approx(5120 / (row["clusters"] * 128))
        assert row["threads"] == (2 if "threads" in row["method"] else 1)
    assert baseline["ratio"] == 1
    exact = found.rows[names.index("exact")]
    assert exact["mean_fill"] == 1.0
    morton = found.rows[names.index("Morton")]
    assert morton["surface_area_ratio"] > 1.5 * exact["surface_area_ratio"]


def test_means_are_geometric() -> None:
    rows = [{"method": "a", "x": 2.0}, {"method": "b", "x": 0.0}, {"method": "a", "x": 8.0}]
    assert table.geometric_means(rows, "method", ["x"]) == [
        {"method": "a", "x": pytest.approx(4.0)},
        {"method": "b", "x": None},
    ]


def test_a_comparison_can_be_cancelled() -> None:
    told: list[float] = []

    def progress(fraction: float, _what: str) -> np.bool_:
        told.append(fraction)
        return np.int64(len(told)) < 4

    with pytest.raises(umbel.Cancelled):
        compare({"grid": lambda: umbel.shapes.grid(9, 9)}, runs=2, progress=progress)
    assert len(told) == 4 and told == sorted(told)


def test_command_writes_tables_and_charts(
    umbel_command: Umbel, small: list[Path], tmp_path: Path
) -> None:
    folder = tmp_path / "new" / "folder"
    done = umbel_command(
        *["bench", "clusters", *small, "-o", folder, "--runs", 1, "--threads", 2, "--json"]
    )
    assert done.status == 0, done.err
    said = done.json
    assert set(said) == {"rows", "means", "frontier", "machine", "input", "output", "warnings"}
    assert {row["mesh"] for row in said["rows"]} == {"a mesh", "a mesh-2"}
    assert all(set(row) == ROW_FIELDS for row in said["rows"])
    assert len(said["means"]) == len(methods(2))
    for mean in said["means"]:
        own = [row["ratio"] for row in said["rows"] if row["method"] == mean["method"]]
        assert mean["ratio"] == pytest.approx(math.sqrt(own[0] * own[1]))
    assert said["machine"]["cores"] >= 1 and said["machine"]["cpu"]

    with (folder / "clusters.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["seconds"]) for row in rows] == [row["seconds"] for row in said["rows"]]
    with (folder / "clusters_frontier.csv").open(newline="") as file:
        assert len(list(csv.DictReader(file))) == len(said["frontier"])
    text = (folder / "clusters.md").read_text()
    assert said["machine"]["cpu"] in text and "Geometric means" in text
    for row in said["rows"]:
        assert f"| {row['mesh']} | {row['triangles']:,d} | {row['method']} |" in text

    images = {"clusters_a_mesh.png", "clusters_a_mesh-2.png", "clusters_frontier.png"}
    if HAS_MATPLOTLIB:
        for name in images:
            data = (folder / name).read_bytes()
            assert data.startswith(b"\x89PNG\r\n\x1a\n") and len(data) > 5000
    written = {path.name for path in folder.iterdir()}
    assert written - images == {"clusters.md", "clusters.csv", "clusters_frontier.csv"}


def test_without_input_procedural_shapes_are_compared(umbel_command: Umbel) -> None:
    done = umbel_command("bench", "clusters", "--runs", 1, "--json")
    assert done.status == 0, done.err
    assert list(dict.fromkeys(row["mesh"] for row in done.json["rows"])) == list(PROCEDURAL)
    assert done.json["frontier"] == []


def test_output_elsewhere_than_a_terminal_is_markdown(
    umbel_command: Umbel, small: list[Path]
) -> None:
    done = umbel_command("bench", "clusters", small[0], "--runs", 1, "--threads", 1)
    assert done.status == 0 and done.out.startswith("# Clusters")
    assert "| a mesh | 5,120 | quality | 1 |" in done.out and "threads |" in done.out
    assert "quality, " not in done.out  # one thread was asked for


def test_on_a_terminal_it_is_a_table(small: list[Path]) -> None:
    leader, follower = pty.openpty()
    done = subprocess.Popen(
        [*COMMAND, "bench", "clusters", str(small[0]), "--runs", "1"],
        stdout=follower,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "COLUMNS": "200"},
    )
    os.close(follower)
    out = b""
    with contextlib.suppress(OSError):
        while block := os.read(leader, 1 << 16):
            out += block
    os.close(leader)
    assert done.wait() == 0
    assert "┃" in out.decode() and "meshoptimizer Spatial v128" in out.decode()


def test_charts_are_left_out_where_matplotlib_is_missing(small: list[Path], tmp_path: Path) -> None:
    # A module that hides matplotlib from the command.
    (tmp_path / "sitecustomize.py").write_text(
        "import importlib.util as u\n"
        "find = u.find_spec\n"
        "u.find_spec = lambda name, *a: None if name == 'matplotlib' else find(name, *a)\n"
    )
    folder = tmp_path / "out"
    command = [*COMMAND, "bench", "clusters", str(small[0]), "-o", str(folder), "--runs", "1"]
    done = subprocess.run(
        [*command, "--json"],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
    )
    outcome = Outcome(done.returncode, done.stdout, done.stderr)
    assert outcome.status == 0 and json.loads(outcome.out)["rows"]
    assert charts.WITHOUT in outcome.err
    assert {path.suffix for path in folder.iterdir()} == {".md", ".csv"}


@pytest.mark.skipif(not HAS_MATPLOTLIB, reason="needs matplotlib")
def test_writing_returns_what_was_written(tmp_path: Path) -> None:
    found = compare({"flat / odd": lambda: umbel.shapes.grid(30, 30)}, runs=1, frontier=True)
    paths = write(found, tmp_path)
    assert sorted(paths) == sorted(tmp_path.iterdir())
    assert tmp_path / "clusters_flat___odd.png" in paths


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda path: None, "no such file"),
        (lambda path: path.mkdir(), "folder"),
        (lambda path: path.write_bytes(b""), "empty"),
        (lambda path: path.write_bytes(b"ply\nformat nonsense\n"), "mesh.ply"),
        (
            lambda path: umbel.save(
                path, umbel.Mesh(np.zeros((3, 3), np.float32), np.zeros((0, 3), np.uint32))
            ),
            "no triangles",
        ),
        (
            lambda path: umbel.save(
                path, umbel.Mesh(np.full((3, 3), np.nan), np.array([[0, 1, 2]]))
            ),
            "not finite|NaN|nan",
        ),
    ],
)
def test_inputs_at_fault_end_with_one_sentence(
    umbel_command: Umbel, tmp_path: Path, make, word: str
) -> None:
    path = tmp_path / "mesh.ply"
    make(path)
    done = umbel_command("bench", "clusters", path, "--json")
    assert done.status == 1 and done.json["input"] == str(path)
    *warned, sentence = done.err.strip().splitlines()
    assert re.search(word, sentence) and all("warning: " in line for line in warned)


def test_an_output_that_is_a_file_is_refused(
    umbel_command: Umbel, small: list[Path], tmp_path: Path
) -> None:
    (tmp_path / "out").write_text("mine")
    for place in (tmp_path / "out", tmp_path / "out" / "below"):
        done = umbel_command("bench", "clusters", small[0], "-o", place)
        assert done.status == 1 and len(done.err.strip().splitlines()) == 1
    assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.parametrize("arguments", [("--runs", "0"), ("--threads", "-1"), ("--what",)])
def test_wrong_usage_exits_with_2(umbel_command: Umbel, arguments: tuple[str, ...]) -> None:
    assert umbel_command("bench", "clusters", *arguments).status == 2


def test_help_names_the_comparisons(umbel_command: Umbel) -> None:
    assert "clusters" in umbel_command("bench", "--help").out
    assert "--runs" in umbel_command("bench", "clusters", "--help").out


def test_without_other_libraries_ours_are_compared(tmp_path: Path) -> None:
    """As users install the package: there is no umbel._peers."""
    code = """
import sys
sys.modules["umbel._peers"] = None
import umbel
from umbel.bench import clusters, lod
mesh = umbel.shapes.blob(4)
for bench, options in (clusters, {"runs": 1, "frontier": True}), (lod, {"samples": 500}):
    found = bench.compare({"blob": lambda: mesh}, **options)
    print(sorted({row["method"] for row in found.rows}), "no other" in bench.report(found))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    clusters, lod = done.stdout.splitlines()
    assert "'quality'" in clusters and "meshoptimizer" not in clusters and "True" in clusters
    assert lod == "['umbel'] True"
