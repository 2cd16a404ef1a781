"""Assets from elsewhere than files, and residency."""

import functools
import gc
import http.server
import io
import math
import mmap
import subprocess
import sys
import threading
import time
import weakref
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import umbel


class RangeHandler(http.server.SimpleHTTPRequestHandler):
    """A file server that knows ranges, and counts what it sends."""

    sent = 0

    def do_GET(self) -> None:
        data = (Path(self.directory) / self.path.lstrip("/")).read_bytes()
        span = self.headers.get("Range", "")
        status, first, last = 200, 0, len(data) - 1
        if span.startswith("bytes="):
            low, high = span[6:].split("-")
            status, first, last = 206, int(low), min(int(high or last), last)
        body = data[first : last + 1]
        self.send_response(status)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Accept-Ranges", "bytes")
        if status == 206:
            self.send_header("Content-Range", f"bytes {first}-{last}/{len(data)}")
        self.end_headers()
        type(self).sent += len(body)
        self.wfile.write(body)

    def log_message(self, *args: object) -> None:
        pass


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("assets")
    lod = umbel.build_lod(umbel.shapes.blob(6, seed=2), precision="14bits")
    lod.save(folder / "a.umbel", page_bytes=16384)
    return folder


@pytest.fixture
def server(folder: Path) -> Iterator[str]:
    RangeHandler.sent = 0
    handler = functools.partial(RangeHandler, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
        thread.join()


def expect_same(asset: umbel.Asset, folder: Path) -> None:
    given = umbel.Asset(folder / "a.umbel")
    assert asset.info == given.info
    cut = asset.cut(triangles=3000)
    assert np.array_equal(cut, given.cut(triangles=3000))
    assert np.array_equal(asset.mesh(cut).positions, given.mesh(cut).positions)
    assert asset.verify(4).ok


def test_an_asset_opens_from_a_server_with_few_bytes(server: str, folder: Path) -> None:
    pytest.importorskip("aiohttp")
    asset = umbel.Asset(f"{server}/a.umbel")
    assert RangeHandler.sent == asset.info["header_bytes"] < asset.info["file_bytes"] / 20
    expect_same(asset, folder)
    with pytest.raises(umbel.Error, match="cannot open"):
        umbel.Asset(f"{server}/missing.umbel")


def test_closing_waits_little_for_a_server_that_is_silent(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("aiohttp")
    monkeypatch.setattr("umbel.lod.remote._SILENCE", 0.5)
    is_silent, asked, ends = threading.Event(), threading.Event(), threading.Event()

    class Silent(RangeHandler):
        def do_GET(self) -> None:
            if is_silent.is_set():
                asked.set()
                ends.wait(60)
            else:
                super().do_GET()

    handler = functools.partial(Silent, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        residency = umbel.Residency(
            umbel.Asset(f"http://127.0.0.1:{server.server_port}/a.umbel"), attempts=1
        )
        is_silent.set()
        residency.step([0.0])
        assert asked.wait(60)
        started = time.monotonic()
        while not residency.statistics["given_up"]:
            assert time.monotonic() - started < 60
            time.sleep(0.01)
            residency.step([0.0])
        started = time.monotonic()
        residency.close()
        assert time.monotonic() - started < 20
        ends.set()
        server.shutdown()
        thread.join()
    assert "imeout" in residency.statistics["last_problem"]


def test_a_server_without_ranges_is_called_so(folder: Path) -> None:
    pytest.importorskip("aiohttp")
    plain = functools.partial(http.server.SimpleHTTPRequestHandler, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), plain) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        address = f"http://127.0.0.1:{server.server_address[1]}"
        with pytest.raises(umbel.Error, match="sends whole files only"):
            umbel.Asset(f"{address}/a.umbel")
        (folder / "other.txt").write_bytes(b"0123456789abcdef")
        with pytest.raises(umbel.Error, match=r"http.*/other\.txt: this is not a \.umbel file"):
            umbel.Asset(f"{address}/other.txt")
        with pytest.raises(umbel.Error, match=r"cannot open .*: the server answers 404 "):
            umbel.Asset(f"{address}/missing.umbel")
        server.shutdown()
        thread.join()


def test_a_server_that_redirects_in_a_circle_is_called_so() -> None:
    pytest.importorskip("aiohttp")

    class Circle(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(302)
            self.send_header("Location", self.path)
            self.send_header("Content-Length", "0")
            self.end_headers()

        do_HEAD = do_GET

        def log_message(self, *args: object) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Circle) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        with pytest.raises(umbel.Error, match=r"cannot open .*: the server redirects too often"):
            umbel.Asset(f"http://127.0.0.1:{server.server_port}/a.umbel")
        server.shutdown()
        thread.join()


def test_an_asset_opens_from_memory_an_archive_and_an_open_file(folder: Path) -> None:
    fsspec = pytest.importorskip("fsspec")
    data = (folder / "a.umbel").read_bytes()
    with fsspec.open("memory://box/a.umbel", "wb") as file:
        file.write(data)
    expect_same(umbel.Asset("memory://box/a.umbel"), folder)
    with zipfile.ZipFile(folder / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("inside/a.umbel", data)
    expect_same(umbel.Asset(f"zip://inside/a.umbel::file://{folder / 'a.zip'}"), folder)
    with (folder / "a.umbel").open("rb") as file:
        expect_same(umbel.Asset(file), folder)
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as mapped:
            expect_same(umbel.Asset(mapped), folder)
    expect_same(umbel.Asset(Parts(folder / "a.umbel")), folder)


class Parts(io.FileIO):
    """Gives at most a thousand bytes at once."""

    def read(self, count: int = -1) -> bytes:
        return super().read(min(count, 1000))


def test_an_open_file_may_have_a_name_that_is_no_text(folder: Path) -> None:
    with io.BytesIO((folder / "a.umbel").read_bytes()) as file:
        file.name = "a\udcff.umbel"
        expect_same(umbel.Asset(file), folder)
    with io.BytesIO(b"no asset") as file:
        file.name = "a\udcff.umbel"
        with pytest.raises(umbel.Error, match=r"^a\?\.umbel: "):
            umbel.Asset(file)


def test_a_source_that_fails_or_gives_too_little_is_an_error(folder: Path) -> None:
    class Broken:
        def __init__(self, file: object, keep: int) -> None:
            self.file, self.keep, self.name = file, keep, file.name

        def seek(self, *args: int) -> int:
            return self.file.seek(*args)

        def tell(self) -> int:
            return self.file.tell()

        def read(self, count: int) -> bytes:
            if self.keep < 0:
                raise OSError("the line is dead")
            return self.file.read(min(count, max(self.keep - self.tell(), 0)))

    with (folder / "a.umbel").open("rb") as file:
        with pytest.raises(umbel.Error, match=r"a\.umbel: .*gave 84 bytes"):
            umbel.Asset(Broken(file, 100))
        with pytest.raises(umbel.Error, match="the line is dead"):
            umbel.Asset(Broken(file, -1))
    with pytest.raises(umbel.Error, match="an open file"):
        umbel.Asset(17)


def test_a_source_whose_error_is_no_text_is_an_error(folder: Path) -> None:
    code = (
        "def fail(count):\n"
        "    raise OSError('no \\udcff here')\n"
        "file = open(sys.argv[1], 'rb')\n"
        "class Failing:\n"
        "    seek, tell, read = file.seek, file.tell, staticmethod(fail)\n"
        "try:\n"
        "    umbel.Asset(Failing())\n"
        "except umbel.Error as error:\n"
        "    print(str(error).split(': ', 1)[1])\n"
    )
    said = "reading 16 bytes at byte 0 failed: OSError: no \\udcff here\n"
    assert run(code, folder / "a.umbel") == said


class HeldFile(io.FileIO):
    """A file that may have attributes."""


def test_files_that_hold_what_reads_them_are_freed(folder: Path) -> None:
    def ring(has_residency: bool, has_tables: bool) -> weakref.ref[HeldFile]:
        file = HeldFile(folder / "a.umbel")
        file.asset = umbel.Asset(file)
        if has_residency:
            file.residency = umbel.Residency(file.asset)
            file.residency.step([0.0])
        if has_tables:
            file.tables = file.asset.tables
        return weakref.ref(file)

    rings = [ring(*has) for has in ((False, False), (True, False), (False, True), (True, True))]
    deadline = time.monotonic() + 60
    while any(file() for file in rings):  # a read that is under way holds its file until it ends
        assert time.monotonic() < deadline, [file() for file in rings]
        time.sleep(0.01)
        gc.collect()


def test_tables_outlive_their_asset(folder: Path) -> None:
    clusters = umbel.Asset(HeldFile(folder / "a.umbel")).tables.clusters
    gc.collect()
    assert np.array_equal(clusters, umbel.Asset(folder / "a.umbel").tables.clusters)


def run(code: str, path: Path, timeout: float = 60) -> str:
    """What a process of its own prints, as it may hang or crash."""
    head = (
        "import io, sys, threading, time, umbel\n"
        "class Slow(io.FileIO):\n"
        "    def read(self, count=-1):\n"
        "        time.sleep(0.002)\n"
        "        return super().read(count)\n"
        "asset = umbel.Asset(Slow(sys.argv[1]))\n"
    )
    command = [sys.executable, "-c", head + code, str(path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


@pytest.mark.parametrize("call", ["asset.mesh([0, 1])", "asset._native.normal_cones()"])
def test_threads_that_read_an_open_file_do_not_wait_for_each_other_for_ever(
    folder: Path, call: str
) -> None:
    code = (
        f"threads = [threading.Thread(target=lambda: {call}) for _ in range(4)]\n"
        "for thread in threads: thread.start()\n"
        "for thread in threads: thread.join()\n"
        "print('read')\n"
    )
    assert run(code, folder / "a.umbel") == "read\n"


def test_threads_may_share_a_residency(folder: Path) -> None:
    code = (
        "residency = umbel.Residency(asset, budget=100_000)\n"
        "def use(first):\n"
        "    for k in range(500):\n"
        "        residency.step([(0.0, 0.1, 0.001, 0.01)[(first + k) % 4]])\n"
        "        residency.cut(), residency.resident_pages, residency.statistics\n"
        "threads = [threading.Thread(target=use, args=(k,)) for k in range(4)]\n"
        "for thread in threads: thread.start()\n"
        "for thread in threads: thread.join()\n"
        "print(residency.statistics['steps'])\n"
    )
    assert run(code, folder / "a.umbel") == "2000\n"


def test_a_program_may_end_while_pages_load(folder: Path) -> None:
    code = "residency = umbel.Residency(asset)\nprint(residency.step([0.0])['requested'] > 0)\n"
    assert run(code, folder / "a.umbel") == "True\n"


def test_a_forked_process_refuses_a_residency_and_ends(folder: Path) -> None:
    code = (
        "import os\n"
        "asset = umbel.Asset(sys.argv[1])\n"
        "residency = umbel.Residency(asset)\n"
        "residency.step([0.0])\n"
        "child = os.fork()\n"
        "if child == 0:\n"
        "    try:\n"
        "        residency.step([0.0])\n"
        "    except umbel.Error as error:\n"
        "        print('forked' in str(error), flush=True)\n"
        "    residency.close()\n"
        "    umbel.Residency(asset).step([0.0])\n"
        "else:\n"
        "    print(os.waitpid(child, 0)[1])\n"
        "    residency.step([0.0])\n"
    )
    assert run(code, folder / "a.umbel") == "True\n0\n"


def test_residency_over_a_server_comes_to_the_ideal_cut(server: str) -> None:
    pytest.importorskip("aiohttp")
    asset = umbel.Asset(f"{server}/a.umbel")
    residency = umbel.Residency(asset)
    error = 0.005
    for _ in range(3000):
        step = residency.step([error])
        if step["missing_groups"] == 0:
            break
        time.sleep(0.005)
    assert step["worst_error"] == 0
    assert np.array_equal(residency.cut(), asset.cut(error=error))
    said = residency.statistics
    assert said["resident_pages"] == len(residency.resident_pages)
    assert said["given_up"] == []
    residency.close()
    assert residency.step([error])["missing_groups"] == 0


def to_and_fro(asset: umbel.Asset, hysteresis: float) -> dict[str, int]:
    """Statistics of a camera that goes from one side to the other ten times, with half of the pages
    in memory."""
    residency = umbel.Residency(
        asset, asset.info["file_bytes"] // 2, hysteresis=hysteresis, link=(0.0, 1e9, 0.0, 0.0)
    )
    for k in range(200):
        angle = 0.3 if k // 10 % 2 else -0.3
        eye = (1.8 * math.sin(angle), 0.1, 1.8 * math.cos(angle))
        step = residency.step([umbel.Camera(eye, target=(0, 0, 0), pixel_error=0.5)], now=k / 60)
        assert step["caught_up"]
    return residency.statistics


def test_hysteresis_spares_a_camera_that_moves_to_and_fro_its_reloads(tmp_path: Path) -> None:
    lod = umbel.build_lod(umbel.shapes.blob(6, seed=2), precision="14bits")
    lod.save(tmp_path / "a.umbel", page_bytes=8192)
    asset = umbel.Asset(tmp_path / "a.umbel")
    without, default = to_and_fro(asset, 1.0), to_and_fro(asset, 1.5)
    assert without["reloads"] >= 15
    assert 4 * default["reloads"] < without["reloads"]
    assert default["evictions"] < without["evictions"]
    assert default["resident_bytes"] > 0.8 * without["resident_bytes"]


def test_a_residency_has_no_more_threads_than_loads(folder: Path) -> None:
    readers = set()

    class Watched(io.FileIO):
        def read(self, count: int = -1) -> bytes:
            readers.add(threading.get_ident())
            time.sleep(0.002)  # time for the next thread to come
            return super().read(count)

    def readers_of(loads: int, threads: int) -> int:
        asset = umbel.Asset(Watched(folder / "a.umbel"))
        readers.clear()
        residency = umbel.Residency(asset, loads_in_flight=loads, threads=threads)
        while residency.step([0.0])["missing_groups"] > 0:
            time.sleep(0.001)
        residency.close()
        return len(readers - {threading.get_ident()})

    assert readers_of(loads=3, threads=10**6) <= 3
    assert readers_of(loads=8, threads=8) > 3


def test_residency_says_what_it_cannot_do(folder: Path) -> None:
    asset = umbel.Asset(folder / "a.umbel")
    with pytest.raises(umbel.Error, match="budget"):
        umbel.Residency(asset, budget=10)
    residency = umbel.Residency(asset)
    with pytest.raises(umbel.Error):
        residency.step([(3, 0.1)])
    with pytest.raises(umbel.Error, match="negative"):
        residency.step([-1.0])
    with pytest.raises(umbel.Error):
        residency.set_budget(1)
    for name, call in (
        ("budget", lambda: umbel.Residency(asset, budget=-1)),
        ("budget", lambda: residency.set_budget(-1)),
        ("loads_in_flight", lambda: umbel.Residency(asset, loads_in_flight=-1)),
        ("attempts", lambda: umbel.Residency(asset, attempts=-1)),
        ("threads", lambda: umbel.Residency(asset, threads=-1)),
        ("mesh", lambda: residency.step([(-1, 0.1)])),
        ("view", lambda: residency.cut(-1)),
        ("index", lambda: asset.cluster(-1)),
        ("mesh", lambda: asset.mesh_tables(-1)),
        ("mesh", lambda: asset.mesh(asset.cut(level=0), -1)),
    ):
        with pytest.raises(umbel.Error, match=f"^{name} must be from 0"):
            call()
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"hysteresis": 0.5}, "hysteresis must be at least 1, not 0.5"),
        ({"hysteresis": "two"}, "hysteresis must be a number"),
        ({"backoff": float("nan")}, "backoff must be at least 0"),
        ({"slow": -1}, "slow must be at least 0"),
        ({"link": (0.1, 1e6)}, "link must have 4 numbers, not 2"),
        ({"link": (0.1, 1e6, 0, "1")}, "link must be a number, not '1'"),
        ({"link": (0.1, 1e6, 1.5, 0)}, "the shares of a link's loads .* from 0 to 1"),
        ({"link": (0.1, 1e6, 0, float("nan"))}, "the shares of a link's loads .* from 0 to 1"),
    ]
    for options, sentence in wrong:
        with pytest.raises(umbel.Error, match=f"^{sentence}"):
            umbel.Residency(asset, **options)


def test_several_meshes_instances_and_textures_come_back(tmp_path: Path) -> None:
    from umbel.io.textures.images import TextureImage

    pixels = tmp_path / "red.png"
    from PIL import Image

    Image.new("RGB", (2, 2), (255, 0, 0)).save(pixels)
    material = umbel.Material(
        name="red",
        roughness=0.25,
        emissive=(2.0, 0.5, 0.0),
        textures={"base_color": {"index": 5, "texCoord": 0}},
        images={"base_color": TextureImage(path=pixels, wrap_u="clamp", nearest=True)},
    )
    blob = umbel.shapes.blob(3, seed=1)
    painted = umbel.Mesh(
        blob.positions,
        blob.triangles,
        uvs=blob.positions[:, :2].copy(),
        material_ids=np.zeros(len(blob.triangles), np.uint32),
        materials=[material],
    )
    lods = [umbel.build_lod(painted), umbel.build_lod(umbel.shapes.torus(24, 12))]
    moved = np.eye(4)
    moved[:3, 3] = (1, 2, 3)
    places = [(1, np.eye(4)), (0, moved), (1, 2 * moved[:3])]
    for textures in ("embed", "external"):
        umbel.save_asset(tmp_path / "a.umbel", lods, places, textures=textures)
        asset = umbel.Asset(tmp_path / "a.umbel")
        assert [mesh for mesh, _ in asset.instances] == [1, 0, 1]
        for (_, given), (_, stored) in zip(places, asset.instances, strict=True):
            assert np.array_equal(np.float32(given)[:3], stored)
        assert len(asset.meshes) == 2
        for index, lod in enumerate(lods):
            cut = asset.mesh_tables(index).cut(level=0)
            assert len(asset.mesh(cut, index).triangles) == asset.meshes[index]["source_triangles"]
            assert len(lod.clusters) == asset.meshes[index]["clusters"]
        again, plain = asset.materials
        assert plain == umbel.Material()
        for index in (0, 1):
            cut = asset.mesh_tables(index).cut(level=0)
            assert set(asset.mesh(cut, index).material_ids) == {index}
        assert (again.name, again.roughness, again.emissive) == ("red", 0.25, (2.0, 0.5, 0.0))
        image = again.images["base_color"]
        assert (image.wrap_u, image.wrap_v, image.nearest) == ("clamp", "repeat", True)
        assert (image.path is None) == (textures == "embed")
        assert np.array_equal(image.texels()[0, 0], [255, 0, 0, 255])
        assert asset.verify(4).ok
    umbel.save_asset(tmp_path / "a.umbel", lods, textures="none")
    assert not umbel.Asset(tmp_path / "a.umbel").materials[0].images
    with pytest.raises(umbel.Error, match="instance"):
        umbel.save_asset(tmp_path / "a.umbel", lods, [(2, np.eye(4))])
    with pytest.raises(umbel.Error, match="shape"):
        umbel.save_asset(tmp_path / "a.umbel", lods, [(0, np.eye(3))])
    with pytest.raises(umbel.Error, match="textures"):
        umbel.save_asset(tmp_path / "a.umbel", lods, textures="some")
