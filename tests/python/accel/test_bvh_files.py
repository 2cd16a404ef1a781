"""Hierarchies that follow moved vertices, and that are saved and loaded."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import umbel
from helpers.commands import ROOT
from helpers.hierarchies import ball_rays, instructions

BUILDERS = umbel.bvh.builders()
Mesh = umbel.Mesh


def test_refit_follows_and_says_when_to_rebuild(blob: Mesh) -> None:
    for compact in (False, True):
        bvh = umbel.Bvh(blob, compact=compact, keep_tree=True)
        built = bvh.sah_cost
        moved = blob.positions * np.float32(1.5) + np.float32(3)
        report = bvh.refit(moved)
        assert report.built_sah_cost == built and not report.rebuild_advised
        assert report.sah_cost == pytest.approx(built, rel=1e-3) and bvh.tree is None
        fresh = umbel.Bvh(moved, blob.triangles)
        origins, directions = ball_rays(300, 16)
        origins = origins * np.float32(1.5) + np.float32(3)
        assert np.array_equal(
            bvh.intersect(origins, directions).t, fresh.intersect(origins, directions).t
        )
        assert np.array_equal(bvh.bounds, fresh.bounds)
        shuffled = np.random.default_rng(1).permutation(blob.positions)
        report = bvh.refit(shuffled, threads=1)
        assert report.rebuild_advised and report.sah_cost > 1.5 * built
        with pytest.raises(umbel.Error, match="not finite"):
            bvh.refit(np.full_like(shuffled, np.nan))
        assert not np.isnan(bvh.bounds).any()


@pytest.mark.parametrize("width", [2, 4, 8])
@pytest.mark.parametrize("compact", [False, True])
def test_saved_files_answer_as_before(
    blob: Mesh, tmp_path: Path, width: int, compact: bool
) -> None:
    path = tmp_path / "blob.umbvh"
    masks = np.arange(len(blob.triangles)) % 7 + 1
    bvh = umbel.Bvh(blob, width=width, compact=compact, masks=masks)
    bvh.save(path)
    assert [p.name for p in tmp_path.iterdir()] == ["blob.umbvh"]
    again = umbel.Bvh.load(path)
    assert again.statistics() == bvh.statistics() and len(again) == len(bvh)
    assert np.array_equal(again.bounds, bvh.bounds)
    origins, directions = ball_rays(300, 17)
    for mask in (3, 0xFFFFFFFF):
        one = bvh.all_hits(origins, directions, mask=mask)
        other = again.all_hits(origins, directions, mask=mask)
        assert np.array_equal(one.primitive, other.primitive)
        assert np.array_equal(one.t, other.t)
    assert np.array_equal(again.signed_distance(origins), bvh.signed_distance(origins))
    with pytest.raises(umbel.Error, match="triangles must be given"):
        again.refit(blob.positions)
    assert not again.refit(blob.positions, blob.triangles).rebuild_advised
    assert not again.refit(blob.positions).rebuild_advised  # known by now
    bvh.save(path)
    bytes_before = path.read_bytes()
    umbel.Bvh(blob, width=width, compact=compact, masks=masks, threads=1).save(path)
    assert path.read_bytes() == bytes_before


def _mapped_hits(path: Path, origin: np.ndarray, direction: np.ndarray) -> dict[int, float]:
    """The triangles on a ray, and where, read from the mapped file alone as the manual says."""
    words = np.memmap(path, "<u4", mode="r")
    offsets = np.asarray(words[28:46]).view("<u8")[[0, 3, 6]] // 4
    width = int(words[6])
    assert not (offsets * 4 % 64).any()
    nodes, leaves = words[offsets[0] :], words[offsets[1] :]
    found: dict[int, float] = {}
    open_links = [0]
    with np.errstate(divide="ignore", invalid="ignore"):
        while open_links:
            node = nodes[7 * width * open_links.pop() :][: 7 * width].reshape(7, width)
            planes = node[:6].view("<f4").astype(np.float64).reshape(3, 2, width)
            t = (planes - origin[:, None, None]) / direction[:, None, None]
            near, far = t.min(1).max(0), t.max(1).min(0)
            for slot in np.flatnonzero((near <= far + 1e-6) & (node[6] != 0xFFFFFFFF)):
                link = int(node[6, slot])
                if not link >> 31:
                    open_links.append(link)
                    continue
                count, first = (link >> 28 & 7) + 1, link & 0xFFFFFFF
                rows = leaves[10 * first :][: 10 * count].reshape(10, count)
                corners = rows[:9].view("<f4").astype(np.float64).T.reshape(count, 3, 3)
                for triangle, (a, b, c) in zip(rows[9], corners, strict=True):
                    u, v, along = np.linalg.solve(
                        np.stack([b - a, c - a, -direction], 1), origin - a
                    )
                    if u >= 0 and v >= 0 and u + v <= 1 and along >= 0:
                        found[int(triangle)] = along
    return found


def test_a_saved_file_can_be_mapped_and_traced_as_it_lies(blob: Mesh, tmp_path: Path) -> None:
    path = tmp_path / "mapped.umbvh"
    bvh = umbel.Bvh(blob)
    bvh.save(path)
    random = np.random.default_rng(8)
    origins = random.uniform(-2, 2, (40, 3))
    directions = random.uniform(-0.5, 0.5, (40, 3)) - origins
    hits = bvh.intersect(origins, directions)
    assert hits.hit.sum() > 10
    for i in range(len(origins)):
        found = _mapped_hits(path, origins[i], directions[i])
        assert bool(found) == hits.hit[i]
        if found:
            assert min(found, key=lambda triangle: found[triangle]) == hits.primitive[i]
            assert min(found.values()) == pytest.approx(hits.t[i], rel=1e-5)


def test_a_file_of_version_1_0_answers_as_a_new_tree() -> None:
    old = ROOT / "tests" / "vectors" / "compact_1_0.umbvh"
    assert old.read_bytes()[8:12] == b"\1\0\0\0"
    sphere = umbel.shapes.sphere(1)
    new = umbel.Bvh(sphere, width=4, compact=True)
    origins, directions = ball_rays(300, 19)
    answers = new.intersect(origins, directions)
    for simd in instructions():
        loaded = umbel.Bvh.load(old, simd=simd)
        # Boxes were not quantised then.
        assert loaded.statistics()["bytes"] > new.statistics()["bytes"]
        for field, values in vars(loaded.intersect(origins, directions)).items():
            assert np.array_equal(values, getattr(answers, field)), field
    assert np.array_equal(loaded.signed_distance(origins), new.signed_distance(origins))
    assert not loaded.refit(sphere.positions, sphere.triangles).rebuild_advised


def test_damaged_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "mesh.umbvh"
    umbel.Bvh(umbel.shapes.sphere(1)).save(path)
    whole = path.read_bytes()
    random = np.random.default_rng(18)
    damaged = [b"", whole[:100], whole[:-1], whole + b"\0", b"ply\n" + whole[4:]]
    for _ in range(200):
        copy = bytearray(whole)
        copy[random.integers(len(copy))] ^= 1 << random.integers(8)
        damaged.append(bytes(copy))
    for content in damaged:
        path.write_bytes(content)
        with pytest.raises(umbel.Error, match=r"mesh\.umbvh") as refused:
            umbel.Bvh.load(path)
        assert refused.value.code in ("corrupt", "unsupported")
    with pytest.raises(umbel.Error) as missing:
        umbel.Bvh.load(tmp_path / "missing.umbvh")
    assert missing.value.code == "io"


@pytest.mark.parametrize("structure", [umbel.Bvh, umbel.KdTree])
def test_names_are_any_that_the_system_takes(
    structure: type[umbel.Bvh | umbel.KdTree], tmp_path: Path
) -> None:
    made = structure(umbel.shapes.sphere(1))
    for name in (b"\xff\xfe.tree", "\u00e9.tree".encode()):
        path = bytes(tmp_path) + b"/" + name
        made.save(path)  # type: ignore[arg-type]
        assert len(structure.load(os.fsdecode(path))) == len(made)
    kept = tmp_path / "kept"
    kept.write_bytes(b"old")
    with pytest.raises((TypeError, ValueError)):
        made.save(f"{kept}\0.tree")
    assert kept.read_bytes() == b"old"
