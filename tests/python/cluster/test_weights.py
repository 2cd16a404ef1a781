"""What keeps triangles together besides where they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import umbel
from helpers.commands import Umbel
from umbel.cluster.weights import DEFAULTS, face_normals, normal_connections, weights_of


def roof(columns: int = 40, rows: int = 60) -> umbel.Mesh:
    """A ridged roof: its normals change at every fifth column of squares."""
    x, y = np.meshgrid(np.arange(columns + 1.0), np.arange(rows + 1.0))
    height = 5 - np.abs(x % 10 - 5)
    positions = np.stack([x, y, height], -1).reshape(-1, 3).astype(np.float32)
    corner = np.arange((columns + 1) * (rows + 1)).reshape(rows + 1, columns + 1)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    faces = [np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (b, d, c))]
    return umbel.Mesh(positions, np.concatenate(faces).astype(np.uint32))


def spread(mesh: umbel.Mesh, clusters: umbel.Clusters) -> float:
    """How far clusters are from flat: 0 if all are."""
    normals = face_normals(mesh.positions, mesh.triangles)
    begins = clusters.offsets[:-1].astype(np.int64)
    sums = np.add.reduceat(normals[clusters.items], begins)
    sizes = np.diff(clusters.offsets.astype(np.int64))
    return float((1 - np.linalg.norm(sums, axis=1) / sizes).mean())


def test_clusters_end_at_creases_with_normals() -> None:
    mesh = roof()
    plain = umbel.cluster_mesh(mesh, 64)
    flat = umbel.cluster_mesh(mesh, 64, normal_weight=DEFAULTS["normals"])
    assert np.array_equal(np.sort(flat.items), np.arange(len(mesh.triangles)))
    assert spread(mesh, flat) < 0.5 * spread(mesh, plain)
    assert flat.metrics()["clusters"] == len(flat)
    both = umbel.cluster_mesh(mesh, 64, shared_vertex_weight=0.3, normal_weight=2.0)
    assert not np.array_equal(both.items, flat.items)


def test_edges_connect_triangles_by_the_cosine_of_their_normals() -> None:
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, -1, 1]], np.float32)
    triangles = np.array([[0, 1, 2], [1, 3, 2], [1, 0, 4], [0, 0, 1]], np.uint32)
    offsets, targets, weights = normal_connections(positions, triangles, 2.0)
    found = {
        (i, int(t)): float(w)
        for i in range(4)
        for t, w in zip(
            targets[offsets[i] : offsets[i + 1]], weights[offsets[i] : offsets[i + 1]], strict=True
        )
    }
    assert found[0, 1] == found[1, 0] == 2.0
    assert found[0, 2] == pytest.approx(2 * np.sqrt(0.5)) and found[0, 2] == found[2, 0]
    assert all(w == 0 for (i, j), w in found.items() if 3 in (i, j))


def test_mixes_are_read_by_name() -> None:
    assert weights_of("none") == {}
    assert weights_of("normals") == {"normals": DEFAULTS["normals"]}
    assert weights_of("shared-vertices=0.5, normals=2") == {"shared-vertices": 0.5, "normals": 2.0}
    for wrong in ("", "edges", "normals=-1", "normals=x", "normals=inf", "normals,normals"):
        with pytest.raises(umbel.Error):
            weights_of(wrong)


@pytest.mark.parametrize(
    ("text", "mix"),
    [
        ("normals", {"normal_weight": DEFAULTS["normals"]}),
        ("shared-vertices=0.3,normals=4", {"shared_vertex_weight": 0.3, "normal_weight": 4.0}),
    ],
)
def test_the_command_takes_weights_by_name(
    umbel_command: Umbel, tmp_path: Path, text: str, mix: dict[str, float]
) -> None:
    mesh, kept = roof(), tmp_path / "clusters.npz"
    umbel.save(tmp_path / "roof.ply", mesh)
    flags = ("cluster", tmp_path / "roof.ply", "--max-triangles", 64, "--json")
    plain = umbel_command(*flags).json
    said = umbel_command(*flags, "--weights", text, "-o", kept).json
    assert said["max_size"] <= 64 and plain["ratio_cut"] == 0 < said["ratio_cut"]
    made = umbel.cluster_mesh(mesh, 64, **mix)
    with np.load(kept) as arrays:
        assert np.array_equal(arrays["items"], made.items)
        assert np.array_equal(arrays["offsets"], made.offsets)
    assert spread(mesh, made) < 0.5 * spread(mesh, umbel.cluster_mesh(mesh, 64))


def test_the_command_refuses_weights_that_do_not_exist(
    umbel_command: Umbel, tmp_path: Path
) -> None:
    umbel.save(tmp_path / "roof.ply", roof(4, 4))
    for wrong, word in (("edges", "edges"), ("normals=-1", "normals")):
        done = umbel_command("cluster", tmp_path / "roof.ply", "--weights", wrong, "--json")
        assert done.status == 1 and word in done.json["error"]
        assert len(done.err.strip().splitlines()) == 1


def test_normals_need_bisection_and_a_mesh() -> None:
    mesh = roof(4, 4)
    with pytest.raises(umbel.Error, match="bisect"):
        umbel.cluster_mesh(mesh, method="morton", normal_weight=1.0)
    for wrong in (-1.0, float("nan"), float("inf")):
        with pytest.raises(umbel.Error, match="normal_weight"):
            umbel.cluster_mesh(mesh, normal_weight=wrong)
    empty = umbel.Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    assert len(umbel.cluster_mesh(empty, normal_weight=1.0)) == 0
