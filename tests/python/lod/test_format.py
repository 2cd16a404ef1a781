"""Every asset that the library writes, read by docs/format.md alone."""

from pathlib import Path

import numpy as np
import pytest

import umbel
from helpers.commands import DATA
from helpers.meshes import decorated_blob
from helpers.reference_reader import NONE, Group, Reader

MESHES = ["Fox.glb", "littlest_tokyo.glb", "cad_gears_19k.ply", "gargo_50k_normals_colors.ply"]


def expect_same(path: Path, pages: list[int] | None = None) -> None:
    """What the reference reader and the library say of a file."""
    reader, asset = Reader(path), umbel.Asset(path)
    assert len(reader.pages) == asset.info["pages"]
    assert len(reader.instances) == len(asset.instances)
    for (*matrix, number), (mesh, transform) in zip(reader.instances, asset.instances, strict=True):
        assert number == mesh
        assert matrix == transform.reshape(12).tolist()
    parents: list[dict[int, set[int]]] = []
    for number, entry in enumerate(reader.meshes):
        tables = asset.mesh_tables(number)
        assert entry[17:] == (len(tables.groups), len(tables.clusters))
        levels = reader.levels[entry[11] : entry[11] + entry[12]]
        assert [level[0] for level in levels] == list(tables.levels["offset"])
        nodes = reader.nodes[entry[15] : entry[15] + entry[16]]
        assert [node[5] for node in nodes] == list(tables.nodes["group"])
        parents.append({})
        for group, made_from in zip(
            tables.clusters["group"], tables.clusters["generating_group"], strict=True
        ):
            parents[-1].setdefault(int(made_from), set()).add(int(group))
    seen = 0
    for page in range(len(reader.pages)) if pages is None else pages:
        for (mesh, number), group in reader.page(page).items():
            groups = asset.mesh_tables(mesh).groups
            row = groups[number]
            assert (group.first_cluster, len(group.clusters)) == tuple(row.tolist()[:2])
            assert (group.level, group.method) == tuple(row.tolist()[2:4])
            assert (*group.sphere, group.error) == (*row["center"], row["radius"], row["error"])
            assert group.parents == len(parents[mesh].get(number, ()))
            assert {ref[0] for ref in group.references} == set(group.made_from) - {NONE}
            for child, at, count, error, *sphere in group.references:
                named = groups[child]
                assert at >= page
                assert count == len(parents[mesh][child])
                assert (error, *sphere) == (named["error"], *named["center"], named["radius"])
            expect_same_clusters(asset, mesh, group)
            seen += 1
    assert pages is not None or seen == sum(entry[17] for entry in reader.meshes)


