"""Files that change while a build in units reads them."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import umbel
from umbel.scale.build_asset import build_asset
from umbel.testing import giant


class Changes:
    """Progress that replaces a file once, when a stage begins."""

    def __init__(self, path: Path, data: bytes, stage: str) -> None:
        self.path, self.data, self.stage = path, data, stage

    def __call__(self, fraction: float, stage: str) -> None:
        if self.data and stage.startswith(self.stage):
            self.path.write_bytes(self.data)
            os.utime(self.path, (1e9, 1e9))
            self.data = b""


@pytest.fixture
def hill(tmp_path: Path) -> tuple[Path, bytes]:
    """A file, and other contents of the same size."""
    path = tmp_path / "hill.ply"
    giant.write(giant.terrain(12_000, seed=3), path)
    before = path.read_bytes()
    mesh = umbel.load(path)
    mesh.positions = mesh.positions + np.float32(7)
    umbel.save(path, mesh)
    other = path.read_bytes()
    path.write_bytes(before)
    return path, other


@pytest.mark.parametrize("stage", ["dividing", "sorting"])
def test_a_file_that_changes_while_it_is_read_is_refused(
    hill: tuple[Path, bytes], tmp_path: Path, stage: str
) -> None:
    path, other = hill
    output = tmp_path / "a.umbel"
    with pytest.raises(umbel.Error, match=r"hill\.ply has changed while it was read"):
        build_asset(path, output, unit_triangles=4000, progress=Changes(path, other, stage))
    assert os.listdir(tmp_path) == ["hill.ply"]
    build_asset(path, output, unit_triangles=4000)
    assert umbel.verify(output, 4).ok


def test_what_has_been_read_may_change(hill: tuple[Path, bytes], tmp_path: Path) -> None:
    path, other = hill
    build_asset(path, tmp_path / "a.umbel", unit_triangles=4000)
    progress = Changes(path, other, "tier 2")
    build_asset(path, tmp_path / "b.umbel", unit_triangles=4000, progress=progress)
    assert not progress.data
    assert (tmp_path / "a.umbel").read_bytes() == (tmp_path / "b.umbel").read_bytes()
