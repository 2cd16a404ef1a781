"""A progress bar on standard error, on a terminal."""

from __future__ import annotations

import contextlib
import sys
import time
from types import TracebackType
from typing import Any

from umbel.cli.run import say

PATIENCE = 0.7  # seconds without a bar; what is done by then needs none


class Bar:
    """Shows what a long call reports to it: `with Bar() as bar: work(progress=bar)`."""

    def __init__(self, time_left: bool = False) -> None:
        self._time_left = time_left
        self._started = time.monotonic()
        self._wanted = sys.stderr.isatty()
        self._rich: Any = None
        self._task: Any = None

    def __enter__(self) -> Bar:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._rich is not None:
            with contextlib.suppress(OSError):  # the terminal may be gone
                self._rich.stop()

    def __call__(self, fraction: float, stage: str) -> None:
        if not self._wanted or time.monotonic() - self._started < PATIENCE:
            return
        if self._rich is None:
            self._open()
        self._rich.update(self._task, completed=fraction, description=stage)

    def say(self, sentence: str) -> None:
        """One line on standard error, above the bar."""
        if self._rich is None:
            say(sentence)
        else:
            with contextlib.suppress(OSError):
                self._rich.console.print(
                    f"umbel: {sentence}", markup=False, highlight=False, soft_wrap=True
                )

    def _open(self) -> None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            Progress,
            TextColumn,
            TimeElapsedColumn,
            TimeRemainingColumn,
        )

        self._rich = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.percentage:>3.0f}%"),
            TimeElapsedColumn(),
            *([TextColumn("left:"), TimeRemainingColumn()] if self._time_left else []),
            console=Console(stderr=True),
            transient=True,
        )
        self._task = self._rich.add_task("", total=1.0)
        self._rich.start()
