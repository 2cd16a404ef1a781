"""The command line: `umbel build`, `info`, `verify`, `extract`, `cluster`, `bench`.

Exit status: 0 done, 1 the input or an argument is at fault, 2 usage, 3 a check did not hold.
"""

from __future__ import annotations

import signal
import sys
from types import FrameType
from typing import NoReturn


class Terminated(BaseException):
    """SIGTERM arrived."""


def _terminate(_number: int, _frame: FrameType | None) -> NoReturn:
    raise Terminated


def main() -> None:
    """The entry point of the command `umbel`."""
    signal.signal(signal.SIGTERM, _terminate)
    # Commands end cleanly by themselves; this is for what comes before them, imports above all.
    try:
        from .app import app

        app(prog_name="umbel")
    except KeyboardInterrupt:
        _end("interrupted", signal.SIGINT)
    except Terminated:
        _end("terminated", signal.SIGTERM)


def _end(word: str, number: signal.Signals) -> NoReturn:
    print(f"umbel: {word}", file=sys.stderr)
    sys.exit(128 + number)
