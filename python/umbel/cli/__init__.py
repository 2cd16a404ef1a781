"""The command line, `umbel COMMAND`.

Exit status: 0 done, 1 the input or an argument is at fault, 2 usage, 3 a check did not hold.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any, NoReturn


class Stopped(BaseException):
    """SIGINT, SIGTERM or SIGHUP arrived. Not KeyboardInterrupt, which typer ends without a word."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.word = "interrupted" if number == signal.SIGINT else "terminated"
        self.status = 128 + number


def _stop(number: int, _frame: FrameType | None) -> NoReturn:
    raise Stopped(number)


def stop_behind(error: BaseException | None) -> Stopped | None:
    """The signal behind an error: Python before 3.12 wraps what is raised as a class is made, and
    an import that is interrupted may look like one that is not possible."""
    while error is not None and not isinstance(error, Stopped):
        error = error.__cause__ or error.__context__
    return error


def discard_output() -> None:
    """Drops what standard output does not take; Python would complain of it when it exits."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def main() -> None:
    """The entry point of the command `umbel`."""
    signal.signal(signal.SIGTERM, _stop)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not if it is ignored
        signal.signal(signal.SIGINT, _stop)
    # The terminal is gone; nohup has this ignored.
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:
        signal.signal(signal.SIGHUP, _stop)
    if sys.stdout is None:  # closed: what is written to it fails, and no file takes its number
        sys.stdout = os.fdopen(os.open(os.devnull, os.O_RDONLY), "w")
    if sys.stdout.errors == "strict":  # not every name has letters of its encoding alone
        sys.stdout.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    # Commands end cleanly by themselves; this is for what comes before them, imports above all.
    status = 0
    try:
        from umbel.cli.app import app

        status = _run(app, sys.argv[1:])
        print(end="", flush=True)
    except (Stopped, RuntimeError, ImportError) as error:
        stopped = stop_behind(error)
        if stopped is None:
            raise
        print(f"umbel: {stopped.word}", file=sys.stderr)
        if "--json" in sys.argv[1:]:
            with contextlib.suppress(OSError):
                print(f'{{"error": "{stopped.word}", "input": null}}', flush=True)
        status = stopped.status
    except OSError as error:
        discard_output()
        if status == 0 and not isinstance(error, BrokenPipeError):
            print(f"umbel: cannot write standard output: {error.strerror}", file=sys.stderr)
        status = status or 1
    sys.exit(status)


def _run(app: Callable[..., Any], arguments: list[str]) -> int:
    """Runs a command; its exit status."""
    if "--json" in arguments:
        return _with_objects(app, arguments)
    try:
        app(prog_name="umbel")
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def _with_objects(app: Callable[..., Any], arguments: list[str]) -> int:
    """Runs a command with --json, where wrong usage is an object on standard output too."""
    try:
        return app(arguments, prog_name="umbel", standalone_mode=False) or 0
    except Exception as error:
        # Which class it is depends on the version of typer.
        if not hasattr(error, "format_message") or not hasattr(error, "exit_code"):
            raise
        from umbel.cli.failure import failure_object, input_of, one_line

        sentence = one_line(error.format_message()) or "a command is missing"
        print(f"umbel: {sentence}", file=sys.stderr)
        with contextlib.suppress(OSError):
            print(failure_object(sentence, input_of(arguments, error)), flush=True)
        return int(error.exit_code)
