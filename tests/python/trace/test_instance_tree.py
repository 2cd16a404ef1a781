"""Pictures of scenes of very many instances."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import umbel
from helpers.commands import Umbel
from umbel.trace.cut_renderer import CutRenderer, _spread

SIDE = 270


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("many") / "many.umbel"
    matrices = np.tile(np.eye(4, dtype=np.float32)[:3], (SIDE * SIDE, 1, 1))
    matrices[:, 0, 3] = 3 * (np.arange(SIDE * SIDE) % SIDE)
    matrices[:, 2, 3] = 3 * (np.arange(SIDE * SIDE) // SIDE)
    lod = umbel.build_lod(umbel.shapes.blob(4, seed=1))
    umbel.save_asset(path, [lod], umbel.Placements(matrices))
    return path


def picture(renderer: CutRenderer, camera: umbel.Camera) -> np.ndarray:
    return renderer.film(camera, width=96, height=64).add(16).pixels


def test_a_picture_with_stand_ins_is_like_one_of_all_instances(saved: Path) -> None:
    asset = umbel.Asset(saved)
    camera = umbel.Camera((-30, 40, -30), (300, 0, 300), height=64, pixel_error=0.5)
    fine = CutRenderer(asset, replace(camera, pixel_error=0.01), 4 << 30)
    some = CutRenderer(asset, camera, 4 << 30)
    assert some.triangles < fine.triangles / 4
    a, b = picture(some, camera), picture(fine, camera)
    assert abs(a.mean() - b.mean()) < 0.05 * b.mean()
    assert np.abs(a - b).mean() < 0.15 * b.mean()


def test_what_is_outside_the_picture_is_left_out_of_the_cameras_cut(saved: Path) -> None:
    asset = umbel.Asset(saved)
    camera = umbel.Camera((300, 5, 300), (400, 0, 300), height=64)
    whole = CutRenderer(asset, camera, 4 << 30, bounce_error=8)
    within = CutRenderer(asset, camera, 4 << 30, bounce_error=8, aspect=1.5)
    assert within.triangles < 0.7 * whole.triangles
    # Only noise may differ where triangles are other ones at the same places.
    a, b = picture(within, camera), picture(whole, camera)
    assert np.abs(a - b).mean() < 0.02 * b.mean()


def test_the_command_renders_and_says_what_it_cannot(umbel_command: Umbel, saved: Path) -> None:
    out = saved.parent / "a.png"
    size = ["--width", 60, "--height", 40, "--spp", 1]
    said = umbel_command("render", saved, "-o", out, *size, "--json").json
    assert out.stat().st_size > 500
    assert said["triangles"] > 0 and said["scene_bytes"] < 2_000_000_000
    for arguments, word in (("--accel", "bvh"), "tree"), (("--ground",), "--ground"):
        refused = umbel_command("render", saved, "-o", out, *size, *arguments)
        assert refused.status == 1 and word in refused.err
    info = umbel_command("info", saved, "--json").json
    assert info["instances"] == SIDE * SIDE
    assert info["input_triangles"] == SIDE * SIDE * info["stored_triangles"]


def test_cuts_of_a_tree_are_by_error_or_camera(saved: Path) -> None:
    asset = umbel.Asset(saved)
    cuts = asset.scene_cuts(error=20.0)
    assert 0 < len(cuts) < SIDE * SIDE
    with pytest.raises(umbel.Error, match="tree"):
        asset.scene_cuts(level=0)


def test_tables_spread_over_instances() -> None:
    table = np.array([[2, 9, 0, 0], [0, 5, 0, 0], [2, 8, 0, 1]], np.uint32)
    spread = _spread(table, np.array([2, 0, 1, 2]))
    assert spread[:, 0].tolist() == [0, 0, 1, 3, 3]
    assert spread[:, 1].tolist() == [9, 8, 5, 9, 8]
