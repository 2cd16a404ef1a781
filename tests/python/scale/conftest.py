"""Tiles of one mesh, and the asset that one process makes of them in units of 4,000 triangles."""

from __future__ import annotations

from pathlib import Path

import pytest

from umbel.scale.build_asset import build_asset
from umbel.testing import giant


@pytest.fixture(scope="module")
def tiles(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("tiles")
    giant.write_tiles(giant.scan(40_000, seed=3), folder, ".ply")
    return sorted(folder.glob("*.ply"))


@pytest.fixture(scope="module")
def made_of_tiles(tiles: list[Path]) -> bytes:
    output = tiles[0].parent / "expected.umbel"
    build_asset(tiles, output, unit_triangles=4000, workers=1, threads=1)
    return output.read_bytes()
