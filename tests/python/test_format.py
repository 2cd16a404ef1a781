"""Every asset that the library writes, read by docs/format.md alone."""

from pathlib import Path

import numpy as np
import pytest

import umbel
from io_helpers import DATA
from reference_reader import NONE, Group, Reader

MESHES = ["Fox.glb", "littlest_tokyo.glb", "cad_gears_19k.ply", "gargo_50k_normals_colors.ply"]


def decorated_blob() -> umbel.Mesh:
    """A closed surface with every attribute."""
    mesh = umbel.shapes.blob(4, seed=3)
    positions = mesh.positions
    normals = positions / np.linalg.norm(positions, axis=1, keepdims=True)
    tangents = np.cross([0.3, 0.5, 0.8], normals)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    side = np.where(positions[:, :1] > 0, 1.0, -1.0)
    return umbel.Mesh(
        positions=positions,
        triangles=mesh.triangles,
        normals=normals.astype(np.float32),
        tangents=np.hstack([tangents, side]).astype(np.float32),
        uvs=(positions[:, :2] * 2).astype(np.float32),
        colors=np.hstack([np.abs(normals), np.full((len(normals), 1), 0.5)]).astype(np.float32),
    )


def expect_same(path: Path, pages: list[int] | None = None) -> None:
    """What the reference reader and the library say of a file."""
    reader, asset = Reader(path), umbel.Asset(path)
    tables = asset.tables
    assert [level[0] for level in reader.levels] == list(tables.levels["offset"])
    assert reader.meshes[0][17:] == (len(tables.groups), len(tables.clusters))
    assert len(reader.pages) == asset.info["pages"]
    assert [node[5] for node in reader.nodes] == list(tables.nodes["group"])
    parents: dict[int, set[int]] = {}
    for group, made_from in zip(
        tables.clusters["group"], tables.clusters["generating_group"], strict=True
    ):
        parents.setdefault(int(made_from), set()).add(int(group))
    seen = 0
    for page in range(len(reader.pages)) if pages is None else pages:
        for (_, number), group in reader.page(page).items():
            row = tables.groups[number]
            assert (group.first_cluster, len(group.clusters)) == tuple(row.tolist()[:2])
            assert (group.level, group.rung) == tuple(row.tolist()[2:4])
            assert (*group.sphere, group.error) == (*row["center"], row["radius"], row["error"])
            assert group.parents == len(parents.get(number, ()))
            assert {ref[0] for ref in group.references} == set(group.made_from) - {NONE}
            for child, at, count, error, *sphere in group.references:
                named = tables.groups[child]
                assert at >= page
                assert count == len(parents[child])
                assert (error, *sphere) == (named["error"], *named["center"], named["radius"])
            expect_same_clusters(asset, group)
            seen += 1
    assert seen == len(tables.groups) or pages is not None


def expect_same_clusters(asset: umbel.Asset, group: Group) -> None:
    rows = asset.tables.clusters[group.first_cluster :][: len(group.clusters)]
    assert group.made_from == list(rows["generating_group"])
    assert group.materials == list(rows["material"])
    for i, cluster in enumerate(group.clusters):
        assert np.array_equal(group.boxes[i][0], rows["box_min"][i])
        assert np.array_equal(group.boxes[i][1], rows["box_max"][i])
        mine = asset.cluster(group.first_cluster + i)
        assert np.array_equal(cluster["triangles"], mine.triangles)
        assert np.array_equal(cluster["positions"], mine.positions)
        for name in ("normals", "tangents", "uvs", "colors"):
            value = getattr(mine, name)
            assert (name in cluster) == (value is not None)
            if value is not None:
                assert np.allclose(cluster[name], value, atol=2e-5, equal_nan=True), name


@pytest.mark.parametrize("precision", [None, "16bits", "8bits"])
@pytest.mark.parametrize("exact", [False, True])
def test_reference_reader_agrees_on_every_attribute(
    tmp_path: Path, precision: str | None, exact: bool
) -> None:
    lod = umbel.build_lod(decorated_blob(), max_triangles=64, precision=precision)
    lod.save(tmp_path / "a.umbel", exact=exact)
    expect_same(tmp_path / "a.umbel")


def test_reference_reader_agrees_on_nothing(tmp_path: Path) -> None:
    empty = umbel.Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    umbel.build_lod(empty).save(tmp_path / "a.umbel")
    expect_same(tmp_path / "a.umbel")


@pytest.mark.skipif(not DATA.is_dir(), reason="there is no data folder")
@pytest.mark.parametrize("name", MESHES)
def test_reference_reader_agrees_on_real_meshes(tmp_path: Path, name: str) -> None:
    lod = umbel.build_lod(DATA / name, precision="16bits")
    lod.save(tmp_path / "a.umbel")
    expect_same(tmp_path / "a.umbel", [0])


def test_a_coarser_grid_makes_a_smaller_file_and_says_how_far_it_moved(tmp_path: Path) -> None:
    blob = umbel.shapes.blob(5, seed=1)
    sizes = []
    for precision in (None, "18bits", "14bits", "10bits"):
        lod = umbel.build_lod(blob, precision=precision)
        sizes.append(lod.save(tmp_path / "a.umbel"))
        asset = umbel.Asset(tmp_path / "a.umbel")
        step = asset.info["position_step"]
        assert step == lod.report.get("grid_step", 0)
        assert lod.report["largest_move"] <= step * 0.5 * 3**0.5
        finite = lod.groups["error"][np.isfinite(lod.groups["error"])]
        assert finite.min() >= lod.report["largest_move"]
        assert umbel.verify(tmp_path / "a.umbel", cuts=8).ok
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[0] > 3 * sizes[3]
