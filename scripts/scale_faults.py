"""Kills builds in units, and checks that each goes on to the same bytes.

    .venv/bin/python scripts/scale_faults.py [MESH] [--triangles 60000] [--unit-triangles 8000]
        [--moments 50] [--every 1]

First at every rename of a file, just before and just after it, by a small library that counts
renames in all processes of the build (LD_PRELOAD, so it needs Linux and a C compiler); then at
random moments. Each time all processes get SIGKILL, and `umbel build --resume` must give the file
that an undisturbed build gives, and leave nothing else behind.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from umbel.testing import giant

SHIM = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

int rename(const char* from, const char* to) {
  int (*real)(const char*, const char*) =
      (int (*)(const char*, const char*))dlsym(RTLD_NEXT, "rename");
  const long at = atol(getenv("FAULT_AT"));
  const int file = open(getenv("FAULT_COUNTS"), O_WRONLY | O_APPEND | O_CREAT, 0600);
  struct stat status;
  long count = 0;
  if (write(file, "x", 1) == 1 && fstat(file, &status) == 0) count = status.st_size;
  close(file);
  if (2 * count - 1 == at) kill(0, SIGKILL);
  const int result = real(from, to);
  if (2 * count == at) kill(0, SIGKILL);
  return result;
}
"""


class Build:
    """One build, again and again."""

    def __init__(self, mesh: Path, folder: Path, unit_triangles: int) -> None:
        self.folder, self.output = folder, folder / "out.umbel"
        self.counts = folder.parent / "counts"
        self.shim = folder.parent / "shim.so"
        source = folder.parent / "shim.c"
        source.write_text(SHIM)
        subprocess.run(["cc", "-shared", "-fPIC", "-o", self.shim, source, "-ldl"], check=True)
        self.command = [sys.executable, "-m", "umbel", "build", str(mesh), "-o", str(self.output)]
        self.command += ["--unit-triangles", str(unit_triangles)]

    def clear(self) -> None:
        """Makes the folder empty."""
        subprocess.run(["rm", "-rf", self.folder], check=True)
        self.folder.mkdir()
        self.counts.unlink(missing_ok=True)

    def start(self, fault: int | None = None) -> subprocess.Popen[bytes]:
        """A build of its own process group, which dies at a fault if that is given."""
        environment = dict(os.environ)
        if fault is not None:
            environment |= {"LD_PRELOAD": str(self.shim), "FAULT_AT": str(fault)}
            environment["FAULT_COUNTS"] = str(self.counts)
        resume = ["--resume"] if self.folder.joinpath("out.umbel.work").exists() else []
        return subprocess.Popen(
            self.command + resume,
            env=environment,
            start_new_session=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )

    def result(self) -> str:
        """Goes on until there is a file, and says what is in it."""
        process = self.start()
        said = process.communicate()[1].decode()
        if process.returncode != 0:
            return f"FAILED: {said}"
        digest = hashlib.sha256(self.output.read_bytes()).hexdigest()
        left = sorted(path.name for path in self.folder.iterdir())
        return digest if left == ["out.umbel"] else f"FAILED: it leaves {left}"


def main() -> int:
    """Runs all faults; the exit status is 1 if any build comes to another end."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("mesh", type=Path, nargs="?")
    parser.add_argument("--triangles", type=int, default=60_000)
    parser.add_argument("--unit-triangles", type=int, default=8_000)
    parser.add_argument("--moments", type=int, default=50)
    parser.add_argument("--every", type=int, default=1, help="of the renames, each n-th")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        mesh = args.mesh
        if mesh is None:
            mesh = Path(scratch) / "terrain.ply"
            giant.write(giant.terrain(args.triangles), mesh)
        return run(Build(mesh, Path(scratch) / "build", args.unit_triangles), args)


def run(build: Build, args: argparse.Namespace) -> int:
    """Both kinds of faults."""
    build.clear()
    began = time.monotonic()
    build.start(0).communicate()
    seconds = time.monotonic() - began
    renames = build.counts.stat().st_size
    build.clear()
    expected = build.result()
    print(f"{renames} renames, {seconds:.1f} s, {expected}", flush=True)
    failed = 0
    for fault in range(1, 2 * renames + 1, args.every):
        build.clear()
        process = build.start(fault)
        process.communicate()
        killed = process.returncode == -signal.SIGKILL
        # After the last rename there is nothing to resume: the work folder goes.
        found = build.result() if killed else "FAILED: it was not killed"
        failed += found != expected
        if found != expected:
            print(f"fault {fault}: {found}", flush=True)
    print(f"killed at {len(range(1, 2 * renames + 1, args.every))} renames: {failed} failed")
    moments = random.Random(1)
    for k in range(args.moments):
        build.clear()
        process = build.start()
        time.sleep(moments.uniform(0, seconds))
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        found = build.result()
        failed += found != expected
        if found != expected:
            print(f"moment {k}: {found}", flush=True)
    print(f"killed at {args.moments} moments; {failed} failed in all")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
