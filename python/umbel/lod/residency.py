"""Pages of an asset in memory under a budget, as cameras move."""

from __future__ import annotations

import atexit
import time
from collections.abc import Sequence
from typing import Any
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

from umbel import _umbel
from umbel.errors import Error
from umbel.geometry.arrays import number, thread_count, whole
from umbel.geometry.camera import Camera
from umbel.lod.asset import Asset

_MOST = 2**64 - 1  # bytes


class Residency:
    """Which pages of an asset are in memory. Each step says what views would show; what is not
    there yet is shown coarser, without holes, and loads in the background. Numbers of bytes, loads,
    evictions, groups and attempts may be 0: no limit. Calls of several threads wait for each other.

    budget: most bytes of pages, as they are in the file; those of the root groups count.
    loads_in_flight: pages asked for and not there yet.
    bytes_per_step, evictions_per_step: most that a step takes over and gives up.
    groups_per_step: about how many groups a step evaluates; the others follow in the next.
    hysteresis: a page replaces another only if its priority is so many times higher.
    attempts, backoff, slow: loads that fail, or take longer than `slow` seconds, are tried again
        after `backoff` seconds, twice that, and so on, so many times; then the region stays coarse.
    threads: that read and check pages.
    link: instead of reading, simulate a line: its latency in seconds, its bytes a second, and the
        shares of loads that fail and that are ten times as slow. Its time is the steps' `now`.
    """

    def __init__(
        self,
        asset: Asset,
        budget: int = 256 << 20,
        *,
        loads_in_flight: int = 8,
        bytes_per_step: int = 8 << 20,
        evictions_per_step: int = 64,
        groups_per_step: int = 4096,
        hysteresis: float = 1.5,
        attempts: int = 5,
        backoff: float = 0.1,
        slow: float = 10.0,
        threads: int = 2,
        link: tuple[float, float, float, float] | None = None,
    ) -> None:
        self.asset = asset
        self._native = _umbel.Residency(
            asset._native,
            whole("budget", budget, _MOST),
            whole("loads_in_flight", loads_in_flight),
            whole("bytes_per_step", bytes_per_step, _MOST),
            whole("evictions_per_step", evictions_per_step),
            whole("groups_per_step", groups_per_step),
            _at_least("hysteresis", hysteresis, 1),
            whole("attempts", attempts),
            _at_least("backoff", backoff, 0),
            _at_least("slow", slow, 0),
            thread_count(threads),
            None if link is None else _link(link),
        )
        _open.add(self)

    def step(
        self,
        views: Sequence[Camera | float | tuple[int, Camera | float]],
        now: float | None = None,
        aspect: float | None = None,
    ) -> dict[str, Any]:
        """Takes over what has come, chooses what the views show, and asks for what is missing.

        views: each a camera or an error, of the first mesh, or (mesh, camera or error), in that
            mesh's own space: the world, where the asset has no instances.
        aspect: width over height of the cameras' pictures; what lies outside them is then shown as
            coarse as it may be. None: they see all around.
        now: seconds on any clock that does not run backwards; None: the machine's.
        Returns `worst_error` (how many times larger than asked for the largest error shown is; 0
        where nothing is missing), `open_groups missing_groups loaded evicted requested
        cancelled evaluated`, `caught_up` (false: there were more groups to look at than
        `groups_per_step`), and `seconds` of processor time.
        """
        named = [view if isinstance(view, tuple) else (0, view) for view in views]
        origin = self.asset._mesh_origin
        near = [
            (mesh, view.relative_to(origin) if isinstance(view, Camera) else view)
            for mesh, view in named
        ]
        native = [(whole("mesh", mesh), _view(view), _planes(view, aspect)) for mesh, view in near]
        return self._native.step(native, time.monotonic() if now is None else now)

    def cut(self, view: int = 0) -> NDArray[np.uint32]:
        """The clusters that a view of the last step shows, ascending, by their numbers in its
        mesh's tables."""
        return self._native.clusters(whole("view", view))

    @property
    def resident_pages(self) -> NDArray[np.uint32]:
        """Pages that are in memory, ascending."""
        return self._native.resident_pages()

    @property
    def statistics(self) -> dict[str, Any]:
        """Bytes and pages that are there, came and went; loads that failed, and `given_up`: the
        pages that did so too often."""
        return self._native.statistics

    @property
    def wanted_pages(self) -> NDArray[np.uint32]:
        """Pages that the last step's views show, or would if they were there; ascending."""
        return self._native.wanted_pages()

    def retry_failed(self) -> None:
        """Requests pages again whose loads failed too often."""
        self._native.retry_failed()

    def set_budget(self, budget: int) -> None:
        """Changes the budget; the next steps keep to it as pages come."""
        self._native.set_budget(whole("budget", budget, _MOST))

    def close(self) -> None:
        """Ends loading; what is there stays. Waits for reads in progress: those of a web server
        fail once it has sent nothing for ten seconds."""
        self._native.close()
        _open.discard(self)


_open: WeakSet[Residency] = WeakSet()


@atexit.register
def _close_all() -> None:
    """Threads that call Python must have ended before the interpreter does."""
    for residency in list(_open):
        residency.close()


def _at_least(name: str, value: float, least: int) -> float:
    if not number(name, value) >= least:
        raise Error(f"{name} must be at least {least}, not {value}")
    return float(value)


def _link(link: Sequence[float]) -> tuple[float, float, float, float]:
    if len(link) != 4:
        raise Error(f"link must have 4 numbers, not {len(link)}")
    latency, rate, fail, slow = (number("link", value) for value in link)
    return latency, rate, fail, slow


def _view(view: Camera | float) -> _umbel.View:
    if isinstance(view, Camera):
        return view.view()
    if not view >= 0:
        raise Error(f"an error must not be negative, and is {view}")
    return _umbel.view_error(view)


def _planes(view: Camera | float, aspect: float | None) -> NDArray[np.float32] | None:
    if aspect is None or not isinstance(view, Camera):
        return None
    return view.planes(aspect).astype(np.float32)
