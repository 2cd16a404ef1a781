"""`umbel bench`: what it says of its flags, and which inputs it takes."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

import umbel
from helpers.commands import Umbel


@pytest.mark.parametrize(
    ("flags", "named"),
    [
        (("--builder", "nope"), "nope"),
        (("--part", "nope"), "--part"),
        (("--kmeans", "1,5,2"), "--kmeans"),
        (("--generated", 5), "--generated"),
        (("--device", "cuda"), "cuda_bvh_bench"),
    ],
)
def test_flags_are_checked_before_a_scene_is_read(
    umbel_command: Umbel, tmp_path: Path, flags: tuple[object, ...], named: str
) -> None:
    empty = tmp_path / "empty.ply"
    empty.touch()
    env = {**os.environ, "UMBEL_CUDA_BVH_BENCH": str(tmp_path / "cuda_bvh_bench")}
    done = umbel_command("bench", "bvh", empty, *flags, env=env)
    assert done.status == 1 and named in done.err and "is empty" not in done.err


def test_streaming_takes_inputs_of_one_name(
    umbel_command: Umbel, small_ply: Path, tmp_path: Path
) -> None:
    other = tmp_path / small_ply.name
    shutil.copyfile(small_ply, other)
    done = umbel_command("bench", "stream", small_ply, other, "--seconds", 0.1, "--json")
    assert {row["asset"] for row in done.json["rows"]} == {"blob", "blob-2"}


def test_streaming_ends(umbel_command: Umbel) -> None:
    assert umbel_command("bench", "stream", "--seconds", "inf").status == 2


@pytest.mark.parametrize("corners", [0, 3])
def test_streaming_needs_an_extent(umbel_command: Umbel, tmp_path: Path, corners: int) -> None:
    mesh = umbel.Mesh(np.ones((corners, 3)), np.arange(corners).reshape(-1, 3))
    umbel.build_lod(mesh).save(tmp_path / "a.umbel")
    done = umbel_command("bench", "stream", tmp_path / "a.umbel")
    assert done.status == 1 and "a has no extent" in done.err
    assert len(done.err.splitlines()) == 1
