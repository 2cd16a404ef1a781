"""Builds of large meshes in a fixed memory, beside builds in memory: the table of docs/scale.md.

    .venv/bin/python bench/scale_figures.py [16:1GB 64:2GB ...] [--in-core 16 ...] [--kind terrain]
        [--folder DIR] [--direct] [-o TABLE.md]

Each of "millions of triangles:memory" is written as a PLY by the generator and built with
`umbel build --memory`, in a control group with that limit where this process may make one (Linux,
versions 1 and 2); else nothing enforces it. With `--direct` there is no file: the build asks the
generator for each range of triangles, every time that it reads it. Then the asset is opened, and a
cut is taken. It takes some 60 bytes of disk a triangle, with `--direct` some 42. Of each build:

seconds, processor seconds: of all processes; processor time can be compared on a busy machine
resident: the most that all processes had at a time, by looking every 50 ms; shared pages count in
    each process
group: the most that the control group had, with the pages of files that the system keeps while
    there is room, so it nears the limit
read, written: bytes of system calls, of all processes, cached or not
disk: the most that was taken on the disk of the folder, by looking every 50 ms
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from umbel.scale.memory import as_bytes
from umbel.testing import giant

OPEN = """
import json, sys, time
import numpy as np
import umbel
from umbel.scale.memory import peak_rss_bytes
umbel.Asset, umbel.Camera, umbel.Mesh
before, began = peak_rss_bytes(), time.perf_counter()
asset = umbel.Asset(sys.argv[1])
meshes = asset.meshes
print(json.dumps({"open_seconds": time.perf_counter() - began,
    "open_bytes": peak_rss_bytes() - before, **{k: meshes[0][k] for k in ("groups", "clusters")}}))
