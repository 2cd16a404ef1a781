"""How exactly attributes are kept in a file: as asked, or as goes with positions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import umbel
from helpers.meshes import decorated_blob


def _saved(
    lod: umbel.Lod, path: Path, bits: dict[str, int] | None = None, exact: bool | None = None
) -> umbel.Asset:
    lod.save(path, exact=exact, attribute_bits=bits)
    return umbel.Asset(path)


def _largest_angle(a: np.ndarray, b: np.ndarray) -> float:
    """In degrees, between rows."""
    a, b = (x / np.linalg.norm(x, axis=1, keepdims=True) for x in (a, b))
    return float(np.degrees(2 * np.arcsin(np.linalg.norm(a - b, axis=1).max() / 2)))


@pytest.mark.parametrize(
    ("precision", "normal", "uv"),
    [(None, 0, 0), ("12bits", 8, 12), ("16bits", 8, 12), ("17bits", 9, 13), ("20bits", 10, 14)],
)
def test_attributes_go_with_positions(
    tmp_path: Path, precision: str | None, normal: int, uv: int
) -> None:
    lod = umbel.build_lod(decorated_blob(3), precision=precision)
    info = _saved(lod, tmp_path / "a.umbel").info
    assert info["normal_bits"] == info["tangent_bits"] == normal
    assert info["color_bits"] == (8 if precision else 0)
    assert info["uv_step"] == (2.0**-uv if uv else 0)


def test_each_can_be_set(tmp_path: Path) -> None:
    lod = umbel.build_lod(decorated_blob(3), precision="16bits")
    bits = {"normal": 11, "tangent": 6, "color": 5, "uv": 3}
    for name, count in bits.items():
        info = _saved(lod, tmp_path / "a.umbel", {name: count}).info
        kept = {key: info[f"{key}_bits"] for key in ("normal", "tangent", "color")}
        kept["uv"] = round(-np.log2(info["uv_step"]))
        assert kept == {"normal": 8, "tangent": 8, "color": 8, "uv": 12} | {name: count}
    info = _saved(lod, tmp_path / "a.umbel", {"uv": 3}, exact=True).info
    assert (info["normal_bits"], info["uv_step"]) == (0, 0.125)
    info = _saved(lod, tmp_path / "a.umbel", {"normal": 0}).info
    assert (info["normal_bits"], info["tangent_bits"], info["color_bits"]) == (0, 0, 8)


def _in_order(cluster: umbel.Mesh) -> umbel.Mesh:
    """The vertices by position and texture coordinates: files have them as they take few bits."""
    assert cluster.uvs is not None and cluster.normals is not None
    order = np.lexsort((*cluster.uvs.T, *cluster.positions.T))
    return umbel.Mesh(
        cluster.positions[order],
        np.empty((0, 3), np.uint32),
        normals=cluster.normals[order],
        uvs=cluster.uvs[order],
    )


def test_errors_are_those_of_the_bits(tmp_path: Path) -> None:
    lod = umbel.build_lod(decorated_blob(4), precision="16bits")
    exact = _saved(lod, tmp_path / "a.umbel", exact=True)
    sizes = [(tmp_path / "a.umbel").stat().st_size]
    for normal, uv, degrees in ((8, 12, 1.0), (6, 8, 4.0)):
        asset = _saved(lod, tmp_path / "b.umbel", {"normal": normal, "uv": uv})
        sizes.append((tmp_path / "b.umbel").stat().st_size)
        for c in range(len(lod.clusters)):
            a, b = _in_order(exact.cluster(c)), _in_order(asset.cluster(c))
            assert np.array_equal(a.positions, b.positions)
            assert a.uvs is not None and b.uvs is not None
            assert np.abs(a.uvs - b.uvs).max() <= 2.0 ** -(uv + 1)
            assert a.normals is not None and b.normals is not None
            assert _largest_angle(a.normals, b.normals) <= degrees
    assert sizes == sorted(sizes, reverse=True)
    assert umbel.verify(tmp_path / "b.umbel").ok


@pytest.mark.parametrize(
    ("bits", "says"),
    [
        ({"normal": 17}, "normal bits must be 0 .* or from 2 to 16, not 17"),
        ({"color": 1}, "color bits must be 0 .* or from 2 to 16, not 1"),
        ({"uv": -1}, "uv bits must be 0 .* or from 1 to 24, not -1"),
        ({"joints": 8}, "attribute_bits has 'joints'"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, bits: dict[str, int], says: str) -> None:
    lod = umbel.build_lod(umbel.shapes.blob(2))
    with pytest.raises(umbel.Error, match=says):
        lod.save(tmp_path / "a.umbel", attribute_bits=bits)
    assert not (tmp_path / "a.umbel").exists()


def test_an_empty_mesh_and_one_point_have_bits(tmp_path: Path) -> None:
    for mesh in (
        umbel.Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32)),
        umbel.Mesh(np.ones((3, 3), np.float32), np.uint32([[0, 1, 2]])),
    ):
        mesh.uvs = np.zeros((len(mesh.positions), 2), np.float32)
        umbel.build_lod(mesh, precision=0.5, force=True).save(tmp_path / "a.umbel")
        assert umbel.verify(tmp_path / "a.umbel").ok


def test_an_asset_without_meshes_can_be_written(tmp_path: Path) -> None:
    umbel.save_asset(tmp_path / "a.umbel", [])
    assert umbel.Asset(tmp_path / "a.umbel").meshes == []
    assert umbel.verify(tmp_path / "a.umbel").ok
