"""`umbel view`: what is served, to whom, and what is exported."""

from __future__ import annotations

import errno
import gzip
import http.client
import json
import os
import re
import shlex
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import parse_qs, unquote, urljoin, urlsplit

import pytest

import umbel
from helpers.commands import COMMAND, Umbel
from umbel.viewer.server import PAGE
from umbel.viewer.view import serving_command

pytestmark = pytest.mark.skipif(
    not (PAGE / "index.html").is_file(), reason="the viewer's page is built only where Node is"
)


@pytest.fixture(scope="module")
def asset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("view") / "a blob.umbel"
    umbel.build_lod(umbel.shapes.blob(4, seed=1)).save(path)
    return path


@pytest.fixture(scope="module")
def shown(asset: Path) -> Iterator[umbel.View]:
    view = umbel.view(asset)
    yield view
    view.close()


def get(
    view: umbel.View, path: str, method: str = "GET", **headers: str
) -> tuple[int, dict, bytes]:
    """Status, headers and body of an answer."""
    connection = http.client.HTTPConnection(urlsplit(view.url).netloc, timeout=60)
    connection.request(method, path, headers=headers)
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, dict(answer.getheaders()), body


def asset_path(view: umbel.View) -> str:
    return "/" + urlsplit(view.url).query.removeprefix("asset=")


def test_the_page_is_served_plain_and_compressed(shown: umbel.View) -> None:
    status, headers, plain = get(shown, "/")
    assert status == 200
    assert headers["Content-Type"] == "text/html"
    assert b"<title>Umbel</title>" in plain
    packed = get(shown, "/index.html", **{"Accept-Encoding": "gzip"})
    assert packed[1]["Content-Encoding"] == "gzip"
    assert gzip.decompress(packed[2]) == plain


@pytest.mark.parametrize(
    ("range_", "part"),
    [
        ("bytes=0-99", slice(0, 100)),
        ("bytes=100-", slice(100, None)),
        ("bytes=-64", slice(-64, None)),
        ("bytes=50-999999999", slice(50, None)),
    ],
)
def test_ranges_of_the_asset_are_served(
    shown: umbel.View, asset: Path, range_: str, part: slice
) -> None:
    whole = asset.read_bytes()
    status, headers, body = get(shown, asset_path(shown), Range=range_)
    assert status == 206
    assert body == whole[part]
    assert headers["Content-Range"].endswith(f"/{len(whole)}")


@pytest.mark.parametrize("range_", ["", "bytes=0-1,5-9", "lines=0-5", "bytes=-"])
def test_without_a_range_the_whole_asset_is_served(
    shown: umbel.View, asset: Path, range_: str
) -> None:
    status, headers, body = get(shown, asset_path(shown), Range=range_)
    assert status == 200
    assert body == asset.read_bytes()
    assert headers["Accept-Ranges"] == "bytes"


@pytest.mark.parametrize("range_", ["bytes=999999999-", "bytes=9-3", "bytes=-0"])
def test_ranges_that_are_not_there_are_refused(shown: umbel.View, range_: str) -> None:
    status, headers, _ = get(shown, asset_path(shown), Range=range_)
    assert status == 416
    assert headers["Content-Range"].startswith("bytes */")


def test_a_head_request_has_no_body(shown: umbel.View, asset: Path) -> None:
    status, headers, body = get(shown, asset_path(shown), "HEAD")
    assert (status, body) == (200, b"")
    assert int(headers["Content-Length"]) == asset.stat().st_size


@pytest.mark.parametrize(
    "path",
    ["/nothing.js", "/../viewer.py", "/%2e%2e/viewer.py", "/asset/other.umbel", "//etc/passwd"],
)
def test_nothing_else_is_served(shown: umbel.View, path: str) -> None:
    assert get(shown, path)[0] == 404


