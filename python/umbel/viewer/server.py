"""Serves the viewer's page and one asset on this machine's loopback address, by HTTP ranges, with
the images beside it that it names."""

from __future__ import annotations

import gzip
import mimetypes
import os
import re
import threading
from functools import cache
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import quote, unquote, urlsplit

from umbel.errors import Error
from umbel.viewer.files import address_of, images_beside, served_name

PAGE = Path(__file__).parents[1] / "page"
_CHUNK = 1 << 18
_LOOPBACK = {"127.0.0.1", "localhost", "[::1]"}


def page_folder() -> Path:
    """Where the built page is, or an Error that says why it is not there."""
    if not (PAGE / "index.html").is_file():
        raise Error(
            "this installation has no viewer: its page is built when Umbel is installed where "
            "Node 20 or newer is"
        )
    return PAGE


@cache
def _page_file(path: Path) -> tuple[bytes, bytes]:
    """A file of the page, plain and compressed."""
    plain = path.read_bytes()
    return plain, gzip.compress(plain, 9, mtime=0)


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, asset: Path, port: int) -> None:
        self.asset = asset
        self.page = page_folder()
        self.images = images_beside(asset)
        super().__init__(("127.0.0.1", port), _Handler)


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: _Server

    def log_message(self, format: str, *args: object) -> None:
        """Logs nothing."""

    def do_GET(self) -> None:
        self._answer(with_body=True)

    def do_HEAD(self) -> None:
        self._answer(with_body=False)

    def _answer(self, with_body: bool) -> None:
        # A page elsewhere could make its own name mean this address, and so read what is here.
        host = (self.headers.get("Host") or "").rsplit(":", 1)[0]
        if host not in _LOOPBACK:
            self.send_error(HTTPStatus.FORBIDDEN)
            return
        try:
            path = unquote(urlsplit(self.path).path).lstrip("/")
            image = self.server.images.get(path.removeprefix("asset/"))
            if path == f"asset/{served_name(self.server.asset)}":
                self._send_file(self.server.asset, "application/octet-stream", with_body)
            elif image and path.startswith("asset/"):
                kind = mimetypes.guess_type(image.name)[0] or "application/octet-stream"
                self._send_file(image, kind, with_body)
            else:
                self._send_page(path or "index.html", with_body)
        except (BrokenPipeError, ConnectionResetError):
            self.close_connection = True

    def _send_page(self, path: str, with_body: bool) -> None:
        file = (self.server.page / path).resolve()
        if not file.is_relative_to(self.server.page.resolve()) or not file.is_file():
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        plain, packed = _page_file(file)
        accepts = "gzip" in self.headers.get("Accept-Encoding", "")
        body = packed if accepts else plain
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", mimetypes.guess_type(file.name)[0] or "text/plain")
        self.send_header("Content-Length", str(len(body)))
        if accepts:
            self.send_header("Content-Encoding", "gzip")
        self.send_header("Cache-Control", "no-cache")
        self.end_headers()
        if with_body:
            self.wfile.write(body)

    def _send_file(self, path: Path, kind: str, with_body: bool) -> None:
        try:
            file = path.open("rb")
        except OSError:
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        with file:
            size = os.fstat(file.fileno()).st_size
            try:
                first, behind, is_part = _parse_range(self.headers.get("Range"), size)
            except ValueError:
                self.send_response(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE)
                self.send_header("Content-Range", f"bytes */{size}")
                self.send_header("Content-Length", "0")
                self.end_headers()
                return
            self.send_response(HTTPStatus.PARTIAL_CONTENT if is_part else HTTPStatus.OK)
            self.send_header("Content-Type", kind)
            self.send_header("Accept-Ranges", "bytes")
            self.send_header("Content-Length", str(behind - first))
            self.send_header("Cache-Control", "no-cache")
            if is_part:
                self.send_header("Content-Range", f"bytes {first}-{behind - 1}/{size}")
            self.end_headers()
            if not with_body:
                return
            file.seek(first)
            while first < behind:
                chunk = file.read(min(_CHUNK, behind - first))
                if not chunk:
                    self.close_connection = True
                    return
                self.wfile.write(chunk)
                first += len(chunk)


def _parse_range(header: str | None, size: int) -> tuple[int, int, bool]:
    """First byte and the one behind the last, and whether that is a part of the file.

    Raises ValueError for a range that the file does not have. Several ranges at once, or a
    header of another form, mean the whole file, as HTTP allows."""
    match = re.fullmatch(r"bytes=(\d*)-(\d*)", header or "")
    if not match or match.group(0) == "bytes=-":
        return 0, size, False
    first, last = match.groups()
    if not first:
        count = min(int(last), size)
        if count == 0:
            raise ValueError("no such range")
        return size - count, size, True
    if int(first) >= size or (last and int(last) < int(first)):
        raise ValueError("no such range")
    return int(first), min(int(last) + 1, size) if last else size, True


class Server:
    """The viewer of one asset, served in a thread of its own until it is closed."""

    def __init__(self, asset: Path, port: int = 0) -> None:
        self._server = _Server(asset, port)
        self.url = (
            f"http://127.0.0.1:{self._server.server_address[1]}/?asset=asset/"
            f"{quote(address_of(asset))}"
        )
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def wait(self) -> None:
        """Until it is closed, or a signal comes."""
        while self._thread.is_alive():
            self._thread.join(0.5)

    def close(self) -> None:
        """Ends serving."""
        self._server.shutdown()
        self._server.server_close()
