"""Whether source files stay as they are while they are read, several times."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from umbel.errors import Error
from umbel.geometry.repair import Progress

#: Stages in which the source is read; units are built of what these leave.
_READING = ("reading", "dividing", "sorting")


class WatchedFiles:
    """Progress of a build in units. Once the source has been read, it throws if a file of it has
    changed since `watch`, by its size or time."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress = progress
        self._stamps: dict[Path, tuple[int, int] | None] = {}

    def watch(self, files: Iterable[Path]) -> None:
        """Adds files, as they are now."""
        for file in files:
            self._stamps.setdefault(file, _stamp(file))

    def __call__(self, fraction: float, stage: str) -> bool | np.bool_ | None:
        if self._stamps and stage not in _READING:
            changed = [file for file, stamp in self._stamps.items() if _stamp(file) != stamp]
            if changed:
                raise Error(f"{changed[0]} has changed while it was read; build it again")
            self._stamps = {}
        return None if self._progress is None else self._progress(fraction, stage)


def _stamp(file: Path) -> tuple[int, int] | None:
    """None where it is gone: reading what is needed of it says so."""
    try:
        status = file.stat()
    except OSError:
        return None
    return status.st_size, status.st_mtime_ns
