"""Attributes beyond the first: several sets of UVs, joints and weights, materials by triangle, and
the rules of seams, from a file through a build into a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import umbel
from helpers.commands import Umbel
from umbel import io


def _rich() -> umbel.Mesh:
    """A blob with two more sets of UVs and eight joints a vertex, all of which follow from the
    position."""
    mesh = umbel.shapes.blob(4)
    p = mesh.positions
    part = np.clip(0.5 + 2 * p[:, 0], 0.1, 0.9).astype(np.float32)
    mesh.uvs = p[:, :2].copy()
    mesh.uv_sets = [p[:, 1:].copy(), (2 * p[:, [0, 2]]).astype(np.float32)]
    mesh.joints = np.tile(np.uint32([3, 900, 0, 0, 17, 0, 0, 0]), (len(p), 1))
    mesh.weights = np.zeros((len(p), 8), np.float32)
    mesh.weights[:, 0], mesh.weights[:, 1], mesh.weights[:, 4] = part / 2, (1 - part) / 2, 0.5
    return mesh


def _expect_rich(mesh: umbel.Mesh, tolerance: float) -> None:
    p = mesh.positions
    part = np.clip(0.5 + 2 * p[:, 0], 0.1, 0.9)
    assert mesh.uvs is not None and mesh.joints is not None and mesh.weights is not None
    assert np.abs(mesh.uvs - p[:, :2]).max() <= tolerance
    assert len(mesh.uv_sets) == 2
    assert np.abs(mesh.uv_sets[0] - p[:, 1:]).max() <= tolerance
    assert np.abs(mesh.uv_sets[1] - 2 * p[:, [0, 2]]).max() <= tolerance
    assert (mesh.joints[:, [0, 1, 4]] == [3, 900, 17]).all()
    assert np.abs(mesh.weights[:, 0] - part / 2).max() <= tolerance + 1e-6
    assert np.abs(mesh.weights.sum(axis=1) - 1).max() <= 4 * tolerance + 1e-6


def test_glb_keeps_all_sets(tmp_path: Path) -> None:
    mesh = _rich()
    io.save(tmp_path / "a.glb", mesh)
    back = io.load(tmp_path / "a.glb")
    assert np.array_equal(back.triangles, mesh.triangles)
    assert all(np.array_equal(a, b) for a, b in zip(back.uv_sets, mesh.uv_sets, strict=True))
    assert back.weights is not None and np.array_equal(back.weights, mesh.weights)
    assert mesh.joints is not None and back.joints is not None
    assert np.array_equal(back.joints[:, [0, 1, 4]], mesh.joints[:, [0, 1, 4]])
    _expect_rich(back, 0)


def test_cuts_have_all_sets(tmp_path: Path) -> None:
    lod = umbel.build_lod(_rich())
    for triangles in (10_000, 1_000, 100):
        _expect_rich(lod.mesh(lod.cut(triangles=triangles)), 0)
    lod.save(tmp_path / "a.umbel", exact=False)
    asset = umbel.Asset(tmp_path / "a.umbel")
    _expect_rich(asset.mesh(asset.cut(triangles=1_000)), 2**-14)
    assert umbel.verify(tmp_path / "a.umbel").ok
    plain = umbel.build_lod(_rich(), attributes="none")
    bare = plain.mesh(plain.cut(level=0))
    assert bare.joints is None and not bare.uv_sets


def test_extract_writes_all_sets(tmp_path: Path, umbel_command: Umbel) -> None:
    io.save(tmp_path / "a.glb", _rich())
    done = umbel_command("build", tmp_path / "a.glb", "-o", tmp_path / "a.umbel", "--json")
    assert done.status == 0, done.err
    done = umbel_command(
        "extract", tmp_path / "a.umbel", "--triangles", "500", "-o", tmp_path / "b.glb", "--json"
    )
    assert done.status == 0, done.err
    _expect_rich(io.load(tmp_path / "b.glb"), 0)


def test_primitives_without_a_set_get_zeros() -> None:
    from umbel.io.scene import join

    rich, plain = _rich(), umbel.shapes.grid(2, 2)
    both = join([rich, plain], [(0, rich.triangles, None), (1, plain.triangles, None)])
    assert [len(uvs) for uvs in both.uv_sets] == [len(both.positions)] * 2
    assert both.weights is not None and both.weights.shape == (len(both.positions), 8)
    assert not both.weights[len(rich.positions) :].any()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"joints": np.zeros((3, 4), np.uint32)}, "belong together"),
        ({"joints": np.zeros((3, 3), int), "weights": np.zeros((3, 3))}, "joints must have"),
        ({"joints": np.zeros((3, 4), int), "weights": np.zeros((3, 8))}, "weights must have"),
        ({"uv_sets": [np.zeros((2, 2))]}, "uv_sets must have one row a vertex"),
    ],
)
def test_sets_that_do_not_fit_are_named(change: dict, says: str) -> None:
    with pytest.raises(umbel.Error, match=says):
        umbel.Mesh(np.eye(3), [[0, 1, 2]], **change)


def test_bad_values_are_named() -> None:
    mesh = _rich()
    assert mesh.weights is not None
    mesh.weights[5, 1] = np.nan
    with pytest.raises(umbel.Error, match="not finite"):
        umbel.build_lod(mesh)


def _charts() -> umbel.Mesh:
    """A sheet of 8 times 8 squares, each a chart of its own in the texture."""
    squares = [umbel.shapes.grid(6, 6) for _ in range(64)]
    positions, triangles, uvs = [], [], []
    for i, square in enumerate(squares):
        corner = np.float32([i % 8, i // 8, 0])
        triangles.append(square.triangles + np.uint32(sum(len(p) for p in positions)))
        positions.append((square.positions + corner).astype(np.float32))
        uvs.append(square.positions[:, :2] + np.float32([10 * i, 0]))
    return umbel.Mesh(np.concatenate(positions), np.concatenate(triangles), uvs=np.concatenate(uvs))


def _torn(mesh: umbel.Mesh) -> int:
    """Triangles with corners of different charts."""
    assert mesh.uvs is not None
    chart = np.floor(mesh.uvs[:, 0] / 10 + 0.05)[mesh.triangles]
    return int((chart != chart[:, :1]).any(axis=1).sum())


def test_rules_of_seams_from_python() -> None:
    mesh = _charts()
    torn, seams = {}, {}
    for rule in ("protect", "allow", "ignore"):
        lod = umbel.build_lod(mesh, seams=rule)
        torn[rule] = _torn(lod.mesh(lod.cut(level=3)))
        reasons = lod.report["groups_by_reason"]
        seams[rule] = sum(counts.get("seams", 0) for counts in reasons.values())
    assert torn["protect"] == torn["allow"] == 0 < torn["ignore"]
    assert seams["ignore"] == 0 < seams["protect"]
    with pytest.raises(umbel.Error, match="seams must be one of"):
        umbel.build_lod(mesh, seams="cut")


def test_rules_of_seams_from_the_command_line(tmp_path: Path, umbel_command: Umbel) -> None:
    io.save(tmp_path / "a.glb", _charts())
    made = {}
    for rule in ("protect", "ignore"):
        out = tmp_path / f"{rule}.umbel"
        done = umbel_command(
            "build", tmp_path / "a.glb", "-o", out, "--seams", rule, "--creases", rule, "--json"
        )
        assert done.status == 0, done.err
        assert umbel.Asset(out).info["metadata"]["config"]["seams"] == rule
        made[rule] = done.json
    assert made["protect"]["sha256"] != made["ignore"]["sha256"]
    same = umbel.build_lod(io.load(tmp_path / "a.glb"), seams="protect", creases="protect")
    assert made["protect"]["groups_by_reason"] == same.report["groups_by_reason"]


def test_clusters_that_mix_materials(tmp_path: Path, umbel_command: Umbel) -> None:
    mesh = umbel.shapes.terrain(60, 60)
    middle = mesh.positions[mesh.triangles].mean(axis=1)
    mesh.material_ids = ((middle[:, 0] * 9).astype(int) % 3).astype(np.uint32)
    mesh.materials = [umbel.Material(name) for name in "abc"]
    io.save(tmp_path / "a.glb", mesh)
    out = tmp_path / "a.umbel"
    done = umbel_command("build", tmp_path / "a.glb", "-o", out, "--mix-materials", "--json")
    assert done.status == 0, done.err
    asset = umbel.Asset(out)
    apart = umbel.build_lod(mesh)
    assert len(asset.tables.clusters) < len(apart.clusters)
    fine = asset.mesh(asset.cut(level=0))
    assert fine.material_ids is not None
    assert np.array_equal(np.bincount(fine.material_ids), np.bincount(mesh.material_ids))
    assert [m.name for m in fine.materials] == ["a", "b", "c"]
    assert umbel.verify(out).ok


def test_reasons_are_counted_group_by_group(tmp_path: Path, umbel_command: Umbel) -> None:
    lod = umbel.build_lod(umbel.shapes.soup(3000))
    assert len(lod.limiting_factors) == len(lod.groups)
    methods = np.array(["regular", "permissive", "prune", "sloppy", "root"])[lod.groups["method"]]
    counted = lod.report["groups_by_reason"]
    for method, reasons in counted.items():
        own = [r for r, g in zip(lod.limiting_factors, methods, strict=True) if g == method]
        assert reasons == {name: own.count(name) for name in sorted(set(own), key=own.index)}
        assert sum(reasons.values()) == lod.report["groups_by_rung"][method]
    assert counted["root"] == {"coarsest": 1}
    io.save(tmp_path / "a.ply", umbel.shapes.soup(3000))
    done = umbel_command("build", tmp_path / "a.ply", "-o", tmp_path / "a.umbel", "--json")
    assert done.json["groups_by_reason"] == counted
    assert done.json["waits_by_reason"] == lod.report["waits_by_reason"]


def test_skins_of_real_files(data: Path) -> None:
    for name, joints in (("CesiumMan.glb", 19), ("Fox.glb", 24)):
        mesh = umbel.load(data / name)
        assert mesh.joints is not None and int(mesh.joints.max()) < joints
        lod = umbel.build_lod(mesh)
        cut = lod.mesh(lod.cut(triangles=len(mesh.triangles) // 5))
        assert mesh.weights is not None and cut.weights is not None and cut.joints is not None
        known = {(*j, *w) for j, w in zip(mesh.joints.tolist(), mesh.weights.tolist(), strict=True)}
        assert all(
            (*j, *w) in known
            for j, w in zip(cut.joints.tolist(), cut.weights.tolist(), strict=True)
        )
