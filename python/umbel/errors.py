"""The exception and the warning that the package raises."""

from __future__ import annotations


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
