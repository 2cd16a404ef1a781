"""Files at addresses: what fsspec knows, such as s3://, gcs://, az:// and sftp://; http:// can only
be read."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from umbel.errors import Error
from umbel.io.addresses import is_full, name_of, reason_of, unwritten, web_options
from umbel.io.patterns import matches


def is_address(name: Any) -> bool:
    """Whether a name is an address rather than a path."""
    return isinstance(name, str) and "://" in name and not name.startswith("file://")


def as_path(name: str | os.PathLike[str]) -> str:
    """A path, also of file://."""
    return os.fspath(name).removeprefix("file://")


class Folder:
    """A folder at an address."""

    def __init__(self, url: str) -> None:
        self.url = url.rstrip("/")
        self._system, self._root = _open(self.url)

    def _at(self, name: str) -> str:
        return f"{self._root}/{name}"

    def files(self) -> dict[str, int]:
        """Names of all files in it and below, and their bytes. What others wrote since is seen."""
        self._system.invalidate_cache()
        found = self._system.find(self._root, detail=True)
        begin = len(self._root.rstrip("/")) + 1
        return {
            path[begin:]: int(about["size"] or 0)
            for path, about in found.items()
            if about.get("type") == "file" and len(path) > begin
        }

    def put(self, path: Path, name: str) -> None:
        """A file of this machine to a name."""
        self._system.put_file(str(path), self._at(name))

    def get(self, name: str, path: Path) -> None:
        """A file to this machine; it has its name there once it is whole."""
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_name(f".{path.name}.{os.getpid()}.tmp")
        try:
            self._system.get_file(self._at(name), str(part))
            part.replace(path)
        except OSError as error:
            if is_full(error):
                raise unwritten(path, error) from None
            raise
        finally:
            part.unlink(missing_ok=True)

    def read(self, name: str) -> bytes | None:
        """A small file as it is now; None where there is none."""
        try:
            self._system.invalidate_cache()
            data: bytes = self._system.cat_file(self._at(name))
        except FileNotFoundError:
            return None
        return data

    def write(self, name: str, data: bytes, only_new: bool = False) -> None:
        """A small file. only_new: raises FileExistsError if there is one, where the file system
        knows how to make sure; others write."""
        mode = {"mode": "create"} if only_new else {}
        self._system.pipe_file(self._at(name), data, **mode)

    def stretches(self, wanted: Sequence[tuple[str, int, int]]) -> list[bytes]:
        """Bytes from the first to one past the last, of files by name."""
        if not wanted:
            return []
        found: list[bytes] = self._system.cat_ranges(
            [self._at(name) for name, _, _ in wanted],
            [begin for _, begin, _ in wanted],
            [end for _, _, end in wanted],
            on_error="raise",
        )
        for (name, begin, end), data in zip(wanted, found, strict=True):
            if len(data) != end - begin:
                raise Error(f"{self.url}/{name} is shorter than {end} bytes")
        return found

    def remove(self, names: Sequence[str]) -> None:
        """Removes files by name."""
        if names:
            self._system.rm([self._at(name) for name in names])


def _open(url: str) -> tuple[Any, str]:
    try:
        import fsspec.core
    except ImportError:
        raise Error(f"{url}: addresses need fsspec: pip install 'umbel[remote]'") from None
    try:
        system, path = fsspec.core.url_to_fs(url, **web_options(url))
    except ImportError as error:
        said = str(error).strip() or "a package is missing"
        raise Error(f"{url}: {said} (pip install)") from None
    except Exception as error:  # every file system has its own
        raise Error(f"cannot use {url}: {error}") from None
    return system, str(path).rstrip("/")


def check_writable(url: str) -> None:
    """Throws before anything is built where nothing could be stored: it stores a file beside, and
    removes it."""
    if url.startswith(("http://", "https://")):
        raise Error(
            f"{url}: sources can be read by HTTP, but nothing can be written; name a folder, or an "
            "address such as s3://bucket/name"
        )
    system, path = _open(url)
    probe = f"{path}.umbel-check"
    try:
        system.pipe_file(probe, b"")
    except Exception as error:  # every file system has its own
        raise Error(f"cannot write {url}: {reason_of(error)}") from None
    with contextlib.suppress(Exception):  # who may write need not be allowed to remove
        system.rm_file(probe)