"""

DIRECT = """
import json, sys
import umbel
from umbel.testing import giant
kind, triangles, output, memory = sys.argv[1:]
built = umbel.build_asset(giant.make(kind, int(triangles)), output, memory=memory)
print(json.dumps(built))
"""


@dataclass
class Group:
    """A control group of memory, below the one that this process is in."""

    path: Path
    limit: str
    peak: str

    def most(self) -> int:
        """Bytes that it has held at most."""
        return int((self.path / self.peak).read_text())


def own_group() -> tuple[Path, str, str] | None:
    """Where a group can be made, and the names of its limit and peak."""
    for line in Path("/proc/self/cgroup").read_text().splitlines():
        _, controllers, path = line.split(":", 2)
        if controllers == "memory":
            root = Path("/sys/fs/cgroup/memory") / path.lstrip("/")
            return root, "memory.limit_in_bytes", "memory.max_usage_in_bytes"
        root = Path("/sys/fs/cgroup") / path.lstrip("/")
        if controllers == "" and (root / "memory.max").exists():
            return root, "memory.max", "memory.peak"
    return None


@contextlib.contextmanager
def limited(size: int | None) -> Iterator[Group | None]:
    """A group with a limit, gone again in the end; None where none can be made."""
    group = None
    try:
        found = own_group() if size is not None else None
        if found is not None:
            group = Group(found[0] / f"umbel_{os.getpid()}", *found[1:])
            group.path.mkdir()
            (group.path / group.limit).write_text(str(size))
    except OSError as error:
        print(f"no control group: {error}; nothing enforces the limit", file=sys.stderr)
        if group is not None and group.path.is_dir():
            group.path.rmdir()
        group = None
    try:
        yield group
    finally:
        if group is not None:
            group.path.rmdir()


def resident(session: int) -> int:
    """Bytes of all processes of a session."""
    total = 0
    for folder in Path("/proc").iterdir():
        if not folder.name.isdigit():
            continue
        with contextlib.suppress(OSError, IndexError, ValueError):
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
            if int(fields[3]) == session:
                total += int(fields[21]) * os.sysconf("SC_PAGE_SIZE")
    return total


def measured(command: list[str], size: int | None, folder: Path) -> dict[str, Any]:
    """Runs a command that writes to a folder and prints one JSON object, with what it took."""
    with limited(size) as group:
        free = shutil.disk_usage(folder).free

        def join() -> None:
            if group is not None:
                (group.path / "cgroup.procs").write_text("0")

        began = time.perf_counter()
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=join
        )
        peak, least, done = [0], [free], threading.Event()

        def watch() -> None:
            while not done.wait(0.05):
                peak[0] = max(peak[0], resident(process.pid))
                least[0] = min(least[0], shutil.disk_usage(folder).free)

        watcher = threading.Thread(target=watch)
        watcher.start()
        assert process.stdout is not None
        said = process.stdout.read()
        # Of a process that has ended, and of its children, until it is waited for.
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        counters = dict(
            line.split(": ") for line in Path(f"/proc/{process.pid}/io").read_text().splitlines()
        )
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        seconds = time.perf_counter() - began
        done.set()
        watcher.join()
        if process.returncode != 0:
            raise SystemExit(f"{' '.join(command)} ended with {process.returncode}")
        return {
            **json.loads(said),
            "seconds": seconds,
            "processor": usage.ru_utime + usage.ru_stime,
            "resident": peak[0],
            "group": group.most() if group is not None else None,
            "read": int(counters["rchar"]),
            "written": int(counters["wchar"]),
            "disk": free - least[0],
        }


def build(mesh: Path, output: Path, memory: str, in_core: bool) -> dict[str, Any]:
    """In units with a limit, or in memory without one."""
    command = [sys.executable, "-m", "umbel", "build", str(mesh), "-o", str(output), "--json"]
    limit = None if in_core else as_bytes(memory)
    return measured([*command, "--memory", memory], limit, output.parent)


def build_direct(kind: str, triangles: int, output: Path, memory: str) -> dict[str, Any]:
    """In units with a limit, straight from the generator."""
    command = [sys.executable, "-c", DIRECT, kind, str(triangles), str(output), memory]
    return measured(command, as_bytes(memory), output.parent)


def row(name: str, found: dict[str, Any], in_core: float | None) -> list[str]:
    """A line of the table. `in_core`: processor seconds a triangle of a build in memory."""
    triangles = found["input_triangles"]
    each = found["processor"] / triangles

    def giga(key: str) -> str:
        return "" if found.get(key) is None else f"{found[key] / 1e9:.2f}"

    return [
        name,
        f"{triangles:,}",
        giga("resident"),
        giga("group"),
        f"{found['seconds']:.0f}",
        f"{found['processor']:.0f}",
        f"{each * 1e6:.3f}",
        "" if in_core is None else f"{in_core / each:.2f}",
        giga("read"),
        giga("written"),
        giga("disk"),
        giga("file_bytes"),
        f"{found['open_seconds'] * 1e3:.0f}",
        f"{found['open_bytes'] / 1e6:.0f}",
    ]


HEAD = [
    *("build", "triangles", "resident GB", "group GB", "s", "processor s", "µs a triangle"),
    *("in memory / this", "read GB", "written GB", "disk GB", "asset GB", "open ms", "open MB"),
]


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("sizes", nargs="*", default=["16:1GB", "64:2GB"])
    parser.add_argument("--in-core", type=float, nargs="*", default=[16])
    parser.add_argument("--kind", default="terrain")
    parser.add_argument("--folder", type=Path, default=Path("/tmp/umbel_scale"))
    parser.add_argument("--direct", action="store_true", help="straight from the generator")
    parser.add_argument("-o", "--output", type=Path)
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    lines = [" | ".join(HEAD), " | ".join(["---"] + ["--:"] * (len(HEAD) - 1))]
    lines = [f"| {line} |" for line in lines]
    print("\n".join(lines), flush=True)
    each: float | None = None
    runs = [(float(size), "", True) for size in args.in_core]
    runs += [(float(text.partition(":")[0]), text.partition(":")[2], False) for text in args.sizes]
    mesh, output = args.folder / "mesh.ply", args.folder / "mesh.umbel"
    written = 0.0
    for millions, memory, in_core in runs:
        triangles = int(millions * 1e6)
        direct = args.direct and not in_core
        if millions != written and not direct:
            giant.write(giant.make(args.kind, triangles), mesh)
            written = millions
        if direct:
            found = build_direct(args.kind, triangles, output, memory)
        else:
            found = build(mesh, output, memory or "1TB", in_core)
        opened = subprocess.run(
            [sys.executable, "-c", OPEN, str(output)], check=True, capture_output=True, text=True
        )
        found |= json.loads(opened.stdout)
        if in_core:
            each = found["processor"] / found["input_triangles"]
        name = "in memory" if in_core else memory
        lines.append(f"| {' | '.join(row(name, found, None if in_core else each))} |")
        print(lines[-1], flush=True)
        output.unlink()
    mesh.unlink(missing_ok=True)
    if args.output is not None:
        args.output.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
