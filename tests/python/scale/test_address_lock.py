"""A lock at an address: two builds are kept apart, and one whose owner is gone stands in nobody's
way."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import umbel
from umbel.scale.address_lock import NAME, AddressLock, _machine
from umbel.scale.build_asset import build_asset
from umbel.scale.executor import InProcess, Result
from umbel.scale.storage import Folder
from umbel.testing import giant

fsspec = pytest.importorskip("fsspec")

BEAT, GONE = 0.05, 0.5


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch) -> Iterator[Folder]:
    monkeypatch.setattr("umbel.scale.address_lock._BEAT", BEAT)
    monkeypatch.setattr("umbel.scale.address_lock._GONE", GONE)
    monkeypatch.setattr("umbel.scale.address_lock._SETTLE", BEAT / 2)
    yield Folder("memory://locked/work")
    system = fsspec.filesystem("memory")
    if system.exists("/locked"):
        system.rm("/locked", recursive=True)


def test_second_is_refused_until_the_first_is_done(folder: Folder) -> None:
    first = AddressLock(folder)
    with pytest.raises(umbel.Error, match="another build is at work in memory://locked/work, on"):
        AddressLock(folder)
    first.check()
    first.release()
    assert folder.read(NAME) is None
    AddressLock(folder).release()


def stands_still(machine: str, process: int) -> bytes:
    said = {"owner": "a", "count": 3, "host": "h", "machine": machine, "process": process}
    return json.dumps(said).encode()


def test_owner_on_another_machine_that_is_gone(folder: Folder) -> None:
    folder.write(NAME, stands_still("another", 1))
    began = time.monotonic()
    lock = AddressLock(folder)
    assert time.monotonic() - began >= GONE
    lock.release()


def test_owner_on_this_machine_that_is_gone(
    folder: Folder, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("umbel.scale.address_lock._GONE", 60)
    child = subprocess.Popen([sys.executable, "-c", ""])
    child.wait()
    folder.write(NAME, stands_still(_machine(), child.pid))
    began = time.monotonic()
    AddressLock(folder).release()
    assert time.monotonic() - began < 10


def test_whoever_lost_it_notices(folder: Folder) -> None:
    lock = AddressLock(folder)
    folder.write(NAME, stands_still("another", 1))
    end = time.monotonic() + 60
    with pytest.raises(umbel.Error, match="another build has taken memory://locked/work, on h"):
        while time.monotonic() < end:
            lock.check()
            time.sleep(BEAT)
    lock.release()
    assert folder.read(NAME) == stands_still("another", 1)


def test_of_two_writers_at_once_the_last_has_it(
    folder: Folder, monkeypatch: pytest.MonkeyPatch
) -> None:
    def overtaken(_: float) -> None:
        folder.write(NAME, stands_still("another", 1))

    monkeypatch.setattr("umbel.scale.address_lock.time.sleep", overtaken)
    with pytest.raises(umbel.Error, match="another build is at work"):
        AddressLock(folder)


def test_damaged_lock_is_one_that_stands_still(folder: Folder) -> None:
    folder.write(NAME, b"{")
    AddressLock(folder).release()


def test_two_builds(folder: Folder, tmp_path: Path) -> None:
    """A second is refused before it changes anything, and the first goes on."""
    mesh = tmp_path / "mesh.ply"
    giant.write(giant.terrain(12_000, seed=5), mesh)
    settings: dict[str, Any] = {"work": folder.url, "unit_triangles": 4000}

    class Meets(InProcess):
        refused = 0

        def wait(self, seconds: float) -> Result | None:
            before = folder.files()
            if self.refused < 2:
                with pytest.raises(umbel.Error, match="another build is at work"):
                    build_asset(
                        mesh, tmp_path / "b.umbel", executor=InProcess(), resume=True, **settings
                    )
                self.refused += 1
                assert {k: v for k, v in folder.files().items() if k != NAME} == {
                    k: v for k, v in before.items() if k != NAME
                }
            return super().wait(seconds)

    meets = Meets()
    build_asset(mesh, tmp_path / "a.umbel", executor=meets, **settings)
    assert meets.refused == 2
    assert not folder.files()
    build_asset(mesh, tmp_path / "c.umbel", unit_triangles=4000)
    assert (tmp_path / "a.umbel").read_bytes() == (tmp_path / "c.umbel").read_bytes()
