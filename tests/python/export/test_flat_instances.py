"""Exports of assets with instances that are flattened: of scale 0 along an axis."""

from pathlib import Path

import numpy as np
import pytest

import umbel
from umbel.io import load_scene

FLAT = np.diag([1.0, 0.0, 1.0, 1.0])


@pytest.fixture
def flat(tmp_path: Path) -> umbel.Asset:
    lod = umbel.build_lod(umbel.shapes.blob(4, seed=1))
    beside = np.eye(4)
    beside[0, 3] = 5
    umbel.save_asset(tmp_path / "a.umbel", [lod], [(0, FLAT), (0, beside)])
    return umbel.Asset(tmp_path / "a.umbel")


def test_cuts_by_error_have_the_detail_that_they_are_asked_for(flat: umbel.Asset) -> None:
    fine, coarse = flat.scene_cuts(error=0.0), flat.scene_cuts(error=0.05)
    whole = len(flat.tables.cut(level=0))
    assert [len(one.cut) for one in fine] == [whole, whole]
    assert 1 < len(coarse[0].cut) == len(coarse[1].cut) < whole
    shown = flat.scene_cuts(triangles=2000)
    assert flat.scene_mesh(shown).triangles.shape[0] <= 2000


def test_exports_have_all_of_a_flat_instance(flat: umbel.Asset, tmp_path: Path) -> None:
    umbel.export_tiles(flat, tmp_path / "tiles", flatten=True)
    triangles = 0
    flattened = 0
    for path in (tmp_path / "tiles").rglob("*.glb"):
        mesh = load_scene(path).flatten()
        triangles += len(mesh.triangles)
        height = np.abs(mesh.positions[mesh.triangles][:, :, 1]).max(axis=1)
        flattened += int((height < 1e-3).sum())
    source = flat.meshes[0]["source_triangles"]
    assert triangles >= 1.99 * source  # flat triangles may become lines
    assert flattened >= 0.9 * source
