"""How things are timed: by turns, on a machine that is described."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any, Generic, TypeVar

from umbel import _umbel
from umbel.bench.peers import meshoptimizer_version
from umbel.errors import Cancelled
from umbel.geometry.repair import Progress, stops

RESOLUTION = 1e-6  # seconds: the clock's; anything faster took this
BUSY_LOAD = 0.25  # of a core: more than this was going on beside the benchmark

Result = TypeVar("Result")


class Span:
    """The part [begin, end] of a long job's progress; what it says starts with `name`."""

    def __init__(
        self, progress: Progress | None, name: str, begin: float = 0.0, end: float = 1.0
    ) -> None:
        self._progress, self._name = progress, name
        self._begin, self._end = begin, end

    def part(self, begin: float, end: float) -> Span:
        """A part of this part."""
        size = self._end - self._begin
        return Span(
            self._progress, self._name, self._begin + begin * size, self._begin + end * size
        )

    def __call__(self, fraction: float, what: str) -> None:
        """Raises Cancelled if the callback wants no more."""
        if self._progress is None:
            return
        done = self._begin + (self._end - self._begin) * fraction
        if stops(self._progress(done, f"{self._name}: {what}")):
            raise Cancelled("cancelled")


@dataclass
class Timed(Generic[Result]):
    """Something to time: `work` gives a result and the seconds that it took."""

    name: str
    work: Callable[[], tuple[Result, float]]


@dataclass
class Timing(Generic[Result]):
    """What came of it."""

    result: Result
    seconds: float
    """The median."""


def take_turns(
    entries: Sequence[Timed[Result]], runs: int, report: Callable[[float, str], None]
) -> list[Timing[Result]]:
    """Runs each entry once, then each once more, and so on. `report` is told the fraction that is
    done and what comes next."""
    times: list[list[float]] = [[] for _ in entries]
    results: list[Result] = []
    for run in range(runs):
        for index, entry in enumerate(entries):
            report((run + index / len(entries)) / runs, entry.name)
            result, seconds = entry.work()
            times[index].append(max(seconds, RESOLUTION))
            if run == 0:
                results.append(result)
    return [Timing(result, median(own)) for result, own in zip(results, times, strict=True)]


def cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@dataclass(frozen=True)
class Machine:
    """Where figures were measured, and how quiet it was there."""

    cpu: str
    cores: int
    system: str
    load: float | None
    """Mean number of running processes in the minute before; None where nobody counts."""
    umbel: str
    meshoptimizer: str | None
    """Its version, where it is compared with."""

    @property
    def busy(self) -> bool:
        """Whether other programs may have disturbed the measurement."""
        return self.load is not None and self.load > BUSY_LOAD

    def sentences(self) -> list[str]:
        """The machine in words."""
        load = "unknown" if self.load is None else f"{self.load:.2f}"
        version = self.meshoptimizer
        theirs = "no other libraries" if version is None else f"meshoptimizer {version}"
        said = [
            f"{self.cpu}, {self.cores} cores, {self.system}. Load average before: {load}.",
            f"Umbel {self.umbel}, {theirs}.",
        ]
        if self.busy:
            said.append(
                "The machine was busy with other work: trust the ratios more than the seconds, "
                "and times on several threads least."
            )
        return said

    def fields(self) -> dict[str, Any]:
        """The machine for JSON."""
        return asdict(self) | {"busy": self.busy}


def this_machine() -> Machine:
    """The machine now; to be asked before it gets to work."""
    try:
        load: float | None = os.getloadavg()[0]
    except (OSError, AttributeError):
        load = None
    return Machine(
        cpu=_cpu_name(),
        cores=cores(),
        system=f"{platform.system()} {platform.machine()}",
        load=load,
        umbel=_umbel.version(),
        meshoptimizer=meshoptimizer_version(),
    )


def _cpu_name() -> str:
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text().splitlines():
            key, _, value = line.partition(":")
            if key.strip() == "model name" and value.strip():
                return value.strip()
    return platform.processor() or "unknown CPU"