def expect_same_clusters(asset: umbel.Asset, mesh: int, group: Group) -> None:
    rows = asset.mesh_tables(mesh).clusters[group.first_cluster :][: len(group.clusters)]
    assert group.made_from == list(rows["generating_group"])
    assert group.materials == list(rows["material"])
    for i, cluster in enumerate(group.clusters):
        assert np.array_equal(group.boxes[i][0], rows["box_min"][i])
        assert np.array_equal(group.boxes[i][1], rows["box_max"][i])
        mine = asset.cluster(group.first_cluster + i, mesh)
        assert np.array_equal(cluster["triangles"], mine.triangles)
        assert np.array_equal(cluster["positions"], mine.positions)
        expected = {name: getattr(mine, name) for name in ("normals", "tangents", "uvs", "colors")}
        expected |= {f"uvs{k + 1}": uvs for k, uvs in enumerate(mine.uv_sets)}
        for name in ("joints", "weights"):
            values = getattr(mine, name)
            for k in range(0 if values is None else values.shape[1] // 4):
                expected[name + str(k or "")] = values[:, 4 * k : 4 * k + 4]
        for name, value in expected.items():
            assert (name in cluster) == (value is not None), name
            if value is not None:
                assert np.allclose(cluster[name], value, atol=2e-5, equal_nan=True), name
        known = {"triangles", "positions", "material", *expected}
        assert set(cluster) <= known
        if "material" in cluster:
            corners = cluster["material"][cluster["triangles"]][..., 0]
            assert np.array_equal(corners.min(axis=1), corners.max(axis=1))
            counts = np.bincount(corners[:, 0].astype(np.int64))
            assert counts[group.materials[i]] == counts.max()


@pytest.mark.parametrize("precision", [None, "16bits", "8bits"])
@pytest.mark.parametrize("exact", [False, True])
def test_reference_reader_agrees_on_every_attribute(
    tmp_path: Path, precision: str | None, exact: bool
) -> None:
    lod = umbel.build_lod(decorated_blob(4), max_triangles=64, precision=precision)
    lod.save(tmp_path / "a.umbel", exact=exact)
    expect_same(tmp_path / "a.umbel")


@pytest.mark.parametrize("exact", [False, True])
def test_reference_reader_agrees_on_further_attributes(tmp_path: Path, exact: bool) -> None:
    blob = decorated_blob(4)
    near = np.abs(blob.positions)
    weights = near / near.sum(axis=1, keepdims=True)
    mesh = umbel.Mesh(
        positions=blob.positions,
        triangles=blob.triangles,
        uvs=blob.uvs,
        uv_sets=[blob.positions[:, 1:].copy(), blob.positions[:, ::2].copy()],
        joints=np.tile(np.arange(8, dtype=np.uint32), (len(near), 1)),
        weights=np.hstack([weights, np.zeros((len(near), 5))]).astype(np.float32),
        material_ids=(blob.positions[blob.triangles].mean(axis=1)[:, 1] > 0.2).astype(np.uint32),
        materials=[umbel.Material(name="a"), umbel.Material(name="b")],
    )
    lod = umbel.build_lod(mesh, max_triangles=64, mix_materials=True)
    lod.save(tmp_path / "a.umbel", exact=exact)
    names = {
        name
        for group in Reader(tmp_path / "a.umbel").page(0).values()
        for name in group.clusters[0]
    }
    assert names >= {"uvs", "uvs1", "uvs2", "joints", "joints1", "weights", "weights1", "material"}
    expect_same(tmp_path / "a.umbel")


def chart(mesh: umbel.Mesh, kind: str) -> np.ndarray:
    x, y, z = mesh.positions.T
    rng = np.random.default_rng(5)
    return {
        "flat": np.stack([x, y], 1),
        "mirrored": np.stack([-x, y], 1),
        "stretched": np.stack([100 * x, y / 50], 1),
        "noise": rng.uniform(-1, 1, (len(x), 2)),
        "large": np.stack([x, y], 1) * 1e4 + 3e4,
        "far": np.stack([x, z], 1) + 1e9,
        "constant": np.tile([0.25, 0.75], (len(x), 1)),
        "one": np.stack([x, 0 * y], 1),
    }[kind].astype(np.float32)


KINDS = ("flat", "mirrored", "stretched", "noise", "large", "far", "constant", "one")


# Smooth meshes, loose triangles, a strip of one side, a fan, and triangles without area.
@pytest.mark.parametrize("kind", KINDS)
def test_reference_reader_agrees_on_texture_coordinates(tmp_path: Path, kind: str) -> None:
    shapes = umbel.shapes
    line = umbel.Mesh(shapes.soup(60, seed=4).positions * (1, 0, 0), shapes.soup(60).triangles)
    meshes = [shapes.blob(4), shapes.soup(300), shapes.moebius(20, 3), shapes.fan(50), line]
    for mesh in meshes:
        mesh.uvs = chart(mesh, kind)
    lods = [umbel.build_lod(m, max_triangles=32, precision="10bits", force=True) for m in meshes]
    umbel.save_asset(tmp_path / "a.umbel", lods)
    expect_same(tmp_path / "a.umbel")


def test_reference_reader_agrees_on_several_meshes_and_instances(tmp_path: Path) -> None:
    lods = [umbel.build_lod(decorated_blob(4)), umbel.build_lod(umbel.shapes.torus(24, 12))]
    moved = np.eye(4)
    moved[:3, 3] = (1, 2, 3)
    umbel.save_asset(tmp_path / "a.umbel", lods, [(1, np.eye(4)), (0, moved), (1, 2 * moved[:3])])
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


def test_metadata_and_scenes_are_objects(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, lods = tmp_path / "a.umbel", [umbel.build_lod(umbel.shapes.blob(1, seed=1))]
    for name in ("metadata", "scene"):
        with pytest.raises(umbel.Error, match=f"{name} must be a dict, not list"):
            umbel.save_asset(path, lods, **{name: [1]})
    monkeypatch.setattr("umbel.lod.save.encode", lambda _: "[1]")
    umbel.save_asset(path, lods)
    with pytest.raises(umbel.Error, match=r"a\.umbel: the metadata is no JSON object"):
        umbel.Asset(path).mesh([0])


@pytest.mark.parametrize(
    ("scene", "said"),
    [
        ({"asset": 1}, "the asset of its scene is no object"),
        ({"nodes": [{"extensions": [1]}]}, "the extensions of its scene is no object"),
        ({"cameras": [{"perspective": []}]}, "the perspective of its scene is no object"),
        ({"cameras": [{"perspective": {"yfov": [1]}}]}, "a yfov that is no number"),
        ({"nodes": [{"children": [0]}]}, "a node of its scene is its own ancestor"),
    ],
)
def test_scenes_of_damaged_files_are_refused(
    tmp_path: Path, scene: dict[str, object], said: str
) -> None:
    path = tmp_path / "a.umbel"
    umbel.save_asset(path, [umbel.build_lod(umbel.shapes.blob(1, seed=1))], scene=scene)
    asset = umbel.Asset(path)
    with pytest.raises(umbel.Error, match=said):
        umbel.save(tmp_path / "a.obj", asset.mesh(asset.cut(level=0)))
    for call in (
        lambda: asset.scene_mesh(asset.scene_cuts(level=0)),
        lambda: umbel.export_tiles(asset, tmp_path / "tiles"),
    ):
        with pytest.raises(umbel.Error, match=rf"a\.umbel: .*{said}"):
            call()
