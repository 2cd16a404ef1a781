"""Bytes of assets that are not files: from servers, archives and anything that fsspec knows."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Literal, Protocol

from umbel.errors import Error
from umbel.io.addresses import reason_of, web_options

Read = Callable[[int, int], bytes]


class BinaryFile(Protocol):
    """What is read of an open file: also of one that is compressed, mapped or in an archive."""

    def seek(self, offset: int, whence: Literal[0, 2] = ..., /) -> object: ...
    def tell(self) -> int: ...
    def read(self, size: int, /) -> bytes: ...


#: Seconds without a byte after which a read has failed: who closes a residency waits no longer.
_SILENCE = 10.0


def remote(url: str) -> tuple[int, Read]:
    """The size of what a URL names, and a function that reads (offset, size) of it."""
    try:
        import fsspec.core
    except ImportError:
        raise Error(f"{url}: URLs need fsspec: pip install 'umbel[remote]'") from None
    try:
        system, path = fsspec.core.url_to_fs(url, **web_options(url, _SILENCE))
        size = system.size(path)
    except Exception as error:  # every file system has its own
        raise Error(f"cannot open {url}: {reason_of(error)}") from None
    if size is None:
        raise Error(f"cannot open {url}: it does not say how large it is")

    def read(offset: int, count: int) -> bytes:
        if count == 0:
            return b""
        data = bytes(system.cat_file(path, start=offset, end=offset + count))
        if len(data) == size > count:
            raise Error("the server sends whole files only; it must know byte ranges")
        return data

    return int(size), read


def readable(file: BinaryFile) -> tuple[int, Read]:
    """The same of an open binary file, which must stay open."""
    lock = threading.Lock()
    try:
        file.seek(0, 2)  # which gives nothing where the file is an mmap
        size = file.tell()
    except (AttributeError, OSError, ValueError) as error:
        raise Error(f"an asset is opened from a path, a URL or an open file ({error})") from None

    def read(offset: int, count: int) -> bytes:
        with lock:
            file.seek(offset)
            data = file.read(count)
            # A file without a buffer may give less than there is.
            while data and len(data) < count and (more := file.read(count - len(data))):
                data += more
            return data

    return size, read
