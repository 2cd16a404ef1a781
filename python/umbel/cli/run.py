"""What every command shares: its common options, how it ends, and what it says."""

from __future__ import annotations

import contextlib
import functools
import json
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any, NoReturn, TypeVar

import typer

from . import Stopped

FAULT, USAGE, CHECK_FAILED = 1, 2, 3

Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on standard output, nothing else.")
]
Threads = Annotated[
    int, typer.Option("--threads", min=0, metavar="N", help="Most threads to use; 0: all cores.")
]

Command = TypeVar("Command", bound=Callable[..., Any])


def say(sentence: str) -> None:
    """One line on standard error."""
    with contextlib.suppress(OSError):
        print(f"umbel: {sentence}", file=sys.stderr, flush=True)


def fail(sentence: str, status: int = FAULT) -> NoReturn:
    """Ends the command with one sentence."""
    say(sentence)
    raise typer.Exit(status)


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    say(f"warning: {message}")


def ends_cleanly(command: Command) -> Command:
    """Whatever goes wrong on the user's side becomes one sentence and an exit status."""

    @functools.wraps(command)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        from ..errors import Error

        warnings.showwarning = _show_warning
        try:
            result = command(*args, **kwargs)
            sys.stdout.flush()
            return result
        except Error as error:
            fail(_one_line(str(error)))
        except Stopped as stopped:
            fail(stopped.word, stopped.status)
        except MemoryError:
            fail("not enough memory")
        except BrokenPipeError:
            # Nobody reads the output any more; Python would complain again when it exits.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise typer.Exit(FAULT) from None
        except OSError as error:
            where = f"{error.filename}: " if error.filename else ""
            fail(f"{where}{error.strerror or error}")

    return wrapper  # type: ignore[return-value]


def _one_line(text: str) -> str:
    return " ".join(text.split())


def check_output(path: Path, *suffixes: str) -> None:
    """Refuses, before any work, an output that could not be written."""
    if path.suffix.lower() not in suffixes:
        fail(f"{path}: the output must end in {' or '.join(suffixes)}")
    if path.is_dir():
        fail(f"{path} is a folder")
    if not path.absolute().parent.is_dir():
        fail(f"{path}: there is no folder {path.absolute().parent}")


def is_asset(path: Path) -> bool:
    """Whether a file is meant as an asset, by its name."""
    return path.suffix.lower() == ".umbel"


def show(result: dict[str, Any], as_json: bool, title: str) -> None:
    """The result: one JSON object, a table on a terminal, plain lines elsewhere."""
    from ..metadata import plain

    result = plain(result)
    if as_json:
        print(json.dumps(result, allow_nan=False))
    elif sys.stdout.isatty():
        _print_table(result, plain(title))
    else:
        for key, value in _rows(result):
            print(f"{key}: {value}")


def _rows(result: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    for key, value in result.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict):
            yield from _rows(value, f"{name}.")
        else:
            yield name, _text(value)


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return "-"
    if isinstance(value, int):
        return f"{value:,}"
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 1e5 else f"{value:.6g}"
    if isinstance(value, list):
        return " ".join(_text(item) for item in value) or "-"
    return str(value)


def _print_table(result: dict[str, Any], title: str) -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=escape(title), show_header=False, title_justify="left")
    table.add_column(style="bold", no_wrap=True)
    table.add_column(justify="right", overflow="fold")
    for key, value in _rows(result):
        table.add_row(escape(key.replace("_", " ")), escape(value))
    Console().print(table)
