"""Checking an asset: its file, tables, and the cuts that they give."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass
from typing import Any

from umbel import _umbel
from umbel.geometry.arrays import thread_count, whole
from umbel.geometry.repair import Progress


@dataclass(frozen=True)
class VerifyReport:
    """What `verify` found; true where all holds."""

    ok: bool
    cuts: int
    """Random cuts that were checked."""
    cracks: int
    """Edges that are open in a cut and that the source does not allow."""
    overlaps: int
    """Edges of a cut with more triangles than the source allows."""
    limit_violations: int
    """Clusters over a limit, indices out of range, bad links."""
    monotone: bool
    """Whether errors and spheres never shrink towards the root."""
    checksum_errors: int
    problems: list[str]
    """A sentence each, the first 32."""

    def __bool__(self) -> bool:
        return self.ok

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)


def verify_arguments(
    cuts: int, seed: int, progress: Progress | None, threads: int, memory: int | None
) -> tuple[int, int, Progress | None, int, int]:
    """As the library takes them: a memory of 0 is no limit."""
    limit = 0 if memory is None else max(whole("memory", memory), 1)
    return whole("cuts", cuts), whole("seed", seed), progress, thread_count(threads), limit


def verify(
    path: str | os.PathLike[str],
    cuts: int = 64,
    *,
    seed: int = 1,
    memory: int | None = None,
    progress: Progress | None = None,
    threads: int = 0,
) -> VerifyReport:
    """Checks an asset file: checksums, tables, size limits, monotone errors and spheres, that
    level 0 is the source, and that `cuts` random cuts have no hole and no overlap.

    memory: read pages in order, several times, in about so many bytes, however large the file is;
        of each random cut one window is looked at. None: all tables and edges in memory.
    """
    how = verify_arguments(cuts, seed, progress, threads, memory)
    return VerifyReport(**_umbel.verify_asset(os.fspath(path), *how))
