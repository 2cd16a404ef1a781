"""Names for files that are written beside a mesh: buffers, material libraries, images."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from pathlib import Path


class SideNames:
    """Names of files beside `path`, which is about to be written: those that we wrote with the file
    there now, as `written_with` says, are replaced; others are not, unless they hold the same.
    `taken` are not given either.

    `ours` are those given that were not there, or were ours before."""

    def __init__(
        self, path: Path, written_with: Callable[[Path], set[str]], taken: Iterable[str] = ()
    ) -> None:
        self._path, self._written_with, self._taken = path, written_with, set(taken)
        self.ours: list[str] = []
        #: The first number that no name of a stem and suffix has.
        self._numbers: dict[tuple[str, str], int] = {}

    @cached_property
    def _replaced(self) -> set[str]:
        return self._written_with(self._path)

    def new(self, stem: str, suffix: str, chunks: Sequence[bytes]) -> str:
        """A name for a file of these bytes, with a number where `stem` is another's."""
        number = self._numbers.get((stem, suffix), 0)
        name = f"{stem}_{number}{suffix}" if number else f"{stem}{suffix}"
        while name in self._taken or not self._is_free(name, chunks):
            number += 1
            name = f"{stem}_{number}{suffix}"
        self._numbers[stem, suffix] = number + 1
        self._taken.add(name)
        if not os.path.lexists(self._path.with_name(name)) or name in self._replaced:
            self.ours.append(name)
        return name

    def _is_free(self, name: str, chunks: Sequence[bytes]) -> bool:
        path = self._path.with_name(name)
        return not os.path.lexists(path) or _holds(path, chunks) or name in self._replaced


def _holds(path: Path, chunks: Sequence[bytes]) -> bool:
    """Whether a file is of these bytes."""
    try:
        if path.stat().st_size != sum(map(len, chunks)):
            return False
        with path.open("rb") as file:
            return all(file.read(len(chunk)) == chunk for chunk in chunks)
    except OSError:
        return False