def make_folder(path: Path, mode: int = 0o777) -> None:
    """A folder of this machine, with those above it; it may be there."""
    try:
        path.mkdir(mode, parents=True, exist_ok=True)
    except OSError as error:
        raise _stopped(f"cannot make the folder {path}", error) from None


def write_file(path: Path, data: bytes) -> None:
    """A small file of a work folder on this machine."""
    make_folder(path.parent)
    try:
        path.write_bytes(data)
    except OSError as error:
        raise _stopped(f"cannot write {path}", error) from None


def _stopped(what: str, error: OSError) -> Error:
    said = Error(f"{what}: {error.strerror or error}")
    said.code = "io"
    return said


def scratch(url: str) -> Path:
    """The folder of this machine that stands for an address, the same at every start. Made if it is
    not there."""
    name = hashlib.blake2b(url.rstrip("/").encode(), digest_size=8).hexdigest()
    path = Path(tempfile.gettempdir()) / f"umbel-{name}"
    make_folder(path, 0o700)
    # Anybody can guess the name, and temporary files may be in a folder that all can write to.
    if path.is_symlink() or (hasattr(os, "getuid") and path.stat().st_uid != os.getuid()):
        raise Error(f"{path} is somebody else's: set TMPDIR to a folder of your own")
    return path


def expand(names: Sequence[str | os.PathLike[str]]) -> list[str]:
    """Patterns as the files that they name, in the order of their names."""
    found: list[str] = []
    for given in names:
        name = as_path(given)
        if not any(c in name for c in "*?[") or os.path.exists(name):
            found.append(name)
            continue
        if is_address(name):
            system, path = _open(name)
            named = sorted(system.unstrip_protocol(match) for match in system.glob(path))
        else:
            named = matches(name)
        if not named:
            raise Error(f"no file matches {name}")
        found += named
    return found


def fetch_sources(names: Sequence[str], folder: Path) -> list[Path]:
    """Source files on this machine; those at addresses are fetched, unless they are there."""
    paths: list[Path] = []
    for number, name in enumerate(names):
        if not is_address(name):
            paths.append(Path(name))
            continue
        if name.lower().endswith(".gltf"):
            raise Error(f"{name}: a .gltf refers to other files; give a .glb")
        system, at = _open(name)
        path = folder / f"{number:06d}" / name_of(name)
        try:
            which = _version_of(name, system.info(at))
            tag = path.with_name(".tag")
            is_there = path.exists() and tag.exists() and tag.read_text() == which
            if not (is_there and which):
                path.parent.mkdir(parents=True, exist_ok=True)
                tag.unlink(missing_ok=True)
                system.get_file(at, str(path))
                tag.write_text(which)
        except Exception as error:
            if is_full(error):
                raise unwritten(path, error) from None
            raise Error(f"cannot read {name}: {reason_of(error)}") from None
        paths.append(path)
    return paths


#: By which file systems tell one version of a file from another, in letters alone.
_VERSIONS = {"etag", "lastmodified", "mtime", "modified", "updated", "created", "generation"}
_VERSIONS |= {"contentmd", "mdhash", "versionid"}


def _version_of(name: str, about: dict[str, Any]) -> str:
    """Of a file at an address; empty where its file system does not tell versions apart."""
    letters = {"".join(filter(str.isalpha, key)).lower(): key for key in about}
    told = {key: str(about[key]) for word, key in sorted(letters.items()) if word in _VERSIONS}
    return json.dumps([name, about.get("size"), told]) if told else ""


def fetch_file(name: str, path: Path) -> None:
    """The file at an address."""
    system, at = _open(name)
    system.get_file(at, str(path))


def sha256_of(path: Path) -> str:
    """Of a file of any size."""
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        while block := file.read(1 << 22):
            digest.update(block)
    return digest.hexdigest()


def put_file(path: Path, url: str) -> None:
    """A file of this machine to an address."""
    system, at = _open(url)
    try:
        system.put_file(str(path), at)
    except Exception as error:
        raise Error(f"cannot write {url}: {error}") from None
