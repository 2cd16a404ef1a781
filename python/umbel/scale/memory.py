"""How much memory there is."""

from __future__ import annotations

import contextlib
import json
import os
import sys
from pathlib import Path

from umbel.errors import Error

#: Of an input file, what a build in memory takes a byte, at least.
_IN_MEMORY = 8

_UNITS = {"": 1, "B": 1, "KB": 1e3, "MB": 1e6, "GB": 1e9, "TB": 1e12}
_UNITS |= {"KIB": 2**10, "MIB": 2**20, "GIB": 2**30, "TIB": 2**40}


def as_bytes(memory: float | str) -> int:
    """A number of bytes, or a text such as "2GB"; powers of 1000, and of 1024 for GiB."""
    size = 0.0
    if isinstance(memory, str):
        number = memory.strip().rstrip("BbIiKkMmGgTt")
        try:
            size = float(number) * _UNITS[memory.strip()[len(number) :].strip().upper()]
        except (KeyError, ValueError):
            size = 0.0
    else:
        with contextlib.suppress(TypeError, ValueError):
            size = float(min(memory, 1e18))
    if not 1 <= size < 1e18:
        raise Error(f"memory must be a size such as '2GB', not {memory!r}")
    return int(size)


def limit_of(memory: float | str | None) -> int:
    """So many bytes; of None three quarters of what is free."""
    return free_bytes() * 3 // 4 if memory is None else as_bytes(memory)


def is_too_large(source: str | os.PathLike[str], memory: float | str | None = None) -> bool:
    """Whether a build of a file in memory would take more than `memory`, by default three quarters
    of what is free: a guess, from the file's size."""
    try:
        size = _size_of(Path(source))
    except (OSError, ValueError):
        return False
    # Most files are small, whatever is free.
    return size * _IN_MEMORY > (64 << 20) and size * _IN_MEMORY > limit_of(memory)


def _size_of(path: Path) -> int:
    """Of a .gltf with its buffers, as it says that they are."""
    size = path.stat().st_size
    if path.suffix.lower() != ".gltf":
        return size
    try:
        buffers = json.loads(path.read_bytes())["buffers"]
        return size + sum(int(buffer["byteLength"]) for buffer in buffers)
    except (
        LookupError,
        RecursionError,
        TypeError,
        ValueError,
    ):  # reading it as a mesh says what is wrong
        return size


def free_bytes() -> int:
    """What this process may still take: of the machine, and of its control group."""
    free = [_available(), _left_in_group()]
    return min((size for size in free if size is not None), default=1 << 40)


def _available() -> int | None:
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) << 10
    except (OSError, ValueError, IndexError):
        pass
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return None


def _left_in_group() -> int | None:
    """Of Linux's control groups, version 2 or 1."""
    try:
        groups = [line.split(":", 2) for line in Path("/proc/self/cgroup").read_text().splitlines()]
    except OSError:
        return None
    left: list[int] = []
    for _, controllers, path in (group for group in groups if len(group) == 3):
        if controllers == "":
            root, most, used = Path("/sys/fs/cgroup"), "memory.max", "memory.current"
        elif "memory" in controllers.split(","):
            root = Path("/sys/fs/cgroup/memory")
            most, used = "memory.limit_in_bytes", "memory.usage_in_bytes"
        else:
            continue
        folder = root / path.lstrip("/")
        while True:
            # It may say "max", or be a group that cannot be seen from here.
            with contextlib.suppress(OSError, ValueError):
                left.append(int((folder / most).read_text()) - int((folder / used).read_text()))
            if folder == root:
                break
            folder = folder.parent
    return max(0, min(left)) if left else None


def peak_rss_bytes() -> int:
    """The most memory that this process has had resident."""
    # Linux counts what a process had before exec() in ru_maxrss, but not in VmHWM.
    status = Path("/proc/self/status")
    if status.is_file():
        for line in status.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) << 10
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak << 10
