"""Reads files one after the other, within a time and an amount of memory for each; for
test_broken_files.py, which runs this as a process of its own. Prints a line of JSON before each
file and one after it."""

from __future__ import annotations

import json
import resource
import signal
import sys
import time
import warnings
from pathlib import Path

import umbel
import umbel.io.gltf.draco
import umbel.io.gltf.reader
import umbel.io.obj.reader
import umbel.io.ply.reader
import umbel.io.stl

SECONDS, BYTES = 5.0, 1 << 30


def limit_memory() -> None:
    """To BYTES more than the process has mapped."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + BYTES
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def outcome(path: str) -> tuple[str, str]:
    """What a user hears of a file."""
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        try:
            umbel.validate(umbel.load(path))
        except umbel.Error as error:
            return ("error" if path in str(error) else "error without the file"), str(error)
        except Exception as error:
            return "crash", f"{type(error).__name__}: {error}"
    return ("warning", str(heard[0].message)) if heard else ("silence", "")


def main() -> None:
    umbel.validate(umbel.load(sys.argv[1]))  # starts threads and loads libraries
    limit_memory()
    for path in sys.stdin.read().split("\n"):
        print(json.dumps({"path": path}), flush=True)
        signal.setitimer(signal.ITIMER_REAL, SECONDS)  # whose signal ends the process
        start = time.perf_counter()
        said, sentence = outcome(path)
        seconds = time.perf_counter() - start
        signal.setitimer(signal.ITIMER_REAL, 0)
        print(json.dumps({"outcome": said, "sentence": sentence, "seconds": seconds}), flush=True)


if __name__ == "__main__":
    main()
