"""Kd-trees: the hits of the BVH by every way to trace, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import umbel
from helpers.commands import Umbel
from umbel.accel.kdtree import BUILDERS, TRAVERSALS

FIELDS = {
    *("builder", "nodes", "leaves", "max_depth", "sah_cost", "epo", "build_seconds", "bytes"),
    *("primary_mrays_per_second", "diffuse_mrays_per_second", "references_per_triangle"),
}


def _rays(count: int = 2000) -> tuple[np.ndarray, np.ndarray]:
    dice = np.random.default_rng(1)
    origins = dice.normal(size=(count, 3)).astype(np.float32)
    return origins, (dice.normal(size=(count, 3)) * 0.3 - origins).astype(np.float32)


@pytest.mark.parametrize("builder", BUILDERS)
@pytest.mark.parametrize("traversal", TRAVERSALS)
def test_hits_are_those_of_the_bvh(builder: str, traversal: str) -> None:
    mesh = umbel.shapes.blob(4)
    tree, bvh = umbel.KdTree(mesh, builder=builder, traversal=traversal), umbel.Bvh(mesh)
    rays = _rays()
    found, expected = tree.intersect(*rays), bvh.intersect(*rays)
    for name in ("t", "primitive", "u", "v"):
        assert np.array_equal(getattr(found, name), getattr(expected, name)), name
    assert found.hit.any() and not found.hit.all()
    assert np.array_equal(tree.occluded(*rays), bvh.occluded(*rays))
    several, same = tree.all_hits(*rays), bvh.all_hits(*rays)
    assert np.array_equal(several.offsets, same.offsets)
    assert np.array_equal(several.primitive, same.primitive)
    near = tree.intersect(*rays, t_min=0.1, t_max=0.8, threads=1)
    assert np.array_equal(near.t, bvh.intersect(*rays, t_min=0.1, t_max=0.8).t)


def test_masks_are_those_of_the_bvh() -> None:
    mesh = umbel.shapes.blob(3)
    masks = 1 << np.arange(len(mesh.triangles)) % 3
    tree, bvh = umbel.KdTree(mesh, masks=masks), umbel.Bvh(mesh, masks=masks)
    rays = _rays()
    for mask in (1, 6, 8):
        found = tree.intersect(*rays, mask=mask, cull_back_faces=mask == 6)
        expected = bvh.intersect(*rays, mask=mask, cull_back_faces=mask == 6)
        assert np.array_equal(found.primitive, expected.primitive)
    with pytest.raises(umbel.Error, match="masks"):
        umbel.KdTree(mesh, masks=masks[1:])


def test_ropes_are_a_traversal_that_can_be_changed() -> None:
    mesh = umbel.shapes.torus(20, 10)
    tree = umbel.KdTree(mesh.positions, mesh.triangles, ropes=True)
    assert tree.traversal == "ropes"
    rays = _rays(200)
    by_ropes = tree.intersect(*rays)
    tree.traversal = "stack"
    assert np.array_equal(by_ropes.t, tree.intersect(*rays).t)
    with pytest.raises(umbel.Error, match="traversal"):
        tree.traversal = "rope"


def test_statistics_agree_with_each_other() -> None:
    mesh = umbel.shapes.blob(3)
    tree = umbel.KdTree(mesh, cost=(1.0, 4.0))
    found = tree.statistics()
    assert found["nodes"] == 2 * found["leaves"] - 1
    assert found["references"] >= len(tree) == len(mesh.triangles)
    assert tree.sah_cost == pytest.approx(found["inner_visits"] + 4 * found["tests"])
    assert np.array_equal(tree.bounds, umbel.Bvh(mesh).bounds)
    assert str(found["nodes"]) in repr(tree)


def test_a_saved_tree_is_loaded_as_it_was(tmp_path: Path) -> None:
    mesh = umbel.shapes.blob(3)
    tree = umbel.KdTree(mesh)
    tree.save(tmp_path / "a.umkd")
    loaded = umbel.KdTree.load(tmp_path / "a.umkd", ropes=True)
    assert loaded.traversal == "ropes"
    rays = _rays()
    assert np.array_equal(loaded.intersect(*rays).primitive, tree.intersect(*rays).primitive)
    loaded.traversal = "stack"
    loaded.save(tmp_path / "b.umkd")
    whole = (tmp_path / "a.umkd").read_bytes()
    assert (tmp_path / "b.umkd").read_bytes() == whole
    assert len(loaded) == len(tree) and np.array_equal(loaded.bounds, tree.bounds)
    (tmp_path / "b.umkd").write_bytes(whole[:-1])
    with pytest.raises(umbel.Error, match=r"b\.umkd cannot be read"):
        umbel.KdTree.load(tmp_path / "b.umkd")
    with pytest.raises(umbel.Error):
        umbel.KdTree.load(tmp_path / "missing.umkd")
    with pytest.raises(umbel.Error, match="traversal"):
        umbel.KdTree.load(tmp_path / "a.umkd", traversal="rope")


@pytest.mark.parametrize(
    "options",
    [
        {"builder": "octree"},
        {"traversal": "rope"},
        {"cost": (0.0, 1.0)},
        {"empty_bonus": 2.0},
        {"max_depth": 65},
        {"max_depth": -1},
        {"bins": "many"},
        {"invalid": "ignore"},
        {"threads": -1},
    ],
)
def test_refuses_what_is_wrong(options: dict) -> None:
    with pytest.raises(umbel.Error):
        umbel.KdTree(umbel.shapes.sphere(1), **options)


def test_invalid_triangles_are_refused_or_dropped() -> None:
    mesh = umbel.shapes.sphere(2)
    positions = mesh.positions.copy()
    positions[0] = np.nan
    with pytest.raises(umbel.Error, match="vertex"):
        umbel.KdTree(positions, mesh.triangles)
    tree = umbel.KdTree(positions, mesh.triangles, invalid="drop")
    primitive = tree.intersect(*_rays()).primitive
    assert not np.isin(mesh.triangles[primitive[primitive >= 0]], 0).any()


def test_no_triangles_no_hits() -> None:
    tree = umbel.KdTree(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    assert tree.bounds is None and not tree.occluded(*_rays(5)).any()


def test_command_says_what_it_built(umbel_command: Umbel, blob_ply: Path, tmp_path: Path) -> None:
    kept = tmp_path / "kept.umkd"
    done = umbel_command("kdtree", blob_ply, "--ropes", "--json", "-o", kept)
    assert done.status == 0 and set(done.json) >= FIELDS
    said = done.json
    assert said["traversal"] == "ropes" and said["triangles"] == 20_480
    assert said["primary_mrays_per_second"] > 0 and said["diffuse_mrays_per_second"] > 0
    assert said["file_bytes"] == kept.stat().st_size
    assert umbel.KdTree.load(kept).statistics()["nodes"] == said["nodes"]
    assert umbel_command("kdtree", blob_ply, "--builder", "octree").status == 1
    assert umbel_command("kdtree", blob_ply, "-o", tmp_path / "kept.umbvh").status == 1


@pytest.mark.filterwarnings("ignore::umbel.LoadWarning")
@pytest.mark.parametrize("builder", BUILDERS)
def test_walls_that_rounding_has_bent_are_not_lost(data: Path, builder: str) -> None:
    # Sponza's walls leave their planes by the last bit of a coordinate.
    mesh = umbel.load(data / "sponza_dabrovic_66k.obj")
    low, high = mesh.positions.min(0), mesh.positions.max(0)
    rng = np.random.default_rng(1)
    origins = (low + (high - low) * rng.random((50_000, 3))).astype(np.float32)
    directions = rng.normal(size=(50_000, 3)).astype(np.float32)
    tree = umbel.KdTree(mesh.positions, mesh.triangles, builder=builder)
    expected = umbel.Bvh(mesh.positions, mesh.triangles).intersect(origins, directions)
    hits = tree.intersect(origins, directions)
    assert np.array_equal(hits.primitive, expected.primitive)
    assert np.array_equal(hits.t, expected.t)


def test_the_command_passes_settings_on(umbel_command: Umbel, blob_ply: Path) -> None:
    plain = umbel_command("kdtree", blob_ply, "--json").json
    few = umbel_command("kdtree", blob_ply, "--json", "--target-leaf-size", "40").json
    assert few["nodes"] < plain["nodes"]
    shallow = umbel_command(
        *("kdtree", blob_ply, "--json", "--max-depth", "5", "--bad-refines", "0"),
        *("--empty-bonus", "0", "--traversal", "short-stack"),
    ).json
    assert shallow["max_depth"] <= 5 and shallow["traversal"] == "short-stack"
    failed = umbel_command("kdtree", blob_ply, "--max-depth", "65")
    assert failed.status == 1 and "--max-depth" in failed.err


def test_the_command_names_flags_that_have_no_effect(umbel_command: Umbel, small_ply: Path) -> None:
    flags = ("--bins", 32, "--ropes", "--traversal", "short-stack")
    assert umbel_command("kdtree", small_ply, *flags, "--json").json["warnings"] == [
        "--bins has no effect: it is for --builder binned, not exact",
        "--ropes has no effect: --traversal short-stack is given",
    ]
    used = ("--builder", "binned", "--bins", 32, "--ropes", "--traversal", "ropes")
    assert umbel_command("kdtree", small_ply, *used).err == ""
