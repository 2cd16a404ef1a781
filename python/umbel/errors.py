"""The exception and the warning that the package raises."""

from __future__ import annotations

import warnings
from collections.abc import Sequence


class Error(ValueError):
    """Input, an argument or a file is at fault; the message is one sentence that names it.

    `code` says what kind of failure the library met: "invalid_argument", "invalid_mesh", "io",
    "corrupt", "unsupported", "cancelled" or "device"; it is empty where the package itself
    raised."""

    code: str = ""


class Cancelled(Error):
    """A progress callback asked to stop, and nothing was made."""


class LoadWarning(UserWarning):
    """A file was read, but something in it was left out or replaced."""


def warn_lost(what: str, which: Sequence[str], most: int = 4) -> None:
    """One LoadWarning that names all that was left out, or how many more there are."""
    rest = len(which) - most
    more = [f"and {rest} more"] if rest > 0 else []
    warnings.warn(f"{what}: {'; '.join([*which[:most], *more])}", LoadWarning, stacklevel=3)
