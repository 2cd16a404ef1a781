"""`umbel export`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import umbel
from helpers.commands import Umbel


@pytest.fixture
def asset(tmp_path: Path) -> Path:
    umbel.build_lod(umbel.shapes.blob(5, seed=1)).save(tmp_path / "a.umbel")
    return tmp_path / "a.umbel"


def test_tiles_and_what_is_said_of_them(umbel_command: Umbel, asset: Path, tmp_path: Path) -> None:
    done = umbel_command(
        "export", asset, "-o", tmp_path / "t", "--tile-triangles", 2000, "--skirts", "--json"
    )
    assert done.status == 0
    said = done.json
    files = [f for f in (tmp_path / "t").rglob("*") if f.is_file()]
    assert said["format"] == "3dtiles"
    assert said["files"] == len(files)
    assert said["bytes"] == sum(f.stat().st_size for f in files)
    assert said["tiles"] > 4
    assert said["seconds"] > 0
    root = json.loads((tmp_path / "t" / "tileset.json").read_text())["root"]
    assert root["geometricError"] == said["errors"][0]
    again = umbel_command("export", asset, "-o", tmp_path / "t", "--json")
    assert again.status == 1
    assert "not an empty folder" in again.json["error"]


def test_a_glb_by_its_name(umbel_command: Umbel, asset: Path, tmp_path: Path) -> None:
    done = umbel_command("export", asset, "-o", tmp_path / "a.glb", "--json")
    assert done.status == 0
    assert (done.json["format"], done.json["files"]) == ("glb", 1)
    assert done.json["bytes"] == (tmp_path / "a.glb").stat().st_size
    assert umbel_command("export", asset, "-o", tmp_path / "b.glb", "--skirts").status == 2
    for flag in ("--tile-triangles", "--implicit-above"):
        assert umbel_command("export", asset, "-o", tmp_path / "b.glb", flag, 2000).status == 2
    flat = umbel_command("export", asset, "-o", tmp_path / "b.glb", "--flatten")
    assert flat.status == 0
    assert (tmp_path / "b.glb").read_bytes() == (tmp_path / "a.glb").read_bytes()
    page = ("export", asset, "-o", tmp_path / "page", "--format", "viewer", "--flatten")
    assert umbel_command(*page).status == 2


def test_meshes_are_left_to_extract(umbel_command: Umbel, asset: Path, tmp_path: Path) -> None:
    done = umbel_command("export", asset, "-o", tmp_path / "a.gltf", "--json")
    assert done.status == 2
    assert "`umbel extract` writes .gltf" in done.json["error"]
    assert not (tmp_path / "a.gltf").exists()


def test_only_assets_are_exported(umbel_command: Umbel, tmp_path: Path) -> None:
    done = umbel_command("export", tmp_path / "a.ply", "-o", tmp_path / "t", "--json")
    assert done.status == 1
    assert "a.ply" in done.json["error"]
    assert not (tmp_path / "t").exists()


@pytest.mark.parametrize("format", ["3dtiles", "viewer"])
def test_a_link_to_a_folder_stays_one(
    umbel_command: Umbel, blob_asset: Path, tmp_path: Path, format: str
) -> None:
    (tmp_path / "empty").mkdir()
    for name in ("empty", "new"):
        link = tmp_path / f"to {name}"
        link.symlink_to(tmp_path / name)
        done = umbel_command("export", blob_asset, "-o", link, "--format", format)
        assert done.status == 0 and link.is_symlink() and any((tmp_path / name).iterdir())
    assert len(list(tmp_path.iterdir())) == 4


@pytest.mark.parametrize("format", ["3dtiles", "viewer"])
def test_the_current_folder_is_not_replaced(
    umbel_command: Umbel, blob_asset: Path, tmp_path: Path, format: str
) -> None:
    done = umbel_command("export", blob_asset, "-o", ".", "--format", format, cwd=tmp_path)
    assert done.status == 1 and "current folder" in done.err
    assert list(tmp_path.iterdir()) == []
