"""Files that patterns such as models/**/*.glb stand for."""

from __future__ import annotations

import contextlib
import glob
import os
import warnings
from collections.abc import Iterator
from pathlib import Path

from umbel.errors import LoadWarning


def matches(pattern: str) -> list[str]:
    """Files and folders of a pattern by name, as glob.glob finds them, also where links lead to a
    folder above them. Folders that cannot be read are warned of."""
    return sorted(set(_matches(pattern)))


def _matches(pattern: str) -> Iterator[str]:
    parts = pattern.split(os.sep)
    if "**" not in parts:
        yield from glob.iglob(pattern)
        return
    at = parts.index("**")
    rest = parts[at + 1 :] or ["*"]
    base = "".join(part + os.sep for part in parts[:at])
    for top in glob.iglob(base) if base else [""]:
        for folder in _folders(top, _above(top)):
            yield from _matches(os.path.join(glob.escape(folder), *rest))


def _folders(folder: str, above: frozenset[tuple[int, int]]) -> Iterator[str]:
    """A folder and those below it but hidden ones, each with a separator at its end."""
    path = folder or os.curdir
    try:
        status = os.stat(path)
        with os.scandir(path) as entries:
            below = [entry.name for entry in entries if _is_folder(entry)]
    except OSError as error:
        sentence = f"{path}: left out: this folder cannot be read: {error.strerror or error}"
        warnings.warn(sentence, LoadWarning, stacklevel=2)
        return
    identity = (status.st_dev, status.st_ino)
    if identity in above:
        return
    yield folder
    for name in below:
        yield from _folders(f"{folder}{name}{os.sep}", above | {identity})


def _above(folder: str) -> frozenset[tuple[int, int]]:
    """The folders that a folder is in."""
    found = set()
    for parent in Path(os.path.realpath(folder)).parents:
        with contextlib.suppress(OSError):
            status = os.stat(parent)
            found.add((status.st_dev, status.st_ino))
    return frozenset(found)


def _is_folder(entry: os.DirEntry[str]) -> bool:
    if entry.name.startswith("."):
        return False
    return entry.is_dir(follow_symlinks=False) or (entry.is_symlink() and os.path.isdir(entry))
