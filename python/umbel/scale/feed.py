"""What the library's builder calls instead of processes of its own: tasks go to an executor."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from umbel.scale.executor import CODES, Executor, Result, Task, library

if TYPE_CHECKING:
    from umbel.scale.staging import Staging

#: Times that a unit is tried whose machine, process or files were lost.
_TRIES = 5


class Feed:
    """Makes tasks of numbers, brings data where they are needed, and tries again what was lost.

    folder: where the build works on this machine.
    staging: brings data to an address and back; None where all machines have the folder.
    """

    def __init__(
        self, executor: Executor, folder: str, threads: int, staging: Staging | None = None
    ) -> None:
        self._executor = executor
        self._folder = folder
        self._threads = threads
        self._staging = staging
        self._tries: Counter[tuple[int, int]] = Counter()
        #: Of each unit that was built: what it took.
        self.measured: list[dict[str, float]] = []

    def slots(self) -> int:
        """Tasks that may be under way at once."""
        return max(1, self._executor.slots())

    def submit(self, tier: int, unit: int) -> None:
        """Has a unit built."""
        if self._staging is None:
            task = Task(self._folder, tier, unit, self._threads, library())
        else:
            inputs = self._staging.inputs(tier, unit)
            files = self._staging.files(tier)
            task = Task(self._staging.url, tier, unit, self._threads, library(), inputs, files)
        self._executor.submit(task)

    def wait(self, seconds: float) -> tuple[int, int, int, str] | None:
        """A unit that has ended: tier, unit, the error's kind, and a sentence or nothing."""
        fetched = None
        result = None
        if self._staging and self._staging.is_fetching():
            result = self._executor.wait(0)
            if result is None:
                result = fetched = self._staging.fetched(seconds)
        else:
            result = self._executor.wait(seconds)
        if result is None:
            return None
        task = result.task
        if result.error:
            self._tries[task.tier, task.unit] += 1
            if result.code == "io" and self._tries[task.tier, task.unit] < _TRIES:
                self._executor.submit(task)
                return None
        elif self._staging and not fetched:
            self._staging.fetch(result)
            return None
        return self._ended(result)

    def _ended(self, result: Result) -> tuple[int, int, int, str]:
        task = result.task
        if not result.error:
            self.measured.append({"tier": task.tier, "unit": task.unit, **result.measured})
        return task.tier, task.unit, CODES.index(result.code), result.error
