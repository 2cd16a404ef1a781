"""Builds by executors: the same bytes as those of one machine, through a folder or an address."""

from __future__ import annotations

import errno
import os
import random
import subprocess
import sys
from pathlib import Path

import pytest

import umbel
from umbel.cli.building.build_file import Limits, Options, build_units
from umbel.scale.build_asset import build_asset
from umbel.scale.executor import CODES, InProcess, Result, Task, perform
from umbel.scale.storage import Folder, fetch_sources

UNIT = 4000


class Careless(InProcess):
    """Does tasks in any order, some twice, and loses some."""

    def __init__(self, seed: int) -> None:
        super().__init__()
        self._random = random.Random(seed)
        self.lost = 0

    def slots(self) -> int:
        return 3

    def wait(self, seconds: float) -> Result | None:
        if not self._waiting:
            return None
        self._waiting.rotate(self._random.randrange(3))
        task = self._waiting.popleft()
        if self._random.random() < 0.3 and self.lost < 4:
            self.lost += 1
            return Result(task, "lost", "io")
        if self._random.random() < 0.3:
            perform(task)
        return perform(task)


def test_tasks_in_this_process(tiles: list[Path], made_of_tiles: bytes, tmp_path: Path) -> None:
    output = tmp_path / "a.umbel"
    report = build_asset(tiles, output, unit_triangles=UNIT, executor=InProcess())
    assert output.read_bytes() == made_of_tiles
    assert len(report["units"]) > 4
    assert all(unit["build_seconds"] > 0 for unit in report["units"])


class Nobody(InProcess):
    def connect(self) -> None:
        raise umbel.Error("nobody is there")


def test_who_builds_is_asked_before_the_source_is_read(tmp_path: Path) -> None:
    with pytest.raises(umbel.Error, match="nobody is there"):
        build_asset(tmp_path / "none.ply", tmp_path / "a.umbel", executor=Nobody())
    assert list(tmp_path.iterdir()) == []


def test_patterns_are_files_by_name(
    tiles: list[Path], made_of_tiles: bytes, tmp_path: Path
) -> None:
    pattern = str(tiles[0].parent / "*.ply")
    build_asset(pattern, tmp_path / "a.umbel", unit_triangles=UNIT)
    assert (tmp_path / "a.umbel").read_bytes() == made_of_tiles
    with pytest.raises(umbel.Error, match="no file matches"):
        build_asset(str(tmp_path / "*.ply"), tmp_path / "b.umbel")


def test_patterns_that_overlap_name_a_file_once(tiles: list[Path], tmp_path: Path) -> None:
    """As they do without an executor."""
    patterns = [str(tiles[0].parent / pattern) for pattern in ("*.ply", "*.pl?")]
    options, output = Options(unit_triangles=UNIT), tmp_path / "a.umbel"
    report = build_units(patterns, str(output), options, Limits(), executor=InProcess())
    build_asset(tiles, tmp_path / "b.umbel", unit_triangles=UNIT)
    found = [umbel.Asset(path).info["source_triangles"] for path in sorted(tmp_path.iterdir())]
    assert found == [report["input_triangles"]] * 2


@pytest.mark.parametrize("seed", range(3))
def test_lost_and_repeated_tasks(
    tiles: list[Path], made_of_tiles: bytes, tmp_path: Path, seed: int
) -> None:
    output = tmp_path / "a.umbel"
    careless = Careless(seed)
    build_asset(tiles, output, unit_triangles=UNIT, executor=careless)
    assert careless.lost > 0
    assert output.read_bytes() == made_of_tiles


def test_source_that_no_other_machine_has(
    tiles: list[Path], made_of_tiles: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried = []

    def refuse(task: Task) -> None:
        tried.append(task)
        raise OSError("it is not on this machine")

    monkeypatch.setattr("umbel.scale.executor.shared_source", refuse)
    output = tmp_path / "a.umbel"
    report = build_asset(tiles, output, unit_triangles=UNIT, executor=InProcess())
    assert output.read_bytes() == made_of_tiles
    assert tried
    assert not any(t["kind"] == "sort" and t["tier"] == 0 for t in report["tasks"])


class Hopeless(InProcess):
    def wait(self, seconds: float) -> Result | None:
        return (
            Result(self._waiting.popleft(), "its machine burned", "io") if self._waiting else None
        )


def test_what_is_lost_again_and_again_ends_the_build(tiles: list[Path], tmp_path: Path) -> None:
    output = tmp_path / "a.umbel"
    with pytest.raises(umbel.Error, match="its machine burned"):
        build_asset(tiles, output, unit_triangles=UNIT, executor=Hopeless())
    assert not output.exists()


class OfAnother(InProcess):
    def submit(self, task: Task) -> None:
        super().submit(Task(task.work, task.tier, task.unit, task.threads, "0.0 of old"))


def test_other_build_of_the_library_is_refused(tiles: list[Path], tmp_path: Path) -> None:
    with pytest.raises(umbel.Error, match="has another build of umbel"):
        build_asset(tiles, tmp_path / "a.umbel", unit_triangles=UNIT, executor=OfAnother())


def test_a_worker_that_cannot_say_why_ends_with_the_kind_of_error(tmp_path: Path) -> None:
    code = "import sys; from umbel.scale.worker import main; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", code, "1", str(tmp_path), "0", "0"]
    reader, writer = os.pipe()
    os.close(reader)  # so that every write fails
    with open(writer, "wb") as nowhere:
        done = subprocess.run(command, stderr=nowhere, timeout=60, check=False)
    assert done.returncode == 10 + CODES.index("io")


def test_a_full_folder_for_temporary_files_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    memory = pytest.importorskip("fsspec").filesystem("memory")
    memory.pipe_file("/full/a.ply", b"ply")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(type(memory), "get_file", full)
    for fetch in (
        lambda: fetch_sources(["memory://full/a.ply"], tmp_path),
        lambda: Folder("memory://full").get("a.ply", tmp_path / "a.ply"),
    ):
        with pytest.raises(umbel.Error, match=f"cannot write {tmp_path}.*TMPDIR") as found:
            fetch()
        assert found.value.code == "io"
    memory.rm("/full", recursive=True)
