"""`build_lod` in units: what it gives, where its file is, and what is refused."""

from __future__ import annotations

import gc
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import umbel
from umbel.scale.build_asset import build_asset
from umbel.scale.executor import InProcess
from umbel.scale.stored_lod import StoredLod
from umbel.testing import giant

UNIT = 4000


@pytest.fixture(scope="module")
def mesh() -> umbel.Mesh:
    blocks = list(giant.terrain(12_000, seed=5).blocks())
    assert len(blocks) == 1
    return umbel.Mesh(blocks[0].positions, blocks[0].triangles, name="hills")


def test_mesh_of_one_unit_is_as_in_memory(mesh: umbel.Mesh, tmp_path: Path) -> None:
    lod = umbel.build_lod(mesh)
    stored = umbel.build_lod(mesh, memory="1GB", work=tmp_path / "work")
    assert isinstance(stored, StoredLod)
    lod.save(tmp_path / "a.umbel")
    tables = umbel.Asset(tmp_path / "a.umbel").tables
    for table in ("levels", "groups", "clusters", "nodes"):
        assert np.array_equal(getattr(stored.tables, table), getattr(tables, table))
    assert stored.info["metadata"]["name"] == "hills"
    assert stored.config == lod.config | {"unit_triangles": 4 << 20}
    assert stored.report["input_triangles"] == stored.source["triangles"] == len(mesh.triangles)


def test_units_join_and_settings_count(mesh: umbel.Mesh, tmp_path: Path) -> None:
    settings: dict[str, Any] = {"ratio": 0.4, "group_overlap_cost": 0.5, "max_error": 0.5}
    stored = umbel.build_lod(mesh, unit_triangles=UNIT, **settings)
    assert stored.verify().ok
    stored.save(tmp_path / "a.umbel")
    build_asset([mesh], tmp_path / "b.umbel", unit_triangles=UNIT, **settings)
    build_asset([mesh], tmp_path / "c.umbel", unit_triangles=UNIT)
    a, b, c = (umbel.Asset(tmp_path / f"{name}.umbel").tables.groups for name in "abc")
    assert np.array_equal(a, b)
    assert not np.array_equal(b, c)
    assert np.max(b["error"][np.isfinite(b["error"])]) <= 0.5


def test_file_goes_with_the_object_unless_saved(mesh: umbel.Mesh, tmp_path: Path) -> None:
    work = tmp_path / "work"
    stored = umbel.build_lod(mesh, work=work, unit_triangles=UNIT)
    (folder,) = work.iterdir()
    assert os.listdir(folder) == ["lod.umbel"]
    size = stored.save(tmp_path / "kept.umbel")
    stored.save(tmp_path / "kept.umbel")
    with pytest.raises(umbel.Error, match="cannot write"):
        stored.save(tmp_path / "missing" / "kept.umbel")
    del stored
    gc.collect()
    assert not folder.exists()
    assert sorted(os.listdir(tmp_path)) == ["kept.umbel", "work"]
    assert (tmp_path / "kept.umbel").stat().st_size == size
    assert umbel.verify(tmp_path / "kept.umbel").ok


