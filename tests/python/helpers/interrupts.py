"""Ctrl-C while Python waits for the library."""

from __future__ import annotations

import contextlib
import signal
import threading
import time
from collections.abc import Iterator

import pytest


@contextlib.contextmanager
def interrupted(within: float) -> Iterator[None]:
    """Interrupts the block after a fifth of a second; it must end so, within so many seconds."""
    main = threading.main_thread().ident
    assert main is not None
    timer = threading.Timer(0.2, signal.pthread_kill, (main, signal.SIGINT))
    began = time.monotonic()
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        yield
    assert time.monotonic() - began < within
