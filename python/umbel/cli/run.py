"""What every command shares: its common options, how it ends, and what it says."""

from __future__ import annotations

import contextlib
import enum
import errno
import functools
import json
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, TypeVar

import typer

from umbel.cli import Stopped, discard_output, stop_behind
from umbel.cli.failure import Failure, failure_object, naming_file, one_line, with_flags

if TYPE_CHECKING:
    from umbel.errors import Error

FAULT, USAGE, CHECK_FAILED = 1, 2, 3

Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on standard output, nothing else.")
]
Threads = Annotated[
    int, typer.Option("--threads", min=0, metavar="N", help="Most threads to use; 0: all cores.")
]


class Device(str, enum.Enum):
    cpu = "cpu"
    cuda = "cuda"


Command = TypeVar("Command", bound=Callable[..., Any])

_INPUTS = ("source", "path", "inputs", "scenes")
_PATHS = (*_INPUTS, "output", "export")
"""Arguments that are files and folders, inputs first."""


_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EBADF)  # EBADF: it is closed


def say(sentence: str) -> None:
    """One line on standard error."""
    with contextlib.suppress(OSError):
        print(f"umbel: {sentence}", file=sys.stderr, flush=True)


def fail(sentence: str, status: int = FAULT, source: str | None = None) -> NoReturn:
    """Ends the command with one sentence. `source`: the input at fault, if there are several."""
    raise Failure(sentence, status, source)


def ends_cleanly(flags: Mapping[str, str] | None = None) -> Callable[[Command], Command]:
    """Whatever goes wrong on the user's side becomes one sentence and an exit status; with --json
    an object as well.

    flags: what the library calls differently from the command, and the flag that it is.
    """

    def decorate(command: Command) -> Command:
        @functools.wraps(command)
        def wrapper(*args: Any, **kwargs: Any) -> Any:
            listen(_show_warning)
            try:
                result = command(*args, **kwargs)
                print(end="", flush=True)
                return result
            except typer.Exit:
                raise
            except (Exception, Stopped) as raised:
                error = stop_behind(raised) or raised
                failure = _failure(error, kwargs.get("drop_invalid") is False)
                if failure is None:  # a fault of ours: the traceback says where
                    if kwargs.get("as_json"):
                        print(failure_object(f"{type(error).__name__}: {error}", None), flush=True)
                    raise
                _end(failure, kwargs, flags or {}, names_file=not isinstance(error, Stopped))

        return wrapper  # type: ignore[return-value]

    return decorate


def _failure(error: BaseException, drops: bool) -> Failure | None:
    """What an exception says to the user; None where it is no fault of theirs. `drops`: whether
    the command could leave out what is not finite, and was not asked to."""
    from umbel.errors import Error

    if isinstance(error, Failure):
        return error
    if isinstance(error, Error):
        return Failure(str(error) + _hint(error, drops), FAULT)
    if isinstance(error, Stopped):
        return Failure(error.word, error.status)
    if isinstance(error, MemoryError):
        return Failure("not enough memory", FAULT)
    if isinstance(error, BrokenPipeError):
        discard_output()
        raise typer.Exit(FAULT) from None
    if isinstance(error, OSError):
        where = f"{error.filename}: " if error.filename else ""
        if not where and error.errno in _FULL:  # what is written elsewhere has a name
            where = "cannot write standard output: "
        return Failure(f"{where}{error.strerror or error}", FAULT)
    return None


def _hint(error: Error, drops: bool) -> str:
    """What helps with a mesh that the library refuses, where it does not say so itself."""
    if error.code != "invalid_mesh" or "drop_invalid" in str(error):
        return ""
    flag = (
        "--drop-invalid"
        if drops and "vertex index" not in str(error)
        else "`umbel build --drop-invalid`"
    )
    return f"; {flag} leaves such triangles out"


def sentence_of(
    error: BaseException, flags: Mapping[str, str], source: str | None, paths: Sequence[str]
) -> str:
    """What an exception says to a user who knows flags and files."""
    failure = _failure(error, drops=True)
    text = f"{type(error).__name__}: {error}" if failure is None else str(failure)
    return naming_file(with_flags(one_line(text), flags, paths), source, paths)


_ELSEWHERE = {
    name: f"`umbel build --{name.replace('_', '-')}`" for name in ("drop_invalid", "allow_outside")
}
"""What helps, of commands that do not have the flag themselves."""


def _end(
    failure: Failure, given: Mapping[str, Any], flags: Mapping[str, str], names_file: bool
) -> NoReturn:
    paths = _paths(given)
    inputs = _paths({name: given.get(name) for name in _INPUTS})
    source = failure.source if failure.source is not None else next(iter(inputs), None)
    own = {
        name: f"--{name.replace('_', '-')}" for name in given if name not in (*_PATHS, "as_json")
    }
    sentence = one_line(str(failure))
    if names_file:
        sentence = sentence_of(failure, {**flags, **_ELSEWHERE, **own, **flags}, source, paths)
    say(sentence)
    if given.get("as_json"):
        with contextlib.suppress(OSError):
            print(failure_object(sentence, source), flush=True)
    raise typer.Exit(failure.status)


def _paths(given: Mapping[str, Any]) -> list[str]:
    """All files and folders that the command was given, as they were written; inputs first."""
    found: list[str] = []
    for name in _PATHS:
        value = given.get(name)
        for one in value if isinstance(value, (list, tuple)) else [value]:
            if one is not None:
                found.append(str(one))
    return found


heard: list[str] = []
"""The warnings of this command, for its JSON object."""


def hear(message: Warning | str) -> str:
    """Keeps a warning, and gives it in a user's words."""
    flags = {"allow_outside": "--allow-outside", "instances='on'": "--instances on"}
    sentence = with_flags(one_line(str(message)), flags)
    heard.append(sentence)
    return sentence


def listen(show: Callable[..., None]) -> None:
    """Has warnings shown so, whatever PYTHONWARNINGS says of them: results hold them all."""
    warnings.showwarning = show
    warnings.simplefilter("default", UserWarning)


def warn_no_effect(flag: str, why: str) -> None:
    """A warning, not an error: scripts give the same flags to all methods."""
    warnings.warn(f"{flag} has no effect: {why}", stacklevel=3)


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    say(f"warning: {hear(message)}")


def is_asset(path: str | Path) -> bool:
    """Whether a file is meant as an asset, by its name."""
    return str(path).lower().endswith(".umbel")


def show(result: dict[str, Any], as_json: bool, title: str) -> None:
    """The result: one JSON object, a table on a terminal, plain lines elsewhere."""
    from umbel.plain_json import plain

    result = plain(result)
    if not as_json:
        result.pop("warnings", None)  # they have been said
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
        return " ".join(_in_list(item) for item in value) or "-"
    return str(value)


def _in_list(value: Any) -> str:
    """Coordinates need more digits than other numbers: on maps they are large."""
    return f"{value:.12g}" if isinstance(value, float) else _text(value)


def _print_table(result: dict[str, Any], title: str) -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=escape(title), show_header=False, title_justify="left")
    table.add_column(style="bold", overflow="fold")
    table.add_column(justify="right", overflow="fold")
    for key, value in _rows(result):
        table.add_row(escape(key.replace("_", " ")), escape(value))
    Console().print(table)
