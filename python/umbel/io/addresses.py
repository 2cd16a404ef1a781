"""Mesh files at addresses that fsspec understands: https://, s3://, memory:// and the like. A file
is fetched with what it refers to, and read as one on this machine."""

from __future__ import annotations

import errno
import tempfile
import urllib.parse
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from umbel.errors import Error, LoadWarning
from umbel.io.references import leads_outside, references, sidecar_of

if TYPE_CHECKING:
    from umbel.io.scene import Scene
    from umbel.io.textures.images import TextureImage


def is_address(path: object) -> bool:
    """Whether a text is an address and no path."""
    return isinstance(path, str) and "://" in path


def name_of(address: str) -> str:
    """The name of the file at an address."""
    first = urllib.parse.urlsplit(address.partition("::")[0])
    name = first.path.rsplit("/", 1)[-1] or first.netloc
    return urllib.parse.unquote(name) if first.scheme in ("http", "https") else name


def web_options(address: str, silence: float = 60.0) -> dict[str, Any]:
    """Options of fsspec for the web servers of an address: reading fails when a server sends
    nothing for `silence` seconds, however long a whole answer takes."""
    used = {part.partition("://")[0] for part in address.split("::")} & {"http", "https"}
    if not used:
        return {}
    try:
        from aiohttp import ClientTimeout
        from fsspec.config import conf
    except ImportError:
        return {}  # fsspec says what is missing
    client = {"timeout": ClientTimeout(total=None, sock_connect=silence, sock_read=silence)}
    for protocol in ("http", "https"):
        client |= conf.get(protocol, {}).get("client_kwargs", {})
    return {protocol: {"client_kwargs": client} for protocol in used}


@contextmanager
def fetched(address: str) -> Iterator[Path]:
    """The file at an address, with all that it refers to below its folder, in a temporary one."""
    name = name_of(address)
    if not name or name in (".", ".."):
        raise Error(f"{address} names no file")
    with tempfile.TemporaryDirectory(prefix="umbel-") as folder:
        path = Path(folder) / name
        data = _bytes_at(address)
        try:
            path.write_bytes(data)
        except OSError as error:
            raise unwritten(path, error) from None
        _fetch_references(path, address)
        yield path


def load_fetched(path: Path, address: str) -> Scene:
    """The scene in a file that `fetched` gave. Messages name the address."""
    from umbel.io import load_scene

    folder, base = str(path.parent), _sibling(address, "")

    def named(text: object) -> str:
        return str(text).replace(str(path), address).replace(f"{folder}/", base)

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            scene = load_scene(path)
        except Error as error:
            raise Error(named(error)) from None
        for mesh in scene.meshes:
            mesh.source, mesh.fault = address, named(mesh.fault)
        for mesh in scene.meshes:
            mesh.source = address
        every = [scene.materials, *(mesh.materials for mesh in scene.meshes)]
        lost: dict[str, None] = {}
        for material in {id(one): one for materials in every for one in materials}.values():
            for slot, image in list(material.images.items()):
                kept = _kept(image, lost)
                if kept is None:
                    del material.images[slot]
                else:
                    material.images[slot] = kept
        if lost:
            sentence = f"{path}: left out: images that could not be fetched: {', '.join(lost)}"
            warnings.warn(sentence, LoadWarning, stacklevel=2)
    for warning in caught:
        warnings.warn(named(warning.message), warning.category, stacklevel=2)
    return scene


def _kept(image: TextureImage, lost: dict[str, None]) -> TextureImage | None:
    """The image with its bytes, as its file is about to go; else its fallback. `lost` gets the
    names of files that are not there."""
    fallback = None if image.fallback is None else _kept(image.fallback, lost)
    if image.path is None:
        return replace(image, fallback=fallback)
    named = {"name": image.path.stem, **image.gltf.get("image", {})}
    said = {**image.gltf, "image": named}
    try:
        data = image.path.read_bytes()
        return replace(image, data=data, path=None, gltf=said, fallback=fallback)
    except OSError:
        lost[repr(image.path.name)] = None
        return fallback


def _fetch_references(path: Path, address: str) -> None:
    """What cannot be fetched is missing afterwards: reading says whether that matters."""
    waiting = references(path.name, path.read_bytes())
    if not path.name.lower().endswith((".glb", ".gltf")):
        waiting.append(sidecar_of(path.name))
    seen: set[str] = set()
    while waiting:
        name = waiting.pop()
        if name in seen or not name or leads_outside(name):
            continue
        seen.add(name)
        target = path.parent / name
        try:
            data = _bytes_at(_sibling(address, name))
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(data)
        except OSError as error:
            if is_full(error):
                raise unwritten(target, error) from None
            continue
        except (Error, ValueError):
            continue
        waiting += references(name, data)


def is_full(error: Exception) -> bool:
    """Whether there is no room on this machine."""
    return isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT)


def unwritten(path: Path, error: Exception) -> Error:
    """Says which file of the folder for temporary files could not be written."""
    reason = getattr(error, "strerror", None) or error
    said = Error(f"cannot write {path}: {reason}; TMPDIR can name another folder")
    said.code = "io"
    return said


def _sibling(address: str, name: str) -> str:
    """The address of a file beside another."""
    first, mark, rest = address.partition("::")
    parts = urllib.parse.urlsplit(first)
    on_web = parts.scheme in ("http", "https")
    base = (first.partition("?")[0] if on_web else first).rpartition("/")[0]
    return f"{base}/{urllib.parse.quote(name) if on_web else name}{mark}{rest}"


def _bytes_at(address: str) -> bytes:
    try:
        import fsspec
    except ImportError:
        raise Error(f"{address}: addresses need fsspec: pip install 'umbel[remote]'") from None
    try:
        with fsspec.open(address, "rb", **web_options(address)) as file:
            return bytes(file.read())
    except Exception as error:  # every file system has its own
        raise Error(f"cannot open {address}: {reason_of(error)}") from None


def reason_of(error: Exception) -> str:
    """What is wrong at an address. That of a web server is in the cause: the error has only the
    address."""
    if not isinstance(error, FileNotFoundError):
        return str(error) or type(error).__name__
    cause = error.__cause__
    status = getattr(cause, "status", None)
    if status == 0:  # there is no last answer
        return "the server redirects too often"
    if status is not None:
        return f"the server answers {status} {getattr(cause, 'message', '')}".strip()
    return str(cause or "no such file")
