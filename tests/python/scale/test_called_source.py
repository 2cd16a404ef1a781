"""Meshes that an object gives range by range build what their blocks do, and take no disk."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import umbel
from umbel.io.blocks import open_source
from umbel.testing import giant

UNIT = 2000


def told(path: Path) -> dict[str, Any]:
    asset = umbel.Asset(path)
    info = asset.info
    assert umbel.verify(path, cuts=4).ok
    tables = [asset.tables.clusters.tobytes(), asset.tables.groups.tobytes(), asset.origin.tolist()]
    return {"tables": tables, "uvs": info["uvs"], "digest": info["source_digest"]}


@pytest.mark.parametrize("kind", giant.KINDS)
def test_builds_what_blocks_do(kind: str, tmp_path: Path) -> None:
    mesh = giant.make(kind, 6000, seams=kind in ("terrain", "city"), shuffled=kind == "scan")
    report = umbel.build_asset(mesh, tmp_path / "a.umbel", unit_triangles=UNIT)
    umbel.build_asset(mesh.blocks(1000), tmp_path / "b.umbel", unit_triangles=UNIT)
    assert told(tmp_path / "a.umbel") == told(tmp_path / "b.umbel")
    assert report["input_triangles"] == mesh.triangle_count
    assert report["input_vertices"] == mesh.vertex_count
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.umbel", "b.umbel"]


def test_takes_no_disk_and_resumes(tmp_path: Path) -> None:
    mesh, output = giant.terrain(20_000), tmp_path / "a.umbel"
    open_source(mesh, tmp_path / "source")
    assert not (tmp_path / "source").exists()

    def stop(_fraction: float, stage: str) -> bool:
        return not stage.startswith("tier 2")

    with pytest.raises(umbel.Cancelled):
        umbel.build_asset(mesh, output, unit_triangles=UNIT, progress=stop)
    other = giant.terrain(20_000, seed=9)
    with pytest.raises(umbel.Error, match="the input has changed since"):
        umbel.build_asset(other, output, unit_triangles=UNIT, resume=True)
    umbel.build_asset(mesh, output, unit_triangles=UNIT, resume=True)
    whole = output.read_bytes()
    umbel.build_asset(mesh, output, unit_triangles=UNIT)
    assert output.read_bytes() == whole


def square(begin: int, end: int) -> SimpleNamespace:
    positions = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float64)
    return SimpleNamespace(
        positions=positions, triangles=np.array([[0, 1, 2], [0, 2, 3]])[begin:end]
    )


class Odd:
    """A square whose blocks are changed."""

    triangle_count = 2

    def __init__(self, **changed: Any) -> None:
        self.changed = changed

    def block(self, begin: int, end: int) -> SimpleNamespace:
        block = square(begin, end)
        if end - begin > 1:
            for name, value in self.changed.items():
                setattr(block, name, value)
        return block


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"positions": None}, "cannot be had|has 0 of|vertex index"),
        ({"positions": np.zeros((4, 2))}, r"positions has the shape \(4, 2\)"),
        ({"positions": np.full((4, 3), np.nan)}, "not finite"),
        ({"triangles": np.array([[0, 1, 2]])}, "has 1 of triangles, not 2"),
        ({"triangles": np.array([[0, 1, 2], [0, 2, 4]])}, "triangle 1 has vertex index 4, of 4"),
        ({"triangles": np.array([[0, 1, 2], [0, 2, -1]])}, "triangles has -1 to 2"),
        ({"triangles": np.zeros((2, 3))}, "triangles has the shape"),
        ({"uvs": np.zeros((4, 2))}, "has 4 of uvs, not 0"),
    ],
)
def test_blocks_are_not_believed(changed: dict[str, Any], sentence: str, tmp_path: Path) -> None:
    umbel.build_asset(Odd(), tmp_path / "good.umbel", unit_triangles=UNIT)
    with pytest.raises(umbel.Error, match=sentence):
        umbel.build_asset(Odd(**changed), tmp_path / "a.umbel", unit_triangles=UNIT)
    assert [path.name for path in tmp_path.iterdir()] == ["good.umbel"]


def test_what_the_object_raises_is_said(tmp_path: Path) -> None:
    class Raises(Odd):
        def block(self, begin: int, end: int) -> SimpleNamespace:
            if end - begin > 1:
                raise KeyError("no such tile")
            return square(begin, end)

    with pytest.raises(umbel.Error, match=r"\[0, 2\) cannot be had: KeyError: 'no such tile'"):
        umbel.build_asset(Raises(), tmp_path / "a.umbel", unit_triangles=UNIT)
