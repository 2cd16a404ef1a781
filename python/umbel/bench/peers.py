"""The libraries that Umbel is compared with: the extension module umbel._peers. `make setup` builds
it, and wheels do not have it."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

peers: ModuleType | None
try:
    from umbel import _peers

    peers = _peers
except ImportError:
    peers = None


def meshoptimizer_version() -> str | None:
    """That of the meshoptimizer that is compared with."""
    return None if peers is None else str(peers.meshoptimizer_version())


def has_clusterlod() -> bool:
    """Whether clusterlod.h was there when the package was built."""
    return peers is not None and bool(peers.has_clusterlod)


def clusterlod_cuts(*arguments: Any) -> tuple[list[NDArray[np.uint32]], float]:
    """The triangles of cuts by clusterlod.h, and the seconds of its build; where there is one."""
    assert peers is not None
    cuts: tuple[list[NDArray[np.uint32]], float] = peers.clusterlod_cuts(*arguments)
    return cuts
