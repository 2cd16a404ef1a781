"""A .glb with MSFT_lod."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import umbel
from helpers.gltf_files import json_of, validator_errors
from umbel.io.textures.images import TextureImage


@pytest.fixture(scope="module")
def blob() -> umbel.Mesh:
    return umbel.shapes.blob(6, seed=4)


@pytest.fixture(scope="module")
def asset(blob: umbel.Mesh, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("glb") / "blob.umbel"
    umbel.build_lod(blob).save(path)
    return path


def test_levels_are_nodes_from_fine_to_coarse(blob: umbel.Mesh, asset: Path) -> None:
    path = asset.parent / "a.glb"
    report = umbel.export_glb(asset, path)
    root = json_of(path)
    assert report.bytes == path.stat().st_size
    assert len(report.triangles) == report.levels == len(root["meshes"]) > 3
    assert root["scenes"][root["scene"]]["nodes"] == [0]
    node = root["nodes"][0]
    assert node["extensions"]["MSFT_lod"]["ids"] == list(range(1, report.levels))
    assert node["extras"]["MSFT_screencoverage"] == report.coverages
    assert report.coverages == sorted(report.coverages, reverse=True)
    assert report.coverages[-1] == 0
    assert report.errors[0] == 0
    assert report.errors == sorted(report.errors)
    for finer, coarser in zip(report.triangles, report.triangles[1:], strict=False):
        assert coarser <= finer / 2
    assert "MSFT_lod" in root["extensionsUsed"]
    assert "MSFT_lod" not in root["extensionsRequired"]
    # A reader that does not know levels shows the finest.
    shown = umbel.load(path)
    assert len(shown.triangles) == len(blob.triangles) == report.triangles[0]
    points = umbel.Bvh(blob).closest_point(shown.positions)
    assert points.distance.max() <= report.largest_move * 1.01
    assert np.allclose(shown.bounds, blob.bounds, atol=report.largest_move)


def test_the_same_bytes_each_time(asset: Path) -> None:
    for name in ("b.glb", "c.glb"):
        umbel.export_glb(asset, asset.parent / name)
    assert (asset.parent / "b.glb").read_bytes() == (asset.parent / "c.glb").read_bytes()


def test_khronos_finds_no_error_in_glb_and_tiles(asset: Path, tmp_path: Path) -> None:
    umbel.export_glb(asset, tmp_path / "a.glb")
    umbel.export_tiles(asset, tmp_path / "t", tile_triangles=2000)
    files = [tmp_path / "a.glb", *sorted((tmp_path / "t").rglob("*.glb"))]
    assert not validator_errors(*files)


def test_an_origin_is_a_node_above(tmp_path: Path) -> None:
    blob = umbel.shapes.blob(3, seed=1)
    far = np.array([4e6 + 0.25, 5e5, 3e6])
    moved = umbel.Mesh(blob.positions.astype(np.float64) + far, blob.triangles)
    umbel.build_lod(moved).save(tmp_path / "a.umbel")
    report = umbel.export_glb(tmp_path / "a.umbel", tmp_path / "a.glb")
    shown = umbel.load(tmp_path / "a.glb")
    assert np.abs(shown.bounds - moved.bounds).max() <= report.largest_move + 1e-6


def test_what_fails_leaves_nothing(
    asset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(umbel.Cancelled):
        umbel.export_glb(asset, tmp_path / "a.glb", progress=lambda f, _: f < np.float64(0.4))
    with pytest.raises(umbel.Error, match=r"\.glb"):
        umbel.export_glb(asset, tmp_path / "a.gltf")
    monkeypatch.setattr("umbel.export.lod_glb.MOST_TRIANGLES", 100)
    with pytest.raises(umbel.Error, match="too many for one"):
        umbel.export_glb(asset, tmp_path / "a.glb")
    assert not list(tmp_path.iterdir())


def test_an_image_of_several_materials_is_stored_once(tmp_path: Path) -> None:
    out = io.BytesIO()
    Image.new("RGB", (2, 2), (1, 2, 3)).save(out, "PNG")
    image = TextureImage(out.getvalue())
    slots = {"metallic_roughness": image, "occlusion": image}
    materials = [umbel.Material(name=name, images=slots) for name in ("a", "b")]
    mesh = umbel.shapes.grid(4, 4)
    ids = np.arange(len(mesh.triangles), dtype=np.uint32) % 2
    textured = replace(mesh, uvs=mesh.positions[:, :2], material_ids=ids, materials=materials)
    umbel.build_lod(textured).save(tmp_path / "a.umbel")
    umbel.export_glb(tmp_path / "a.umbel", tmp_path / "a.glb")
    root = json_of(tmp_path / "a.glb")
    assert len(root["images"]) == len(root["textures"]) == 1
    read = umbel.load(tmp_path / "a.glb").materials
    assert [len(m.images) for m in read if m.name != "default"] == [2, 2]
    assert (tmp_path / "a.glb").read_bytes().count(out.getvalue()) == 1
