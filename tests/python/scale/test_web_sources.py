"""Tiles that are read by HTTP, and what is said where an address cannot be used."""

from __future__ import annotations

import functools
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import umbel
from umbel.scale.build_asset import build_asset
from umbel.scale.executor import InProcess
from umbel.scale.storage import fetch_sources

fsspec = pytest.importorskip("fsspec")
pytest.importorskip("aiohttp")

UNIT = 4000


class Quiet(SimpleHTTPRequestHandler):
    """Lists folders, and sends whole files."""

    def log_message(self, *_: Any) -> None:
        pass


@contextmanager
def served(folder: Path, kind: type[Quiet] = Quiet) -> Iterator[str]:
    handler = functools.partial(kind, directory=str(folder))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()
        thread.join()


@pytest.fixture(scope="module")
def web(tiles: list[Path]) -> Iterator[str]:
    with served(tiles[0].parent) as address:
        yield address


@pytest.fixture(autouse=True)
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))


def test_a_slow_answer_may_take_long(
    tiles: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only silence is limited, not the time of a whole answer."""
    import aiohttp

    class Slow(Quiet):
        def copyfile(self, source: Any, outputfile: Any) -> None:
            data = source.read()
            for k in range(4):
                time.sleep(0.3)
                outputfile.write(data[k * len(data) // 4 : (k + 1) * len(data) // 4])

    monkeypatch.setattr("aiohttp.client.DEFAULT_TIMEOUT", aiohttp.ClientTimeout(total=0.5))
    with served(tiles[0].parent, Slow) as address:
        (path,) = fetch_sources([f"{address}/{tiles[0].name}"], tmp_path / "fetched")
        assert path.read_bytes() == tiles[0].read_bytes()


def test_tiles_by_pattern(web: str, made_of_tiles: bytes, tmp_path: Path) -> None:
    output = tmp_path / "a.umbel"
    build_asset(f"{web}/*.ply", output, unit_triangles=UNIT)
    assert output.read_bytes() == made_of_tiles


def test_tiles_by_name_are_sorted_by_others(
    web: str, tiles: list[Path], made_of_tiles: bytes, tmp_path: Path
) -> None:
    names = [f"{web}/{tile.name}?version=2" for tile in tiles]
    output = tmp_path / "a.umbel"
    work = "memory://web/work"
    report = build_asset(names, output, work=work, unit_triangles=UNIT, executor=InProcess())
    assert output.read_bytes() == made_of_tiles
    assert any(t["kind"] == "sort" and t["tier"] == 0 for t in report["tasks"])


def test_missing_tile(web: str, tmp_path: Path) -> None:
    with pytest.raises(umbel.Error, match=r"cannot read http://.*/none\.ply: .* 404 "):
        build_asset(f"{web}/none.ply", tmp_path / "a.umbel", unit_triangles=UNIT)
    with pytest.raises(umbel.Error, match="no file matches http://"):
        build_asset(f"{web}/*.obj", tmp_path / "a.umbel", unit_triangles=UNIT)


def test_no_copies_of_tiles_are_left(web: str, tiles: list[Path], tmp_path: Path) -> None:
    names = [f"{web}/{tile.name}" for tile in tiles]
    with pytest.raises(umbel.Error, match="none"):
        build_asset([*names, f"{web}/none.ply"], tmp_path / "a.umbel", unit_triangles=UNIT)
    assert not list((tmp_path / "temporary").iterdir())
    build_asset(names, tmp_path / "a.umbel", unit_triangles=UNIT)
    assert not list((tmp_path / "temporary").iterdir())


def test_mended_tile_of_the_same_size_is_fetched_again(tmp_path: Path) -> None:
    """Of a server that tells when a file was changed, and nothing else."""
    (tmp_path / "web").mkdir()
    tile = tmp_path / "web" / "a.stl"
    corners = np.zeros(1, [("normal", "<f4", 3), ("at", "<f4", (3, 3)), ("rest", "<u2")])

    def write(y: float, second: int) -> None:
        corners["at"] = [[0, 0, 0], [1, 0, 0], [0, y, 0]]
        tile.write_bytes(bytes(80) + np.uint32(1).tobytes() + corners.tobytes())
        os.utime(tile, (1e9 + second, 1e9 + second))

    with served(tile.parent) as web:
        write(np.nan, 1)
        with pytest.raises(umbel.Error, match="not finite"):
            build_asset(f"{web}/a.stl", tmp_path / "a.umbel", unit_triangles=UNIT)
        write(5, 2)
        build_asset(f"{web}/a.stl", tmp_path / "a.umbel", unit_triangles=UNIT)
    assert umbel.load(tile).positions.max() == 5


def test_nothing_is_written_by_http(web: str, tiles: list[Path], tmp_path: Path) -> None:
    with pytest.raises(umbel.Error, match=r"a\.umbel: sources can be read by HTTP, but nothing"):
        build_asset(tiles, f"{web}/a.umbel", unit_triangles=UNIT)
    with pytest.raises(umbel.Error, match="work: sources can be read by HTTP, but nothing"):
        build_asset(tiles, tmp_path / "a.umbel", work=f"{web}/work", executor=InProcess())
    assert not list((tmp_path / "temporary").iterdir())


@pytest.mark.parametrize(("scheme", "package"), [("gcs", "gcsfs"), ("az", "adlfs")])
def test_package_of_an_address_is_missing(
    scheme: str, package: str, tiles: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, package, None)
    with pytest.raises(umbel.Error, match=f"{scheme}://bucket/a.umbel: .*{package}"):
        build_asset(tiles, f"{scheme}://bucket/a.umbel", unit_triangles=UNIT)


def test_unknown_scheme(tiles: list[Path]) -> None:
    with pytest.raises(umbel.Error, match="cannot use gopher://"):
        build_asset(tiles, "gopher://bucket/a.umbel", unit_triangles=UNIT)
