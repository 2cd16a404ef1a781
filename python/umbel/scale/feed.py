"""What the library's builder calls instead of processes of its own: tasks go to an executor."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from umbel.scale.executor import CODES, KINDS, Executor, Result, Task, library

if TYPE_CHECKING:
    from umbel.scale.staging import Staging

#: Times that a task is tried whose machine, process or files were lost.
_TRIES = 5


class Feed:
    """Makes tasks of numbers, brings data where they are needed, and tries again what was lost.

    folder: where the build works on this machine.
    staging: brings data to an address and back; None where all machines have the folder.
    sorts_source: others can read the source, and sort it.
    """

    def __init__(
        self,
        executor: Executor,
        folder: str,
        threads: int,
        staging: Staging | None = None,
        sorts_source: bool = False,
    ) -> None:
        self._executor = executor
        self._folder = folder
        self._threads = threads
        self._staging = staging
        self.sorts_source = sorts_source
        self.is_stand_in = staging is not None
        self._tries: Counter[tuple[str, int, int]] = Counter()
        #: Of each task that was done: what it took.
        self.measured: list[dict[str, float | str]] = []

    def slots(self) -> int:
        """Tasks that may be under way at once."""
        return max(1, self._executor.slots())

    def submit(self, kind: int, tier: int, unit: int, plan: int) -> None:
        """Has a task done."""
        place = self._staging.url if self._staging else self._folder
        task = Task(place, tier, unit, self._threads, library(), kind=KINDS[kind], plan=plan)
        if self._staging:
            task = self._staging.prepared(task)
        self._executor.submit(task)

    def wait(self, seconds: float) -> tuple[int, int, int, str] | None:
        """A task that has ended: tier, unit, the error's kind, and a sentence or nothing."""
        fetched = None
        result = None
        if self._staging:
            self._staging.check()
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
            name = (task.kind, task.tier, task.unit)
            self._tries[name] += 1
            if result.code == "io" and self._tries[name] < _TRIES:
                self._executor.submit(task)
                return None
        elif self._staging and not fetched:
            self._staging.fetch(result)
            return None
        return self._ended(result)

    def _ended(self, result: Result) -> tuple[int, int, int, str]:
        task = result.task
        if not result.error:
            done: dict[str, float | str] = {"kind": task.kind, "tier": task.tier}
            self.measured.append({**done, "unit": task.unit, **result.measured})
        return task.tier, task.unit, CODES.index(result.code), result.error

    @property
    def units(self) -> list[dict[str, float | str]]:
        """Of each unit that was built: what it took."""
        return [done for done in self.measured if done["kind"] == "build"]
