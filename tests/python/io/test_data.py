"""Real meshes: every file of the data folder, by the counts and the bounds that it lists."""

from __future__ import annotations

import json
import re
import sys
import warnings
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest

from helpers.commands import DATA
from umbel.errors import LoadWarning
from umbel.io import load, save


def listed() -> dict[str, int]:
    """File name to triangles as drawn, from the folder's README."""
    if not (DATA / "README.md").exists():
        return {}
    out = {}
    for line in (DATA / "README.md").read_text().splitlines():
        cells = [c.strip() for c in line.split("|")]
        if len(cells) > 3 and re.fullmatch(r"\S+\.(ply|glb|obj)", cells[1]):
            out[cells[1]] = int(cells[2].replace(",", ""))
    return out


def boxes() -> dict[str, np.ndarray]:
    manifest = DATA / "manifest.json"
    if not manifest.exists():
        return {}
    entries = json.loads(manifest.read_text())
    return {e["name"]: np.array(e["bbox"], float) for e in entries if e.get("bbox")}


COUNTS = listed()
BOXES = boxes()
pytestmark = pytest.mark.skipif(not COUNTS, reason="no data folder")


def quiet_load(path: Path):  # type: ignore[no-untyped-def]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LoadWarning)
        return load(path)


@pytest.mark.parametrize("name", sorted(COUNTS))
def test_triangles_are_those_listed(name: str) -> None:
    mesh = quiet_load(DATA / name)
    assert len(mesh.triangles) == COUNTS[name]
    inside = (mesh.triangles < len(mesh.positions)).all()
    assert inside == (name != "nasty_synth_index_out_of_range.ply")
    box = BOXES.get(name)
    if box is not None and mesh.bounds is not None and np.isfinite(box).all():
        size = np.abs(box).max()
        assert np.abs(mesh.bounds - box).max() <= 1e-5 * size
    if mesh.normals is not None:
        lengths = np.linalg.norm(mesh.normals[mesh.triangles.reshape(-1)], axis=1)
        assert np.mean(np.abs(lengths - 1) < 1e-2) > 0.99
    if mesh.material_ids is not None and len(mesh.triangles):
        assert int(mesh.material_ids.max()) < len(mesh.materials)


@pytest.mark.parametrize(
    "name", ["dragon_871k.ply", "head_mri_iso_1437k.ply", "sponza_dabrovic_66k.obj"]
)
def test_large_files_are_read_as_arrays(name: str) -> None:
    if name not in COUNTS:
        pytest.skip(f"no {name}")
    lines = 0

    def count(frame: FrameType, event: str, value: object) -> Any:
        nonlocal lines
        lines += event == "line"
        return count

    sys.settrace(count)
    quiet_load(DATA / name)
    sys.settrace(None)
    # Far fewer lines of Python than the file has vertices.
    assert 0 < lines < 10_000


@pytest.mark.parametrize("extension", [".glb", ".ply", ".obj"])
@pytest.mark.parametrize("name", ["car_lamborghini.glb", "statue_athena_uv_normals.ply"])
def test_real_meshes_come_back_to_the_bit(tmp_path: Path, name: str, extension: str) -> None:
    if name not in COUNTS:
        pytest.skip(f"no {name}")
    mesh = quiet_load(DATA / name)
    path = tmp_path / f"copy{extension}"
    save(path, mesh)
    back = quiet_load(path)
    for key in ("positions", "uvs", "triangles"):
        assert getattr(back, key).tobytes() == getattr(mesh, key).tobytes(), key
    given = mesh.normals.any(axis=1)  # glTF forbids normals of length zero, which get a direction
    kept = given if extension == ".glb" else np.ones_like(given)
    assert back.normals[kept].tobytes() == mesh.normals[kept].tobytes()
    assert back.normals.any(axis=1)[~given].all() == (extension == ".glb" or given.all())
    if mesh.colors is not None:
        # PLY has bytes of sRGB, whose steps are up to 2.3 / 255 apart.
        assert np.abs(back.colors[:, :3] - mesh.colors[:, :3]).max() <= 1.2 / 255
