"""Who builds the units: the interface between a build and whatever runs its tasks.

A task is a name: what to do, a work folder, a tier and a unit. Data never go through an executor;
they are in the work folder, which is a path that all machines have, or an address
(`umbel.scale.staging`).
"""

from __future__ import annotations

import functools
import hashlib
import json
import tempfile
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from umbel import _umbel
from umbel.errors import Error
from umbel.io.addresses import is_full
from umbel.io.blocks.layout import again

#: In a work folder: how to open the source.
SOURCE = "t0/source.json"
#: As the library numbers kinds of errors.
CODES = ("invalid_argument", "invalid_mesh", "io", "corrupt", "unsupported", "cancelled", "device")


#: What tasks do, as the library numbers it: build a unit; bring to the units of a tier what a unit
#: of the tier before left, or one stretch of the source has; encode the groups of a unit.
KINDS = ("build", "sort", "encode")


@dataclass(frozen=True)
class Input:
    """A sorted file, and the stretches of it that a unit needs."""

    shard: int
    bytes: int  #: of the whole file
    stretches: tuple[tuple[int, int], ...]  #: from the first byte to one past the last


@dataclass(frozen=True)
class Task:
    """One thing to do; mostly one unit to build."""

    work: str  #: a folder that all machines have, or an address
    tier: int
    unit: int
    threads: int
    library: str  #: the build of the library that must do it
    #: What to fetch where `work` is an address.
    inputs: tuple[Input, ...] | None = None
    files: tuple[str, ...] = ()  #: and of files that some units need, all
    kind: str = "build"
    plan: int = 0  #: of encoding: which

    @property
    def name(self) -> str:
        """For sentences."""
        if self.kind == "sort":
            return f"sorting file {self.unit} of tier {self.tier}"
        unit = f"unit {self.unit} of tier {self.tier}"
        return f"encoding {unit}" if self.kind == "encode" else unit


@dataclass(frozen=True)
class Result:
    """A task that has ended."""

    task: Task
    error: str = ""  #: a sentence; empty where it is done
    code: str = "unsupported"
    #: Seconds and bytes of fetching, building and storing.
    measured: dict[str, float] = field(default_factory=dict)


class Executor(ABC):
    """Runs tasks, on this machine or others, in any order."""

    def connect(self) -> None:  # noqa: B027
        """Called before any work: raises `Error` where nobody would do the tasks."""

    def start(self, unit_bytes: int, threads: int) -> None:  # noqa: B027
        """Called before the first task: the memory that a unit takes, and its threads."""

    @abstractmethod
    def slots(self) -> int:
        """Tasks that may be under way at once."""

    @abstractmethod
    def submit(self, task: Task) -> None:
        """Has `perform(task)` called somewhere, soon. May be called with a task that was lost."""

    @abstractmethod
    def wait(self, seconds: float) -> Result | None:
        """A task that has ended, or nothing after so long. One that was lost with its process or
        machine ended with an error of code "io": it is tried again."""

    def close(self) -> None:  # noqa: B027
        """Called at the end, also where tasks are still under way."""


class InProcess(Executor):
    """Tasks in this process, one after the other."""

    def __init__(self) -> None:
        self._waiting: deque[Task] = deque()

    def slots(self) -> int:
        return 1

    def submit(self, task: Task) -> None:
        self._waiting.append(task)

    def wait(self, seconds: float) -> Result | None:
        return perform(self._waiting.popleft()) if self._waiting else None


def perform(task: Task) -> Result:
    """Does a task; what every executor has called. Whoever calls it again does no harm: files
    get their names when they are whole, and a unit's bytes are always the same."""
    try:
        if task.library != library():
            raise Error(f"{task.name}: this machine has another build of umbel: {library()}")
        if task.inputs is not None:
            from umbel.scale.staging import perform_staged

            return Result(task, measured=perform_staged(task))
        began = time.perf_counter()
        source = shared_source(task) if task.kind == "sort" and task.tier == 0 else None
        run(task, task.work, None, source)
        return Result(task, measured={"build_seconds": time.perf_counter() - began})
    except Error as error:
        return Result(task, str(error), error.code if error.code in CODES else "unsupported")
    except MemoryError:
        return Result(task, f"{task.name} needs more memory than there is", "io")
    except Exception as error:  # every file system has its own
        where = (
            f", in {tempfile.gettempdir()}" if is_full(error) and task.inputs is not None else ""
        )
        return Result(task, f"{task.name}: {type(error).__name__}: {error}{where}", "io")


def run(
    task: Task,
    folder: str | Path,
    shards: list[int] | None,
    source: Any,
    fetch_taken: Callable[[], None] | None = None,
) -> None:
    """Does a task in a folder of this machine."""
    which = (KINDS.index(task.kind), task.tier, task.unit, task.plan)
    _umbel.run_task(folder, *which, task.threads, shards, source, fetch_taken)


def shared_source(task: Task) -> Any:
    """The source, of files that all machines have."""
    recipe = json.loads(Path(task.work, SOURCE).read_text())
    missing = [name for name in recipe["files"] if not Path(name).is_file()]
    if missing:
        raise OSError(f"{missing[0]} is not on this machine")
    return _umbel.TableSource(again(recipe))


@functools.cache
def library() -> str:
    """Which build of the library this is: arrays in work files are as it has them in memory."""
    digest = hashlib.blake2b(Path(_umbel.__file__).read_bytes(), digest_size=12).hexdigest()
    return f"{_umbel.version()} {digest}"


class Futures(Executor):
    """An executor over an engine of futures: two tasks a slot at most, so that none waits for the
    driver."""

    def __init__(self) -> None:
        self._tasks: dict[Any, Task] = {}
        self._ended: deque[Result] = deque()

    @abstractmethod
    def _start(self, task: Task) -> Any:
        """A future of `perform(task)`."""

    @abstractmethod
    def _wait(self, futures: list[Any], seconds: float) -> list[Any]:
        """Futures that are done, after so long at most."""

    @abstractmethod
    def _result(self, future: Any) -> Result:
        """Of a future that is done. May raise what the engine raises."""

    def submit(self, task: Task) -> None:
        self._tasks[self._start(task)] = task

    def wait(self, seconds: float) -> Result | None:
        if not self._ended and self._tasks:
            for future in self._wait(list(self._tasks), seconds):
                task = self._tasks.pop(future)
                try:
                    self._ended.append(self._result(future))
                except Exception as error:  # a worker that is gone
                    said = str(error).strip().splitlines() or [type(error).__name__]
                    self._ended.append(Result(task, f"{task.name} was lost: {said[0]}", "io"))
        return self._ended.popleft() if self._ended else None