class NamingImages:
    """Stands in for an asset: names images inside and outside its folder."""

    materials = json.dumps(
        {
            "images": [
                {"uri": "pictures/a%20b.png"},
                {"uri": "c.jpg"},
                {"uri": "secret.txt"},
                {"uri": "../above.png"},
                {"uri": "index.html"},
                {"uri": "gone.png"},
                {"uri": 3},
                {"file": 0},
            ]
        }
    )

    def __init__(self, path: Path) -> None:
        self._native = self


@pytest.fixture
def external(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An asset with two images beside it, which names three other files too."""
    folder = tmp_path / "here"
    (folder / "pictures").mkdir(parents=True)
    (folder / "pictures" / "a b.png").write_bytes(b"png")
    (folder / "c.jpg").write_bytes(b"jpg")
    for path in (folder / "secret.txt", folder / "index.html", tmp_path / "above.png"):
        path.write_text("secret")
    umbel.build_lod(umbel.shapes.blob(2, seed=1)).save(folder / "asset.umbel")
    monkeypatch.setattr("umbel.viewer.files.Asset", NamingImages)
    return folder / "asset.umbel"


def test_images_beside_the_asset_are_served_and_no_other_file(external: Path) -> None:
    view = umbel.view(external)
    assert get(view, "/asset/pictures/a%20b.png")[2] == b"png"
    status, headers, body = get(view, "/asset/c.jpg", Range="bytes=1-")
    assert (status, body, headers["Content-Type"]) == (206, b"pg", "image/jpeg")
    for name in ("secret.txt", "../above.png", "%2e%2e/above.png", "index.html", "gone.png"):
        assert get(view, f"/asset/{name}")[0] == 404
    assert get(view, "/c.jpg")[0] == 404
    view.close()


def test_images_beside_the_asset_are_exported(external: Path, tmp_path: Path) -> None:
    folder = umbel.export_viewer(external, tmp_path / "site").parent
    assert (folder / "pictures" / "a b.png").read_bytes() == b"png"
    assert (folder / "c.jpg").read_bytes() == b"jpg"
    assert not (folder / "secret.txt").exists()
    assert "<title>Umbel</title>" in (folder / "index.html").read_text()


def test_other_names_for_this_machine_are_refused(shown: umbel.View) -> None:
    assert get(shown, "/", Host="evil.example")[0] == 403


def test_a_notebook_shows_it_inline(shown: umbel.View) -> None:
    html = shown._repr_html_()
    assert html.startswith("<iframe ")
    assert 'allow="clipboard-write"' in html  # for links
    assert shown.url.replace("&", "&amp;") in html


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_command_serves_until_it_is_interrupted(asset: Path, number: signal.Signals) -> None:
    with subprocess.Popen(
        [*COMMAND, "view", str(asset), "--no-browser", "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            assert process.stdout is not None
            url = json.loads(process.stdout.readline())["url"]
            connection = http.client.HTTPConnection(urlsplit(url).netloc, timeout=60)
            connection.request("GET", "/")
            assert connection.getresponse().status == 200
            connection.close()
        finally:
            process.send_signal(number)
        assert process.communicate(timeout=60) == ("", "")
        assert process.returncode == 128 + number


def test_a_port_that_is_in_use_is_named(umbel_command: Umbel, asset: Path) -> None:
    with socket.socket() as used:
        used.bind(("127.0.0.1", 0))
        used.listen()
        port = used.getsockname()[1]
        done = umbel_command("view", asset, "--port", port, "--no-browser")
    assert done.status == 1
    assert done.err == f"umbel: {asset}: port {port} cannot be used: Address already in use\n"


def test_export_writes_a_folder_that_names_its_asset(asset: Path, tmp_path: Path) -> None:
    index = umbel.export_viewer(asset, tmp_path / "site")
    assert 'data-asset="a blob.umbel"' in index.read_text(encoding="utf-8")
    assert (index.parent / asset.name).read_bytes() == asset.read_bytes()
    assert list((index.parent / "assets").glob("*.js"))
    with pytest.raises(umbel.Error, match="not an empty folder"):
        umbel.export_viewer(asset, tmp_path / "site")


def test_a_folder_that_looks_like_a_flag_can_be_served() -> None:
    *_, folder = shlex.split(serving_command(Path("-site")))
    assert Path(folder) == Path("-site") and not folder.startswith("-")


def test_export_names_flags_of_serving(umbel_command: Umbel, asset: Path, tmp_path: Path) -> None:
    flags = ("--export", tmp_path / "site", "--port", 8000, "--no-browser", "--json")
    assert umbel_command("view", asset, *flags).json["warnings"] == [
        f"{flag} has no effect: with --export nothing is served"
        for flag in ("--port", "--no-browser")
    ]


@pytest.mark.parametrize("command", [["view", "--export"], ["export", "--format", "viewer", "-o"]])
def test_commands_say_how_an_exported_folder_is_served(
    umbel_command: Umbel, asset: Path, tmp_path: Path, command: list[str]
) -> None:
    site = tmp_path / "my site"
    said = umbel_command(command[0], asset, *command[1:], site, "--json").json
    assert said["index"] == str(site / "index.html") and "url" not in said
    assert said["warnings"] == []
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    program, *arguments = shlex.split(said["serve"])
    assert program == "python3"
    with subprocess.Popen(
        [sys.executable, "-u", *arguments, str(port)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    ) as process:
        try:
            assert process.stdout is not None
            process.stdout.read(1)  # it says that it serves
            connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
            connection.request("GET", "/")
            assert connection.getresponse().read() == (site / "index.html").read_bytes()
            connection.close()
        finally:
            process.kill()


def test_a_disk_that_is_full_leaves_no_folder(
    asset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = 3

    def full(_: int) -> None:
        nonlocal left
        left -= 1
        if left < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(umbel.Error) as caught:
        umbel.export_viewer(asset, tmp_path / "site")
    assert str(caught.value) == f"cannot write {tmp_path / 'site'}: No space left on device"
    assert not list(tmp_path.iterdir())


def _in_browsers(address: str) -> str:
    """The path of a relative address as browsers read it, which is not as urllib does."""
    assert not re.match("[a-z][a-z0-9+.-]*:", address, re.IGNORECASE), "it has a scheme"
    return urlsplit(re.sub("[\t\n\r]", "", address.strip(" ")).replace("\\", "/")).path


@pytest.mark.parametrize(
    "name", ["a #1", "100%", "why?", "a%20b", "scan-12:30", "a\\b", "a\tb\n", "  a b"]
)
def test_names_with_signs_of_addresses(asset: Path, tmp_path: Path, name: str) -> None:
    odd = tmp_path / f"{name}.umbel"
    odd.write_bytes(asset.read_bytes())
    index = umbel.export_viewer(odd, tmp_path / "site")
    found = re.search('data-asset="([^"]*)"', index.read_text(encoding="utf-8"))
    assert found and unquote(_in_browsers(found[1])) == odd.name
    shown = umbel.view(odd)
    try:
        [address] = parse_qs(urlsplit(shown.url).query)["asset"]
        parts = urlsplit(urljoin(shown.url, _in_browsers(address).replace(" ", "%20")))
        connection = http.client.HTTPConnection(parts.netloc, timeout=60)
        connection.request("GET", parts.path)
        assert connection.getresponse().read() == asset.read_bytes()
        connection.close()
    finally:
        shown.close()


def test_what_cannot_be_shown_is_refused_in_a_sentence(
    umbel_command: Umbel, tmp_path: Path
) -> None:
    (tmp_path / "a.ply").write_text("ply", encoding="utf-8")
    (tmp_path / "b.umbel").write_text("no asset", encoding="utf-8")
    for name in ("a.ply", "b.umbel", "c.umbel"):
        done = umbel_command("view", tmp_path / name, "--no-browser")
        assert done.status == 1
        assert done.err.count("\n") == 1
