"""What a mesh file refers to (buffers, material libraries, images), and a digest of it all."""

from __future__ import annotations

import contextlib
import gzip
import hashlib
import json
import os
import posixpath
import re
import struct
import urllib.parse
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from umbel.io.obj.mtl import map_names, words_of

_BLOCK = 1 << 20
_JSON_CHUNK = 0x4E4F534A
_CONTINUED = re.compile(rb"\\\s*\n\s*")
#: Of a URI that names no file. A drive's letter is none.
_SCHEME = re.compile(r"(?!file:)[a-z][a-z0-9+.-]+:", re.IGNORECASE)
_COMMENT = re.compile(rb"\s#.*")


def references(name: str, data: Any) -> list[str]:
    """The other files that a mesh file or a material library names, in its order, each once, as
    paths beside it. `name` is the file's own path; the others' are relative to the same folder.
    Damaged files name none; reading them says so."""
    folder, name = posixpath.dirname(name), name.lower().removesuffix(".gz")
    found: Iterable[str] = ()
    if bytes(data[:4]) == b"glTF":
        found = _of_gltf(_json_chunk(data))
    elif name.endswith((".gltf", ".glb")):  # one may have the other's name
        found = _of_gltf(bytes(data))
    elif name.endswith(".obj"):
        rests = list(_rests_of_lines(data, b"mtllib"))
        # One name with spaces, or several: readers look which of them are there.
        found = [one for rest in rests for one in dict.fromkeys([rest, *words_of(rest)])]
    elif name.endswith(".mtl"):
        found = map_names(bytes(data))
    plain = (one.replace("\\", "/") for one in found if "\0" not in one)
    return list(dict.fromkeys(posixpath.normpath(posixpath.join(folder, one)) for one in plain))


def sidecar_of(name: str) -> str:
    """The file beside a mesh that may say what its coordinates mean; no file names it."""
    plain = name[:-3] if name.lower().endswith(".gz") else name
    return posixpath.splitext(plain)[0] + ".prj"


def source_digest(path: Path, allow_outside: bool = False) -> str:
    """The SHA-256 of a mesh file in hexadecimal; if it refers to others, that of the digests of
    all. Files that are missing count as such, and those outside the folder unless
    `allow_outside`."""
    digests: dict[str, str] = {}
    sidecar = sidecar_of(path.name)
    waiting = [sidecar] if (path.parent / sidecar).is_file() else []
    waiting.append(path.name)
    while waiting:
        name = waiting.pop()
        if name in digests:
            continue
        if digests and not allow_outside and leads_outside(name):
            digests[name] = "outside"
            continue
        try:
            digests[name], named = _read(path.parent / name, name)
            waiting += named
        except (OSError, ValueError):
            if not digests:
                raise
            digests[name] = "missing"
    if len(digests) == 1:
        return digests[path.name]
    main = digests.pop(path.name)
    lines = [main, *(f"{digests[name]} {name}" for name in sorted(digests))]
    return hashlib.sha256("\n".join(lines).encode("utf-8", "surrogateescape")).hexdigest()


def named_files(path: Path) -> set[str]:
    """The files that a mesh file and its material libraries name; none where it is not there."""
    found: set[str] = set()
    waiting = [path.name]
    while waiting:
        name = waiting.pop()
        with contextlib.suppress(OSError, ValueError):
            named = set(_read(path.parent / name, name)[1]) - found
            found |= named
            libraries = (one for one in named if one.lower().endswith(".mtl"))
            waiting += [one for one in libraries if not leads_outside(one)]
    return found


def leads_outside(name: str) -> bool:
    """Whether a reference leaves the folder of the file that it is in."""
    relative = PurePosixPath(name.replace("\\", "/"))
    is_rooted = relative.is_absolute() or bool(PureWindowsPath(name).drive)
    return is_rooted or ".." in relative.parts


def _read(path: Path, name: str) -> tuple[str, list[str]]:
    """A file's SHA-256 and the files that it names. Meshes of any size take little memory."""
    digest = hashlib.sha256()
    named: list[str] = []
    kept = b""
    lower = name.lower()
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            digest.update(block)
            if lower.endswith(".obj"):
                lines, kept = _whole_lines(kept + _with_newlines(block))
                named += references(name, lines)
            elif kept[:4] == b"glTF" or block[:4] == b"glTF":
                kept += block if len(kept) < _json_end(kept or block) else b""
            elif not lower.endswith((".ply", ".stl")):
                kept += block
    named += references(name, _unpacked(name, kept))
    return digest.hexdigest(), list(dict.fromkeys(named))


def _with_newlines(text: bytes) -> bytes:
    return text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def _whole_lines(text: bytes) -> tuple[bytes, bytes]:
    """What ends with a line, and the rest. A line that does not end is no name."""
    end = text.rfind(b"\n") + 1
    return text[:end], text[end:] if len(text) - end < _BLOCK else b""


def _json_end(head: bytes) -> int:
    """Where the first chunk of a GLB ends."""
    return 20 + int(struct.unpack_from("<I", head, 12)[0]) if len(head) >= 20 else 0


def _unpacked(name: str, data: Any) -> Any:
    if not name.lower().endswith((".gltf.gz", ".glb.gz", ".obj.gz")):
        return data
    try:
        return gzip.decompress(data)
    except (OSError, EOFError, zlib.error):
        return b""


def _json_chunk(data: Any) -> bytes:
    if len(data) < 20:
        return b""
    length, kind = struct.unpack_from("<II", data, 12)
    return bytes(data[20 : 20 + length]) if kind == _JSON_CHUNK else b""


def _of_gltf(text: bytes) -> Iterator[str]:
    if b'"uri"' not in text:
        return
    try:
        root = json.loads(text.rstrip(b"\0"))  # with which some writers pad a chunk
        entries = [*root.get("buffers", []), *root.get("images", [])]
        uris = [entry.get("uri") for entry in entries]
    except (AttributeError, RecursionError, TypeError, ValueError):
        return
    for uri in uris:
        if isinstance(uri, str) and not _SCHEME.match(uri):
            yield urllib.parse.unquote(uri.removeprefix("file://"), errors="surrogateescape")


def _rests_of_lines(data: Any, word: bytes) -> Iterable[str]:
    """What follows the word, in any case, in every line that begins with it."""
    data = _with_newlines(bytes(data))
    for spelling in (word, word.upper(), word.capitalize()):
        at = data.find(spelling)
        while at >= 0:
            begin = data.rfind(b"\n", max(0, at - 64), at) + 1
            line = data[max(begin, at - 64) : _line_end(data, at)].strip()
            at = data.find(spelling, at + len(spelling))
            words = _COMMENT.sub(b"", _CONTINUED.sub(b" ", line)).split(None, 1)
            if line.startswith(spelling) and len(words) > 1:
                yield os.fsdecode(words[1].rstrip())


def _line_end(data: bytes, at: int) -> int:
    """Where the line that `at` is in ends, with those that backslashes take to it."""
    while (end := data.find(b"\n", at)) >= 0:
        if not data[at:end].rstrip().endswith(b"\\"):
            return end
        at = end + 1
    return len(data)
