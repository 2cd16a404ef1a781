"""Scenes of very many instances: placements from arrays, trees of them, what views show."""

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import umbel

COUNT = 70_000


def grid(count: int) -> np.ndarray:
    side = int(np.ceil(np.sqrt(count)))
    matrices = np.tile(np.eye(4, dtype=np.float32)[:3], (count, 1, 1))
    matrices[:, 0, 3] = 4 * (np.arange(count) % side)
    matrices[:, 2, 3] = 4 * (np.arange(count) // side)
    return matrices


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> umbel.Asset:
    path = tmp_path_factory.mktemp("many") / "many.umbel"
    lods = [umbel.build_lod(umbel.shapes.blob(3, seed=k)) for k in (1, 2)]
    placements = umbel.Placements(grid(COUNT), np.arange(COUNT) % 2)
    umbel.save_asset(path, lods, placements)
    return umbel.Asset(path)


def test_all_are_there_and_few_stand_for_them(many: umbel.Asset) -> None:
    assert many.has_instance_tree
    assert many.instance_count == COUNT
    assert len(many.instances) <= 64
    selector = umbel.InstanceSelector(many)
    step = selector.settle(error=0.0)
    meshes, transforms, coarsest = selector.placements(step)
    assert step.shown == COUNT == len(meshes) == len(coarsest)
    order = np.lexsort((transforms[:, 0, 3], transforms[:, 2, 3]))
    assert np.array_equal(transforms[order], grid(COUNT))
    assert np.array_equal(meshes[order], np.arange(COUNT) % 2)
    assert many.verify(4).ok


def test_a_camera_sees_near_instances_and_stand_ins_afar(many: umbel.Asset) -> None:
    selector = umbel.InstanceSelector(many)
    camera = umbel.Camera((0, 3, -10), (500, 0, 500), height=270, pixel_error=4)
    first = selector.step(camera)
    assert len(first.missing) and selector.bytes == 0
    step = selector.settle(camera, aspect=1.5)
    assert not len(step.missing) and selector.bytes > 0
    assert 0 < step.refined < step.shown < COUNT
    assert step.stand_ins > 0
    far = selector.settle(umbel.Camera((0, 1e7, 0), (0, 0, 0)))
    assert far.shown <= 64


def test_a_budget_that_is_none_is_refused(many: umbel.Asset) -> None:
    for most in (-1, 0.5, 2**64):
        with pytest.raises(umbel.Error, match="max_bytes must be"):
            umbel.InstanceSelector(many, max_bytes=most)


def test_threads_may_share_an_open_file_with_a_tree(many: umbel.Asset) -> None:
    with open(many.path, "rb") as file:
        asset = umbel.Asset(file)
        with ThreadPoolExecutor(4) as pool:
            counts = list(pool.map(lambda _: asset.instance_count, range(4)))
            selector = umbel.InstanceSelector(asset)
            steps = list(pool.map(lambda _: selector.settle(error=0.0), range(4)))
    assert counts == [step.shown for step in steps] == [COUNT] * 4


def test_the_same_instances_as_a_list_or_as_arrays(tmp_path: Path) -> None:
    lod = umbel.build_lod(umbel.shapes.blob(2, seed=1))
    matrices = grid(10)
    umbel.save_asset(tmp_path / "a.umbel", [lod], [(0, matrix) for matrix in matrices])
    umbel.save_asset(tmp_path / "b.umbel", [lod], umbel.Placements(matrices))
    assert (tmp_path / "a.umbel").read_bytes() == (tmp_path / "b.umbel").read_bytes()
    assert not umbel.Asset(tmp_path / "a.umbel").has_instance_tree
    assert umbel.Asset(tmp_path / "a.umbel").instance_count == 10
    with pytest.raises(umbel.Error, match="tree"):
        umbel.InstanceSelector(umbel.Asset(tmp_path / "a.umbel"))


def test_placements_far_from_the_origin_keep_their_digits(tmp_path: Path) -> None:
    lod = umbel.build_lod(umbel.shapes.blob(2, seed=1))
    matrices = grid(9).astype(np.float64)
    matrices[:, 0, 3] += 4.0e6 + 1 / 3
    around = [4.0e6, 0, 0]
    pairs = [(0, matrix) for matrix in matrices]
    umbel.save_asset(tmp_path / "a.umbel", [lod], pairs, origin=around)
    umbel.save_asset(tmp_path / "b.umbel", [lod], umbel.Placements(matrices), origin=around)
    assert (tmp_path / "a.umbel").read_bytes() == (tmp_path / "b.umbel").read_bytes()


def test_wrong_placements_are_refused(tmp_path: Path) -> None:
    with pytest.raises(umbel.Error, match=r"\(n, 3, 4\)"):
        umbel.Placements(np.zeros((5, 12)))
    of_rows = np.tile(np.eye(4), (3, 1, 1))
    of_rows[1, 3, :3] = 5
    with pytest.raises(umbel.Error, match="the last row of transforms must be 0, 0, 0, 1"):
        umbel.Placements(of_rows)
    with pytest.raises(umbel.Error, match="whole"):
        umbel.Placements(grid(3), np.zeros(3))
    with pytest.raises(umbel.Error, match=r"\(3,\)"):
        umbel.Placements(grid(3), [0, 1])
    lod = umbel.build_lod(umbel.shapes.blob(2, seed=1))
    with pytest.raises(umbel.Error, match="instance 1 is of mesh 4"):
        umbel.save_asset(tmp_path / "a.umbel", [lod], umbel.Placements(grid(3), [0, 4, 0]))
    with pytest.raises(umbel.Error, match="the last row of an instance's transform"):
        umbel.save_asset(tmp_path / "a.umbel", [lod], [(0, of_rows[1])])
    with pytest.raises(umbel.Error, match="the last row of transforms"):
        lod.tables.instance_cuts(of_rows, lod.tables.view(level=0))
    for none in (umbel.Placements(grid(3)[:0]), [], ()):
        with pytest.raises(umbel.Error, match="there are no instances"):
            umbel.save_asset(tmp_path / "a.umbel", [lod], none)
    assert not (tmp_path / "a.umbel").exists()
    broken = grid(3)
    broken[2, 0, 0] = np.nan
    with pytest.raises(umbel.Error, match="instance 2"):
        umbel.save_asset(tmp_path / "a.umbel", [lod], umbel.Placements(broken))


def test_exports_have_all_instances(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = umbel.shapes.blob(1, seed=1)
    umbel.save_asset(tmp_path / "a.umbel", [umbel.build_lod(mesh)], umbel.Placements(grid(COUNT)))
    asset = umbel.Asset(tmp_path / "a.umbel")
    assert asset.has_instance_tree
    tiles = umbel.export_tiles(asset, tmp_path / "tiles")
    levels = umbel.export_glb(asset, tmp_path / "a.glb")
    assert tiles.triangles == levels.triangles[0] == COUNT * len(mesh.triangles)
    data = (tmp_path / "a.glb").read_bytes()
    size = int.from_bytes(data[12:16], "little")
    gltf = json.loads(data[20 : 20 + size])
    (node,) = [n for n in gltf["nodes"] if "extensions" in n]
    (places,) = node["extensions"].values()
    assert gltf["accessors"][places["attributes"]["TRANSLATION"]]["count"] == COUNT
    monkeypatch.setattr("umbel.export.source.MOST_INSTANCES", COUNT - 1)
    with pytest.raises(umbel.Error, match=r"70,000 instances, more than the 69,999 that can be"):
        umbel.export_tiles(asset, tmp_path / "none")
