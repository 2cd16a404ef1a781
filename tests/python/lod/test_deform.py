"""Bounds of levels of detail over all poses of an animation."""

from __future__ import annotations

import numpy as np
import pytest

import umbel
from helpers.commands import DATA
from umbel import io, shapes
from umbel.lod.deform import deforming_tables
from umbel.lod.tables import NONE


def contains(outer_center, outer_radius, centers, radii):
    away = np.linalg.norm(centers.astype(np.float64) - outer_center.astype(np.float64), axis=-1)
    return (away + radii <= outer_radius * (1 + 1e-6)).all()


def check(lod, mesh, poses, tables):
    """Every vertex is in its group's sphere in every pose, bounds nest, and cuts agree."""
    groups, clusters, nodes = tables.groups, tables.clusters, tables.nodes
    ids = {p.tobytes(): [] for p in mesh.positions + np.float32(0)}
    for v, p in enumerate(mesh.positions + np.float32(0)):
        ids[p.tobytes()].append(v)
    escaped = 0
    for c in range(len(clusters)):
        part = lod.mesh([c]).positions + np.float32(0)
        vertices = [v for p in part for v in ids[p.tobytes()]]
        there = np.stack([np.asarray(pose)[vertices] for pose in poses])
        group, old = groups[clusters["group"][c]], lod.groups[clusters["group"][c]]
        assert contains(group["center"], group["radius"], there, 0)
        escaped += not contains(old["center"], old["radius"], there, 0)
        assert (there >= clusters["box_min"][c]).all()
        assert (there <= clusters["box_max"][c]).all()
        below = clusters["generating_group"][c]
        if below != NONE:
            assert contains(
                group["center"],
                group["radius"],
                groups["center"][below][None],
                groups["radius"][below][None],
            )
            assert group["error"] >= groups["error"][below]
    assert escaped > 0, "the poses do not leave the bounds of the rest pose"
    for node in nodes:
        inside = slice(node["child_offset"], node["child_offset"] + node["child_count"])
        assert contains(
            node["center"], node["radius"], nodes["center"][inside], nodes["radius"][inside]
        )
        assert (nodes["error"][inside] <= node["error"]).all()
    random = np.random.default_rng(4)
    for _ in range(20):
        eye = random.normal(size=3) * 4 * float(groups["radius"].max())
        camera = umbel.Camera(eye, [0, 0, 0], height=600)
        flat = tables.cut(camera=camera, method="flat")
        assert len(flat)
        assert (flat == tables.cut(camera=camera)).all()


def test_bounds_hold_in_all_poses_of_a_bending_tube():
    mesh = shapes.torus(120, 60)
    lod = umbel.build_lod(mesh)
    x, y, z = np.asarray(mesh.positions, np.float64).T
    poses = [mesh.positions]
    for bend in (0.5, 1.5, -1.0):
        poses.append(np.stack([x * np.cos(bend * y), y + bend * x * x, z * (1 + bend)], axis=1))
    check(lod, mesh, poses, deforming_tables(lod, mesh, poses))


def test_a_mesh_that_stays_keeps_its_errors():
    mesh = shapes.torus(60, 40)
    lod = umbel.build_lod(mesh)
    errors = deforming_tables(lod, mesh, []).groups["error"]
    finite = np.isfinite(errors)
    assert np.allclose(errors[finite], lod.groups["error"][finite], rtol=1e-4)


def test_errors_grow_with_the_mesh():
    mesh = shapes.torus(60, 40)
    lod = umbel.build_lod(mesh)
    grown = deforming_tables(lod, mesh, [mesh.positions * 3]).groups["error"]
    assert np.allclose(grown, lod.groups["error"] * np.float32(3), rtol=1e-3)


@pytest.mark.parametrize("corner", [0, 1, 2])
def test_errors_grow_by_any_edge_that_is_stretched(corner):
    """Every triangle of a soup opens like a pair of compasses, so two of its edges stay as long."""
    hinge = np.float32([[0, 0, 0], [1, 0, 0], [0.9, 0.1, 0]])
    opened = np.float32([[0, 0, 0], [1, 0, 0], [1 + np.sqrt(0.02), 0, 0]])
    offsets = np.random.default_rng(3).random((2000, 1, 3), np.float32) * 20

    def soup(triangle):
        return (np.roll(triangle, corner, axis=0) + offsets).reshape(-1, 3)

    mesh = umbel.Mesh(soup(hinge), np.arange(6000).reshape(-1, 3))
    lod = umbel.build_lod(mesh, keep_area=False)
    grown = deforming_tables(lod, mesh, [soup(opened)]).groups["error"]
    first = lod.groups["level"] == 0
    stretch = (1 + np.sqrt(0.02)) / np.sqrt(0.82)
    assert (grown[first] >= lod.groups["error"][first] * np.float32(stretch * 0.999)).all()


def test_poses_must_fit_the_mesh():
    mesh = shapes.torus(20, 10)
    lod = umbel.build_lod(mesh)
    with pytest.raises(umbel.Error, match="finite positions"):
        deforming_tables(lod, mesh, [np.zeros((3, 3))])
    with pytest.raises(umbel.Error, match="positions that the mesh has not"):
        deforming_tables(lod, shapes.torus(21, 10), [])


@pytest.mark.parametrize("name", ["CesiumMan.glb", "Fox.glb", "morph_stress.glb"])
def test_bounds_hold_over_all_frames_of_real_animations(name):
    path = DATA / name
    if not path.exists():
        pytest.skip(f"{path} is not there")
    mesh = io.load(path)
    poses = [pose.positions for pose in io.load_poses(path, rate=15)]
    assert len(poses) > 10
    lod = umbel.build_lod(mesh, max_triangles=32, max_vertices=64, keep_area=False)
    check(lod, mesh, [mesh.positions, *poses], deforming_tables(lod, mesh, poses))
