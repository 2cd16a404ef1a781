"""Heatmaps: boxes that each pixel's ray pierces."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import umbel
from helpers.commands import Umbel

CAMERA = umbel.Camera((0, 0, 4), (0, 0, 0))


def test_boxes_are_counted_where_they_are_seen() -> None:
    nested = np.array([[-0.1 * k, -0.1 * k, -0.1, 0.1 * k, 0.1 * k, 0.1] for k in (1, 2, 3)])
    counts = umbel.boxes_per_pixel(nested, CAMERA, 65, 65)
    assert counts.shape == (65, 65) and counts.dtype == np.uint32
    assert counts[32, 32] == 3 and counts[0, 0] == 0
    assert np.array_equal(np.unique(counts), [0, 1, 2, 3])
    assert np.array_equal(counts, counts.T[::-1, ::-1])  # a square in the middle
    with pytest.raises(umbel.Error, match="target"):
        umbel.boxes_per_pixel(nested, umbel.Camera((0, 0, 4)), 65, 65)
    with pytest.raises(umbel.Error, match="boxes"):
        umbel.boxes_per_pixel(np.zeros((2, 5)), CAMERA)
    with pytest.raises(umbel.Error, match="0 x 65"):
        umbel.boxes_per_pixel(nested, CAMERA, 0, 65)


def test_boxes_of_clusters_hold_their_triangles() -> None:
    mesh = umbel.shapes.blob(4)
    clusters = umbel.cluster_mesh(mesh)
    boxes = umbel.cluster_boxes(mesh, clusters)
    assert len(boxes) == len(clusters)
    for k in (0, len(clusters) - 1):
        items = clusters.items[clusters.offsets[k] : clusters.offsets[k + 1]]
        corners = mesh.positions[mesh.triangles[items]].reshape(-1, 3)
        assert np.array_equal(boxes[k], [*corners.min(axis=0), *corners.max(axis=0)])


def test_colours_rise_to_one_scale() -> None:
    counts = np.array([[0, 1, 2, 4, 8]])
    own, given = umbel.heatmap(counts), umbel.heatmap(counts, 16)
    assert own[0, 0].tolist() == [0, 0, 0] and own[0, 4].tolist() == [255, 255, 255]
    assert given[0, 4].tolist() == umbel.heatmap(np.array([[4, 8]]))[0, 0].tolist()
    assert umbel.heatmap(np.array([[99]]), 16).tolist() == [[[255, 255, 255]]]
    assert umbel.heatmap(np.zeros((2, 2))).max() == 0
    with pytest.raises(umbel.Error, match="most"):
        umbel.heatmap(counts, 0)


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    umbel.save(tmp_path / "blob.ply", umbel.shapes.blob(5))
    return tmp_path / "blob.ply"


def test_the_command_draws_any_clusters(umbel_command: Umbel, mesh: Path) -> None:
    out, npz = mesh.with_name("a.png"), mesh.with_name("c.npz")
    size = ("--width", 200, "--height", 150, "--json")

    def drawn(*words: object) -> dict[str, float]:
        done = umbel_command("render", mesh, "-o", out, "--heatmap", "overlap", *size, *words)
        assert done.status == 0, done.json
        with Image.open(out) as picture:
            assert picture.size == (200, 150)
        return dict(done.json)

    bisected = drawn()
    assert bisected["clusters"] > 50 and bisected["most_boxes"] >= bisected["mean_boxes"] > 1
    assert drawn("--clusters", "morton")["mean_boxes"] > bisected["mean_boxes"]
    assert umbel_command("cluster", mesh, "-o", npz).status == 0
    read = drawn("--clusters", npz, "--most", 20)
    assert {k: read[k] for k in ("clusters", "mean_boxes")} == {
        k: bisected[k] for k in ("clusters", "mean_boxes")
    }


def test_the_command_draws_cuts_of_assets(umbel_command: Umbel, mesh: Path) -> None:
    asset, out = mesh.with_name("a.umbel"), mesh.with_name("a.png")
    assert umbel_command("build", mesh, "-o", asset).status == 0
    words = ("render", asset, "-o", out, "--heatmap", "overlap", "--width", 200, "--height", 150)
    fine = umbel_command(*words, "--json").json
    coarse = umbel_command(*words, "--pixel-error", 20, "--json").json
    assert fine["clusters"] > coarse["clusters"] > 0
    assert fine["mean_boxes"] > 1


def test_boxes_of_instances_are_where_they_are_shown(tmp_path: Path) -> None:
    from umbel.cli.heatmaps import boxes_of_cuts

    turn = np.array([[0, -2, 0, 10], [2, 0, 0, 20], [0, 0, 2, 30], [0, 0, 0, 1]], np.float64)
    scene = umbel.io.Scene([umbel.shapes.blob(4)], [], [umbel.io.Instance(0, turn)])
    umbel.build_lod(scene).save(tmp_path / "a.umbel")
    asset = umbel.Asset(tmp_path / "a.umbel")
    shown = asset.scene_cuts(level=0)
    boxes = boxes_of_cuts(asset, shown)
    positions = asset.scene_mesh(shown).positions
    assert np.allclose(boxes[:, :3].min(axis=0), positions.min(axis=0), atol=1e-4)
    assert np.allclose(boxes[:, 3:].max(axis=0), positions.max(axis=0), atol=1e-4)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--clusters", "morton"], "--clusters and --most are for --heatmap"),
        (["--heatmap", "overlap", "--clusters", "nothing"], "bisect, morton, hybrid or a FILE.npz"),
        (["--heatmap", "overlap", "--clusters", "none.npz"], "none.npz"),
        (["--heatmap", "overlap", "--most", "0"], "--most must be at least 1"),
        (["--heatmap", "overlap", "--denoise"], "--heatmap traces no paths"),
    ],
)
def test_what_cannot_be_drawn_is_said(
    umbel_command: Umbel, mesh: Path, words: list[str], sentence: str
) -> None:
    done = umbel_command("render", mesh, "-o", mesh.with_name("a.png"), "--json", *words)
    assert done.status != 0
    assert sentence in done.json["error"]
    assert not mesh.with_name("a.png").exists()


def test_damaged_lists_of_clusters_are_refused(umbel_command: Umbel, mesh: Path) -> None:
    npz = mesh.with_name("c.npz")
    for arrays, sentence in [
        ({"items": [0, 1], "offsets": [0, 1]}, "offsets must rise"),
        ({"items": [0, 1], "offsets": [0, 2, 2]}, "offsets must rise"),
        ({"items": [10**6], "offsets": [0, 1]}, "another mesh"),
        ({"items": [0]}, "offsets"),
    ]:
        given: dict[str, Any] = {name: np.array(values) for name, values in arrays.items()}
        np.savez(npz, **given)
        done = umbel_command(
            "render", mesh, "-o", mesh.with_name("a.png"), "--heatmap", "overlap",
            "--clusters", npz, "--json",
        )  # fmt: skip
        assert done.status == 1
        assert sentence in done.json["error"], done.json
    npz.write_bytes(b"PK\x03\x04 no archive")
    done = umbel_command(
        "render", mesh, "-o", mesh.with_name("a.png"), "--heatmap", "overlap", "--clusters", npz
    )
    assert done.status == 1


def test_flags_that_have_no_effect_are_named(umbel_command: Umbel, mesh: Path) -> None:
    out, small = mesh.with_name("a.png"), ("--width", 32, "--height", 32, "--json")
    flags = ("--spp", 4, "--light", "1,1,1", "--ground", "--accel", "kdtree")
    heatmap = umbel_command("render", mesh, "-o", out, "--heatmap", "overlap", *flags, *small)
    assert heatmap.json["warnings"] == [
        f"{flag} has no effect: --heatmap traces no paths"
        for flag in ("--spp", "--light", "--ground", "--accel")
    ]
    counts = ("--heatmap", "overlap", "--most", 9)
    assert umbel_command("render", mesh, "-o", out, *counts, *small).json["warnings"] == []
    done = umbel_command("render", mesh, "-o", out.with_suffix(".exr"), *counts, *small)
    assert done.json["warnings"] == ["--most has no effect: an .exr has the counts as they are"]
    used = ("--spp", 4, "--light", "1,1,1", "--exposure", 1)
    assert umbel_command("render", mesh, "-o", out, *used, *small).json["warnings"] == []


def test_hidden_materials_have_no_boxes(umbel_command: Umbel, tmp_path: Path) -> None:
    mesh = umbel.shapes.grid(40, 40)
    middle = mesh.positions[mesh.triangles].mean(axis=1)[:, 0]
    mesh.material_ids = (middle > np.median(middle)).astype(np.uint32)
    mesh.materials = [umbel.Material(name=name) for name in ("left", "right")]
    asset, out = tmp_path / "a.umbel", tmp_path / "a.png"
    umbel.build_lod(mesh).save(asset)
    view = ("--camera", "0.5,0.5,2:0.5,0.5,0", "--width", 64, "--height", 64)
    flags = ("--heatmap", "overlap", "--pixel-error", 0.001, *view, "--json")

    def shown(*hide: str) -> Any:
        done = umbel_command("render", asset, "-o", out, *flags, *hide)
        return done.json["clusters"]

    left, right = shown("--hide", "right"), shown("--hide", "left")
    assert left > 0 and right > 0 and left + right == shown()
