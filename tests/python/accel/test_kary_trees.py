"""Trees of k-means with up to k children a node."""

from __future__ import annotations

import numpy as np
import pytest

import umbel
from helpers.hierarchies import ball_rays

BUILDERS = umbel.bvh.builders()
Mesh = umbel.Mesh


@pytest.mark.parametrize("clusters", [3, 8, 40])
def test_kary_trees_are_whole_and_traced(blob: Mesh, bvh: umbel.Bvh, clusters: int) -> None:
    tree = umbel.build_kary(blob, clusters=clusters, max_leaf_size=6)
    nodes = tree.nodes
    inner = nodes[nodes["children"] > 0]
    leaves = nodes[nodes["children"] == 0]
    assert np.array_equal(np.sort(tree.primitives), np.arange(len(blob.triangles)))
    assert inner["children"].max() <= clusters and inner["children"].min() >= 2
    assert inner["children"].sum() == len(nodes) - 1
    assert leaves["count"].sum() == len(blob.triangles) and leaves["count"].max() <= 6
    found = tree.statistics()
    assert found["leaves"] == len(leaves)
    assert tree.sah_cost((0.0001, 1.0)) < tree.sah_cost((1.0, 1.0))
    assert str(len(nodes)) in repr(tree)
    rays = ball_rays(500)
    for width in (2, 8):
        traced = umbel.Bvh.from_tree(tree, blob, width=width)
        assert np.array_equal(traced.intersect(*rays).t, bvh.intersect(*rays).t)
        assert traced.sah_cost == pytest.approx(tree.sah_cost())
        with pytest.raises(umbel.Error, match="binary tree"):
            _ = traced.epo


def test_kary_trees_are_the_same_over_boxes_and_of_settings_with_names(blob: Mesh) -> None:
    corners = blob.positions[blob.triangles]
    boxes = np.hstack([corners.min(axis=1), corners.max(axis=1)])
    over_mesh = umbel.build_kary(blob, builder="kmeans-q4")
    over_boxes = umbel.build_kary(boxes, clusters=32, candidates=20, iterations=10)
    assert np.array_equal(over_mesh.nodes, over_boxes.nodes)
    assert np.array_equal(over_mesh.primitives, over_boxes.primitives)
    with pytest.raises(umbel.Error, match="builder"):
        umbel.build_kary(blob, builder="sweep")
    with pytest.raises(umbel.Error, match="clusters"):
        umbel.build_kary(blob, clusters=65)
