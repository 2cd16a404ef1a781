"""Pictures by path tracing as a device makes them, run on the processor from packed scenes to the
page of results."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import umbel
from umbel import shapes
from umbel.bench.bvh.paths import path_view
from umbel.bench.bvh.plant import plant
from umbel.bench.bvh.scenes import scene

ROOT = Path(__file__).resolve().parents[3]
PROGRAM = ROOT / "build/release/bench/device_paths_bench"
SIZE = (64, 48)


def script(name: str, *words: object, check: bool = True) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, ROOT / "bench" / name, *map(str, words)],
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=check,
    )


@pytest.fixture(scope="module")
def packed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scenes")
    ball = shapes.blob(4)
    # Numbered at random, with vertices that nothing uses and two triangles without area.
    dice = np.random.default_rng(1)
    order = dice.permutation(len(ball.positions) + 5)
    positions = np.zeros((len(order), 3), np.float32)
    positions[order[: len(ball.positions)]] = ball.positions
    triangles = order[ball.triangles].astype(np.uint32)
    triangles[[7, 70]] = triangles[[7, 70], :1]
    umbel.save(folder / "ball.ply", umbel.Mesh(positions, triangles))
    script("device_scenes.py", folder / "packed", "--plant", 20_000, folder / "ball.ply")
    return folder


@pytest.mark.parametrize("name", ["ball", "plant"])
def test_meshes_are_unpacked_bit_by_bit(packed: Path, tmp_path: Path, name: str) -> None:
    given = plant(20_000) if name == "plant" else umbel.load(packed / "ball.ply")
    script("device_paths.py", "unpack", packed / "packed", name, tmp_path / "out.ply")
    found = umbel.load(tmp_path / "out.ply")
    corners = given.positions[given.triangles].view(np.uint32)
    assert np.array_equal(found.positions[found.triangles].view(np.uint32), corners)
    assert len(found.positions) <= len(given.positions)


def test_scenes_are_those_of_the_processor_s_comparison(packed: Path) -> None:
    found = json.loads((packed / "packed/scenes.json").read_text())
    assert list(found) == ["ball", "plant"]  # the smallest first
    for name, load in {"ball": lambda: umbel.load(packed / "ball.ply"), "plant": None}.items():
        on = scene(name, load or (lambda: plant(20_000)))
        assert found[name]["kmeans"] == list(on.kmeans.arguments().values())
        for numbers, camera in zip(found[name]["cameras"], on.cameras, strict=True):
            assert tuple(numbers[:3]) == tuple(camera.position)
            assert tuple(numbers[3:6]) == tuple(camera.target)


def traced(packed: Path, out: Path, name: str, *words: object) -> dict:
    if not PROGRAM.is_file():
        pytest.skip(f"{PROGRAM.name} is not built")
    size = ",".join(map(str, SIZE))
    given = ("--size", size, "--runs", 1, *words)
    script("device_paths.py", "run", packed / "packed", name, out / f"{name}.json", PROGRAM, *given)
    return json.loads((out / f"{name}.json").read_text())


@pytest.mark.parametrize("name", ["ball", "plant"])
def test_there_are_as_many_rays_as_in_python(packed: Path, tmp_path: Path, name: str) -> None:
    found = traced(packed, tmp_path, name, "--samples", 8, "--pass", 4, "--builder", "lbvh")
    on = scene(name, lambda: plant(20_000) if name == "plant" else umbel.load(packed / "ball.ply"))
    bvh = umbel.Bvh(on.mesh)
    views = found["builders"][0]["views"]
    assert found["paths"] == 8 * SIZE[0] * SIZE[1] * len(on.cameras)
    for own, camera in zip(views, on.cameras, strict=True):
        view = path_view(bvh, on.mesh, camera, samples=8, size=SIZE)
        shadows = sum(len(batch) for batch in view.batches if batch.shadow)
        assert own["shadows"] == pytest.approx(shadows, rel=0.06)
        assert own["nearest"] == pytest.approx(view.rays - shadows, rel=0.06)


def test_rays_are_the_same_each_time_and_for_each_builder(packed: Path, tmp_path: Path) -> None:
    words = ("--samples", 2, "--pass", 2)

    def rays(*builders: str) -> list[tuple[int, int]]:
        given = (word for name in builders for word in ("--builder", name))
        found = traced(packed, tmp_path, "plant", *words, *given)
        assert [b["builder"] for b in found["builders"]] == list(builders)
        each = [[(v["nearest"], v["shadows"]) for v in b["views"]] for b in found["builders"]]
        assert all(views == each[0] for views in each)
        return each[0]

    # That all have the same hits is what the program itself looks at.
    everyone = rays("sweep", "lbvh", "hlbvh", "atrbvh", "ploc", "hploc", "kmeans 2016", "kmeans")
    assert everyone == rays("hploc")


def test_the_page_compares_and_what_is_unfinished_is_missing(packed: Path, tmp_path: Path) -> None:
    few = ("--builder", "sweep", "--builder", "kmeans")
    traced(packed, tmp_path, "ball", "--samples", 2, *few)
    # No second pass begins.
    cut = traced(packed, tmp_path, "plant", "--samples", 2, "--pass", 1, "--seconds", 0, *few)
    assert (cut["samples"], cut["samples_wanted"]) == (1, 2)
    assert script("device_paths.py", "missing", packed / "packed", tmp_path).stdout == "plant\n"
    script("device_paths.py", "report", tmp_path, tmp_path / "page.md")
    page = (tmp_path / "page.md").read_text()
    assert "| builder | ball | plant | mean |" in page
    assert page.count("| sweep | 1.000 | 1.000 | 1.000 |") == 4  # speed, two totals, SAH cost
    assert "Of plant time ran out" in page
    assert "k 16, p 5, i 5" in page


def test_what_fails_leaves_no_result(packed: Path, tmp_path: Path) -> None:
    done = script(
        "device_paths.py", "run", packed / "packed", "ball", tmp_path / "ball.json", "false",
        check=False,
    )  # fmt: skip
    assert done.returncode != 0 and "ended with status 1" in done.stderr
    assert not list(tmp_path.iterdir())
