"""Clusters of meshes that change every frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import umbel


def twisted(positions, angle):
    a = angle * positions[:, 0]
    y, z = positions[:, 1], positions[:, 2]
    return np.stack(
        [positions[:, 0], y * np.cos(a) - z * np.sin(a), y * np.sin(a) + z * np.cos(a)], axis=1
    ).astype(np.float32)


def expect_sound(clusters, mesh, positions):
    items, offsets, boxes = clusters.items, clusters.offsets, clusters.boxes
    assert len(clusters) == len(offsets) - 1 == len(boxes)
    assert np.array_equal(np.sort(items), np.arange(len(mesh.triangles)))
    assert np.array_equal(clusters.triangles, np.asarray(mesh.triangles)[items])
    corners = positions[clusters.triangles]
    low = np.minimum.reduceat(corners.min(axis=1), offsets[:-1])
    high = np.maximum.reduceat(corners.max(axis=1), offsets[:-1])
    assert np.array_equal(boxes, np.concatenate([low, high], axis=1))


@pytest.mark.parametrize("method", ["morton", "hybrid"])
def test_frames_are_followed(method):
    mesh = umbel.shapes.sphere(5)
    clusters = umbel.FrameClusters(mesh, method, max_triangles=64)
    rest = np.asarray(mesh.positions)
    expect_sound(clusters, mesh, rest)
    assert clusters.area_growth.growth == 1
    moved = twisted(rest, 4.0)
    kept = clusters.items
    growth = clusters.refit(moved)
    assert growth.growth > 1.05
    assert np.array_equal(clusters.items, kept)
    expect_sound(clusters, mesh, moved)
    part = clusters.rebuild_worst(moved, len(clusters) // 4)
    assert part.area_ratio < growth.area_ratio
    expect_sound(clusters, mesh, moved)
    clusters.update(moved)
    assert clusters.area_growth.area_ratio < part.area_ratio * 1.01
    expect_sound(clusters, mesh, moved)


def test_a_policy_decides():
    mesh = umbel.shapes.sphere(5)
    rest = np.asarray(mesh.positions)
    clusters = umbel.FrameClusters(mesh)
    policy = umbel.RebuildPolicy(threshold=1.1)
    assert clusters.step(rest, policy, 1) == "keep"
    assert clusters.step(twisted(rest, 4.0), policy, 1) == "rebuild"
    assert clusters.area_growth.growth == 1
    part = umbel.RebuildPolicy(threshold=1.01, budget=0.2)
    assert clusters.step(twisted(rest, 7.0), part, 1) == "rebuild_worst"
    never = umbel.RebuildPolicy(threshold=1.01, least_period=5)
    assert clusters.step(twisted(rest, 9.0), never, 4) == "keep"


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("threshold", np.nan),
        ("threshold", 0.5),
        ("least_period", -1),
        ("most_period", -1),
        ("budget", -0.1),
        ("budget", np.nan),
        ("budget", "all"),
    ],
)
def test_a_policy_that_makes_no_sense_is_refused(name, wrong):
    with pytest.raises(umbel.Error, match=f"{name} must be a number of at least"):
        umbel.RebuildPolicy(**{name: wrong})


def test_vertices_are_limited_and_listed():
    mesh = umbel.shapes.sphere(4)
    clusters = umbel.FrameClusters(mesh, max_vertices=40)
    offsets, vertices, corners = clusters.vertex_lists()
    assert np.diff(offsets).max() <= 40
    sizes = np.diff(clusters.offsets)
    first = np.repeat(offsets[:-1], sizes)
    assert np.array_equal(vertices[first[:, None] + corners], clusters.triangles)


def test_hybrid_is_a_method_of_clustering():
    mesh = umbel.shapes.sphere(6)
    areas = {
        method: umbel.cluster_mesh(mesh, method=method).metrics()["surface_area_ratio"]
        for method in ("bisect", "morton", "hybrid")
    }
    assert areas["hybrid"] < 0.6 * areas["morton"]
    assert areas["hybrid"] < 1.15 * areas["bisect"]


def test_mistakes_are_named():
    mesh = umbel.shapes.sphere(2)
    with pytest.raises(umbel.Error, match="method must be"):
        umbel.FrameClusters(mesh, "quick")
    with pytest.raises(umbel.Error, match="max_triangles must be from 2 to 512, not 600"):
        umbel.FrameClusters(mesh, max_triangles=600)
    with pytest.raises(umbel.Error, match="162 vertices"):
        umbel.FrameClusters(mesh).build(np.zeros((3, 3), np.float32))
    with pytest.raises(umbel.Error, match="method must be"):
        umbel.FrameClusters(mesh, 3)  # type: ignore[arg-type]
    with pytest.raises(umbel.Error, match="underfill_cost must be a number, not 'much'"):
        umbel.FrameClusters(mesh, underfill_cost="much")  # type: ignore[arg-type]
    for origin in (0.0, 1e6):
        clusters = umbel.FrameClusters(replace(mesh, origin=(origin, 0, 0)))
        with pytest.raises(umbel.Error, match=r"positions must have shape \(n, 3\)"):
            clusters.refit(np.zeros((162, 2)))
        with pytest.raises(umbel.Error, match="positions must hold numbers"):
            clusters.refit("moved")
