"""Files as bytes: reading them whole, and writing so that a half-written one is never seen."""

from __future__ import annotations

import gzip
import warnings
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error
from umbel.replacing import replacing as replacing
from umbel.replacing import replacing_together as replacing_together
from umbel.replacing import write_all as write_all

GZIP = b"\x1f\x8b"
#: What some editors put before a text.
BOM = b"\xef\xbb\xbf"


def read_bytes(path: Path, is_binary: bool = False) -> bytes:
    """The file's bytes, unpacked if it is gzip. Of `is_binary` data the first two bytes may be
    gzip's by chance."""
    data = _read(path)
    if data[:2] == GZIP:
        try:
            data = gzip.decompress(data)
        except (OSError, EOFError, zlib.error, MemoryError) as error:
            if is_binary:
                return data
            raise Error(f"{path} is not a whole gzip file: {error}") from None
        if not data:
            raise Error(f"{path} is empty")
    return data


def text_of(name: object) -> str:
    """A file's name for messages of the library, which takes text only."""
    return str(name).encode("utf-8", "replace").decode()


def read_head(path: Path, count: int = 1 << 12) -> bytes:
    """The file's first bytes, as they are."""
    return _read(path, count)


def _read(path: Path, count: int = -1) -> bytes:
    try:
        if path.is_dir():
            raise Error(f"{path} is a folder, not a mesh file")
        with path.open("rb") as file:
            data = file.read(count)
    except OSError as error:
        raise Error(f"cannot read {path}: {error.strerror or error}") from None
    except ValueError as error:  # a name with a NUL
        raise Error(f"cannot read {str(path)!r}: {error}") from None
    if not data:
        raise Error(f"{path} is empty")
    return data


def numbers(
    text: bytes,
    expected: int | None,
    what: str,
    dtype: Any = np.float64,
    first_line: int | None = None,
) -> NDArray[Any]:
    """The white-space separated numbers in `text`; `expected` of them unless None. `first_line` is
    the text's in its file, if messages are to name lines."""
    if not text.strip():
        values = np.zeros(0, dtype)
    else:
        try:
            with warnings.catch_warnings():  # NumPy before 2.3 only warns of bad words
                warnings.simplefilter("error", DeprecationWarning)
                values = np.fromstring(text, dtype=dtype, sep=" ")
        except (ValueError, DeprecationWarning):
            word, line = _first_bad_word(text)
            place = "" if first_line is None else f", line {first_line + line}"
            raise Error(f"{what}{place}: {word!r} is no number") from None
    if expected is not None and len(values) != expected:
        raise Error(f"{what}: expected {expected} numbers, found {len(values)}")
    return values


def _first_bad_word(text: bytes) -> tuple[str, int]:
    """The first word that is no number, and the ends of lines before it."""
    for number, line in enumerate(text.split(b"\n" if b"\n" in text else b"\r")):
        for word in line.split():
            try:
                float(word.replace(b"_", b"?"))  # which Python takes within a number
            except ValueError:
                return word[:40].decode("utf-8", "replace"), number
    return "(something)", 0
