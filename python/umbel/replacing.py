"""Writing files so that a half-written one is never seen.

Needs nothing but Python: umbel.bench.bvh.cuda runs from the sources where nothing is built.
"""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import IO

from umbel.errors import Error

Opener = Callable[[Path], AbstractContextManager[IO[bytes]]]


@contextlib.contextmanager
def replacing_together(flush: bool = True) -> Iterator[Opener]:
    """A function that opens binary files to write. They take their names when all of them are on
    disk, in the order in which they were opened; if one cannot be written, none does. Without
    `flush` the system writes them to the disk when it likes: for what is of no use after a crash of
    the machine."""
    temporaries: dict[str, str] = {}  # by the name to take

    @contextlib.contextmanager
    def opened(path: Path) -> Iterator[IO[bytes]]:
        try:
            target = behind_links(path)
            # Named before it is made, so that an interrupt at any moment leaves nothing.
            temporary = beside(target)
            temporaries[str(target)] = str(temporary)
            if path.is_dir():  # which no file can replace
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
            with temporary.open("xb") as file:
                yield file
                file.flush()
                if flush:
                    os.fsync(file.fileno())
        except OSError as error:
            raise _cannot_write(path, error) from None

    try:
        yield opened
        _rename(temporaries)
    except BaseException:
        for temporary in temporaries.values():
            with contextlib.suppress(OSError):
                os.unlink(temporary)
        raise


@contextlib.contextmanager
def replacing(path: Path, flush: bool = True) -> Iterator[IO[bytes]]:
    """A binary file to write that takes the name `path` only when all of it is on disk."""
    with replacing_together(flush) as opened, opened(path) as file:
        yield file


def beside(path: Path) -> Path:
    """A new name in the same folder. Names may have 255 bytes; of a long one this has the start."""
    name = os.fsdecode(os.fsencode(path.name)[:200])
    return path.parent / f".{name}.{secrets.token_hex(8)}.part"


def behind_links(path: Path) -> Path:
    """Where the bytes go: through a link, so that it stays one."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise Error(f"{path} is not a regular file")  # renaming onto a device would replace it
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def folder_to_make(path: Path) -> Path:
    """Where a new folder goes, through a link. It may be there if it is empty and another folder
    can take its place."""
    place = Path(os.path.realpath(path))
    if place.exists():
        if not place.is_dir() or any(place.iterdir()):
            raise Error(f"{path} is there already and is not an empty folder")
        if os.path.ismount(place) or place.samefile(os.curdir):
            raise Error(f"{path} is a mount point or the current folder: name a folder in it")
    if not place.parent.is_dir():
        raise Error(f"{path}: there is no folder {place.parent}")
    return place


def _rename(temporaries: dict[str, str]) -> None:
    """Gives files the names that are the keys."""
    try:
        # All in one call, so that no interrupt comes between two of them.
        list(map(os.replace, temporaries.values(), temporaries))
    except OSError as error:
        raise _cannot_write(error.filename2, error) from None


def _cannot_write(path: object, error: OSError) -> Error:
    return Error(f"cannot write {path}: {error.strerror or error}")


def write_all(path: Path, chunks: Iterable[bytes]) -> None:
    """Writes the chunks one after another; all or nothing."""
    with replacing(path) as file:
        for chunk in chunks:
            file.write(chunk)