def test_save_copies_where_links_cannot_be(
    mesh: umbel.Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(18, "Invalid cross-device link")

    monkeypatch.setattr(os, "link", refuse)
    umbel.build_lod(mesh, unit_triangles=UNIT).save(tmp_path / "a.umbel")
    assert umbel.verify(tmp_path / "a.umbel").ok
    assert os.listdir(tmp_path) == ["a.umbel"]


def test_save_leaves_links_and_pipes(mesh: umbel.Mesh, tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to("a.umbel")
    os.mkfifo(tmp_path / "pipe")
    lod = umbel.build_lod(mesh, unit_triangles=UNIT)
    lod.save(tmp_path / "link")
    assert (tmp_path / "link").is_symlink()
    assert umbel.verify(tmp_path / "a.umbel").ok
    with pytest.raises(umbel.Error, match="not a regular file"):
        lod.save(tmp_path / "pipe")
    assert (tmp_path / "pipe").is_fifo()


def test_stopped_build_goes_on(mesh: umbel.Mesh, tmp_path: Path) -> None:
    work = tmp_path / "work"

    def stop(_fraction: float, stage: str) -> bool:
        return not stage.startswith("tier 2")

    with pytest.raises(umbel.Cancelled):
        umbel.build_lod(mesh, work=work, unit_triangles=UNIT, progress=stop)
    assert os.listdir(work) == ["units"]
    with pytest.raises(umbel.Error, match="go on with resume"):
        umbel.build_lod(mesh, work=work, unit_triangles=UNIT)
    stored = umbel.build_lod(mesh, work=work, unit_triangles=UNIT, resume=True)
    whole = umbel.build_lod(mesh, unit_triangles=UNIT)
    assert Path(stored.path).read_bytes() == Path(whole.path).read_bytes()


def test_executors_build_it_too(
    mesh: umbel.Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fsspec = pytest.importorskip("fsspec")
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    here = umbel.build_lod(mesh, unit_triangles=UNIT)
    expected = Path(here.path).read_bytes()
    del here
    works = [None, tmp_path / "work", "memory://stored/work"]
    for work in works:
        executor = InProcess()
        stored = umbel.build_lod(mesh, work=work, unit_triangles=UNIT, executor=executor)
        assert Path(stored.path).read_bytes() == expected
        assert len(stored.report["units"]) > 2
        folder = Path(stored.path).parent
        del stored
        gc.collect()
        assert not folder.exists()
    assert not fsspec.filesystem("memory").find("/stored")
    assert not list((tmp_path / "temporary").iterdir())


def test_address_needs_an_executor(
    mesh: umbel.Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(umbel.Error, match="for a build with an executor"):
        umbel.build_lod(mesh, work="memory://stored/work")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("precision", "16bits"),
        ("drop_invalid", True),
        ("measured_error", True),
        ("lock_borders", True),
        ("decimate", lambda *_: None),
        ("locked", [True]),
    ],
)
def test_what_needs_the_whole_mesh_is_refused(
    mesh: umbel.Mesh, tmp_path: Path, setting: str, value: object
) -> None:
    work = tmp_path / "work"
    with pytest.raises(umbel.Error, match=f"{setting} needs the whole mesh"):
        umbel.build_lod(mesh, memory="1GB", work=work, **{setting: value})
    assert not work.exists()


def test_resume_needs_a_folder(mesh: umbel.Mesh) -> None:
    with pytest.raises(umbel.Error, match="work folder"):
        umbel.build_lod(mesh, memory="1GB", resume=True)


def test_setting_that_is_none_is_refused(mesh: umbel.Mesh, tmp_path: Path) -> None:
    with pytest.raises(umbel.Error, match="precision is no setting"):
        build_asset([mesh], tmp_path / "a.umbel", precision="16bits")


def test_file_too_large_for_memory_is_warned_of(
    mesh: umbel.Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("umbel.scale.memory.is_too_large", lambda _: True)
    umbel.save(tmp_path / "a.ply", mesh)
    with pytest.warns(RuntimeWarning, match="with memory= or work="):
        umbel.build_lod(tmp_path / "a.ply")


def test_names_are_those_of_a_build_in_memory(tmp_path: Path) -> None:
    path = tmp_path / "hill.ply"
    giant.write(giant.terrain(3000, seed=3), path)
    for source in (path, umbel.load(path), [path]):
        umbel.build_asset(source, tmp_path / "a.umbel", unit_triangles=1000)
        lod = umbel.build_lod(source, unit_triangles=1000)
        for asset in (umbel.Asset(tmp_path / "a.umbel"), lod):
            assert asset.info["metadata"]["name"] == "hill"
