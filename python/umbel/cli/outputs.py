"""Checks of outputs, made before any work."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from umbel.cli.run import fail, is_asset


def check_output(path: Path, *suffixes: str, inputs: Sequence[str | Path] = ()) -> None:
    """Refuses a file that could not be written, or that would replace one of the inputs."""
    if path.suffix.lower() not in suffixes:
        fail(f"{path}: the output must end in {' or '.join(suffixes)}")
    if path.is_dir():
        fail(f"{path} is a folder; name a file in it")
    if path.exists() and not path.is_file():
        fail(f"{path} is no ordinary file")
    for source in inputs:
        if _is_same(path, source):
            fail(f"{path} is the input; the output must be another file")
    # A link stays one: what it leads to is written.
    where = Path(os.path.realpath(path)) if path.is_symlink() else path.absolute()
    check_folder(where.parent, f"{path}: ")


def check_references(outputs: Sequence[Path], source: str) -> None:
    """Refuses outputs that would replace a file that the input refers to."""
    from umbel.io.addresses import is_address
    from umbel.io.references import named_files

    there = [path for path in outputs if path.exists()]
    if not there or is_address(source):  # the input need not be read for this
        return
    if is_asset(source):
        from umbel.viewer.files import images_beside

        used = list(images_beside(Path(source)).values())
    else:
        folder = Path(source).parent
        used = [folder / name for name in named_files(Path(source))]
    for path in there:
        if any(_is_same(path, one) for one in used):
            fail(f"{path} is a file that {source} refers to; the output must be another file")


def check_folder(folder: Path, what: str = "") -> None:
    """Refuses a folder in which no file can be made."""
    if not folder.exists():
        fail(f"{what}there is no folder {folder}; make it first")
    if not folder.is_dir():
        fail(f"{what}{folder} is a file, not a folder")
    try:
        # Rights say little for root, on read-only disks and in special folders; a file says all.
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        fail(f"{what}cannot write in {folder}: {error.strerror or error}")


def made_folder(path: Path) -> Path:
    """The folder, which is made if need be, with those above it."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        if path.exists():
            fail(f"{path} is a file, not a folder")
        fail(f"{path}: this folder cannot be made: {error.strerror or error}")
    check_folder(path)
    return path


def check_space(path: Path, least: int) -> None:
    """Refuses a disk without `least` bytes, which the file will have in any case."""
    free = shutil.disk_usage(path.absolute().parent).free
    if free < least:
        fail(
            f"{path}: no space left on the disk: {free:,} bytes are free, and the file takes "
            f"at least {least:,}"
        )


def _is_same(path: Path, source: str | Path) -> bool:
    try:
        return os.path.samefile(path, source)
    except (OSError, ValueError):
        return False
