"""Scenes and the meshes that they become."""

from __future__ import annotations

import time

import numpy as np

from umbel import Mesh
from umbel.io.scene import Instance, Scene, join


def test_joining_many_blocks_takes_no_square_of_time() -> None:
    corners, triangle = np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.uint32)
    blocks = [Mesh(corners, triangle) for _ in range(40_000)]
    blocks[0].normals = np.ones((3, 3), np.float32)  # so that the others get some
    begin = time.process_time()
    mesh = join(blocks, [(k, triangle, None) for k in range(len(blocks))])
    assert time.process_time() - begin < 30  # looking at all parts for each block takes minutes
    assert mesh.triangles.tolist() == np.arange(120_000).reshape(-1, 3).tolist()
    assert mesh.normals is not None and len(mesh.normals) == 120_000


def test_what_a_merge_loses_of_meshes_is_said() -> None:
    def lost(*meshes: int, **of_second: object) -> str:
        arrays = np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.uint32)
        made = [Mesh(*arrays), Mesh(*arrays, **of_second)]
        nodes = [{} for _ in meshes]
        instances = [Instance(mesh, node=k) for k, mesh in enumerate(meshes)]
        return Scene(made, instances=instances, tree={"nodes": nodes}).merge_loss()

    said = "the meshes of its 2 nodes become one"
    assert lost(0, 1) == said
    assert lost(0, 1, name="a") == f"{said} without their names"
    assert lost(0, 1, name="a", extras={"b": 1}) == f"{said} without their names and extras"
    assert lost(1, 1, name="a", extras={"b": 1}) == said  # which are the merged mesh's
