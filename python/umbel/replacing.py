"""Writing files so that a half-written one is never seen.

Needs nothing but Python: umbel.bench.bvh.cuda runs from the sources where nothing is built.
"""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO

from umbel.errors import Error


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[IO[bytes]]:
    """A binary file to write that takes the name `path` only when all of it is on disk."""
    # Named before it is made, so that an interrupt at any moment leaves nothing.
    temporary = path.parent / f".{path.name}.{secrets.token_hex(8)}.part"
    try:
        with temporary.open("xb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException as error:
        with contextlib.suppress(OSError):
            temporary.unlink()
        if isinstance(error, OSError):
            raise Error(f"cannot write {path}: {error.strerror or error}") from None
        raise


def write_all(path: Path, chunks: Iterable[bytes]) -> None:
    """Writes the chunks one after another; all or nothing."""
    with replacing(path) as file:
        for chunk in chunks:
            file.write(chunk)
