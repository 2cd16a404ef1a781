"""Object stores that can do less than S3: what is built there is the same."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import umbel
from umbel.scale.build_asset import build_asset
from umbel.scale.executor import InProcess, Result
from umbel.scale.storage import Folder, put_file

fsspec = pytest.importorskip("fsspec")

UNIT = 4000
TILES = "bucket://b/tiles/*.ply"
OUTPUT = "bucket://b/scan.umbel"
WORK = "bucket://b/work"


@pytest.fixture
def store(
    tiles: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[dict[str, bytes]]:
    from helpers.bucket_system import BucketSystem

    monkeypatch.setattr("umbel.scale.address_lock._SETTLE", 0.01)
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    fsspec.register_implementation("bucket", BucketSystem, clobber=True)
    store = {f"b/tiles/{tile.name}": tile.read_bytes() for tile in tiles}
    monkeypatch.setattr(BucketSystem, "store", store)
    BucketSystem.clear_instance_cache()
    yield store
    BucketSystem.clear_instance_cache()


def made(store: dict[str, bytes]) -> list[str]:
    return sorted(name for name in store if "/tiles/" not in name)


class Stops(InProcess):
    """Is ended after so many tasks."""

    def __init__(self, after: int) -> None:
        super().__init__()
        self.left = after

    def wait(self, seconds: float) -> Result | None:
        if self.left == 0:
            raise KeyboardInterrupt
        self.left -= 1
        return super().wait(seconds)


def build(executor: Any, **options: Any) -> dict[str, Any]:
    return build_asset(TILES, OUTPUT, work=WORK, unit_triangles=UNIT, executor=executor, **options)


def test_same_bytes(store: dict[str, bytes], made_of_tiles: bytes, tmp_path: Path) -> None:
    build(InProcess())
    assert store["b/scan.umbel"] == made_of_tiles
    assert made(store) == ["b/scan.umbel"]
    assert not list((tmp_path / "temporary").iterdir())


def test_another_machine_goes_on(
    store: dict[str, bytes], made_of_tiles: bytes, tmp_path: Path
) -> None:
    with pytest.raises(KeyboardInterrupt):
        build(Stops(12))
    shutil.rmtree(tmp_path / "temporary")
    (tmp_path / "temporary").mkdir()
    with pytest.raises(umbel.Error, match="not finished: go on with resume"):
        build(InProcess())
    build(InProcess(), resume=True)
    assert store["b/scan.umbel"] == made_of_tiles
    assert made(store) == ["b/scan.umbel"]


def test_what_others_wrote_is_seen(store: dict[str, bytes]) -> None:
    """Lists and small files are read again."""
    folder = Folder("bucket://b/small")
    folder.write("a", b"1")
    assert folder.files() == {"a": 1}
    store["b/small/t0/b"] = b"22"
    store["b/small/a"] = b"333"
    assert folder.files() == {"a": 3, "t0/b": 2}
    assert folder.read("a") == b"333"
    assert folder.read("none") is None


def test_writing_that_fails_is_said(
    store: dict[str, bytes], tiles: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    from helpers.bucket_system import BucketSystem

    def closed(*_: Any, **__: Any) -> None:
        raise PermissionError("the bucket is closed")

    monkeypatch.setattr(BucketSystem, "put_file", closed)
    with pytest.raises(umbel.Error, match=r"cannot write bucket://b/scan\.umbel: the bucket is"):
        put_file(tiles[0], OUTPUT)
    assert made(store) == []
