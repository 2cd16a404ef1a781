"""A lock for a work folder at an address, so that two builds do not work in one.

It is a file with its owner's name and a count that the owner raises every few seconds. Where the
count stands still, the owner is gone, and the next build takes the lock. Clocks are not compared.

No address can promise more than this: a driver that sleeps for longer is taken for dead. It ends
once it wakes up and finds another owner; until then both write the same bytes under the same names.
"""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import socket
import threading
import time
import uuid
from pathlib import Path
from typing import TYPE_CHECKING, Any

from umbel.errors import Error

if TYPE_CHECKING:
    from umbel.scale.storage import Folder

NAME = "lock"
#: Seconds between two beats, and after which an owner without any is gone.
_BEAT, _GONE = 5.0, 30.0
#: Seconds after which a lock that was written is looked at again: where the file system cannot make
#: a file only if there is none, the last of two writers has it.
_SETTLE = 0.5


class AddressLock:
    """Held until it is released, or its process ends. Throws where another build holds it."""

    def __init__(self, folder: Folder) -> None:
        self._folder = folder
        self._owner = secrets.token_hex(8)
        self._count = 0
        self._lost = ""
        self._end = threading.Event()
        self._wait_for_others()
        self._take()
        self._thread = threading.Thread(target=self._beat, name="umbel-lock", daemon=True)
        self._thread.start()

    def check(self) -> None:
        """Throws if another build has taken the lock."""
        if self._lost:
            raise Error(self._lost)

    def release(self) -> None:
        """Gives it up. What another build has made of it stays."""
        self._end.set()
        self._thread.join()
        with contextlib.suppress(Exception):  # it will be found to stand still
            if self._read().get("owner") == self._owner:
                self._folder.remove([NAME])

    def _wait_for_others(self) -> None:
        first = self._read()
        began = time.monotonic()
        while first and not _is_dead(first) and time.monotonic() - began < _GONE:
            time.sleep(min(1.0, _BEAT))
            now = self._read()
            if now and now != first:
                self._refuse(now)
            first = now
        if first:
            with contextlib.suppress(FileNotFoundError):
                self._folder.remove([NAME])

    def _take(self) -> None:
        try:
            self._folder.write(NAME, self._said(), only_new=True)
        except FileExistsError:
            self._refuse(self._read())
        time.sleep(_SETTLE)
        found = self._read()
        if found.get("owner") != self._owner:
            self._refuse(found)

    def _beat(self) -> None:
        while not self._end.wait(_BEAT):
            self._count += 1
            # Where the address cannot be reached for a while, the next beat may.
            with contextlib.suppress(Exception):
                found = self._read()
                if found.get("owner") != self._owner:
                    where = f", on {found['host']}" if "host" in found else ""
                    self._lost = f"another build has taken {self._folder.url}{where}"
                    return
                self._folder.write(NAME, self._said())

    def _said(self) -> bytes:
        said = {"owner": self._owner, "count": self._count, "host": socket.gethostname()}
        return json.dumps({**said, "machine": _machine(), "process": os.getpid()}).encode()

    def _read(self) -> dict[str, Any]:
        data = self._folder.read(NAME)
        if data is None:
            return {}
        try:
            found = json.loads(data)
        except ValueError:
            found = None
        return found if isinstance(found, dict) else {"owner": data.hex()}

    def _refuse(self, found: dict[str, Any]) -> None:
        where = f", on {found['host']}" if "host" in found else ""
        raise Error(f"another build is at work in {self._folder.url}{where}")


def _machine() -> str:
    """Of processes whose numbers can be compared."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        return f"{boot} {os.readlink('/proc/self/ns/pid')}"
    except OSError:
        return f"{socket.gethostname()} {uuid.getnode()}"


def _is_dead(found: dict[str, Any]) -> bool:
    """Whether it was a process of this machine, and is gone."""
    process = found.get("process")
    if found.get("machine") != _machine() or not isinstance(process, int) or process <= 0:
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    except OSError:
        pass
    return False
