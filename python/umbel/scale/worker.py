"""A process that builds one unit. It ends with 0, or says one sentence and ends with 10 and the
number of the error's kind."""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path

import umbel

_CODES = ("invalid_argument", "invalid_mesh", "io", "corrupt", "unsupported", "cancelled", "device")
_IO, _UNSUPPORTED = _CODES.index("io"), _CODES.index("unsupported")


def python_command(code: str, *arguments: str) -> list[str]:
    """A process that runs code which imports this package. Nothing is imported from the folder that
    it runs in, where a types.py may lie."""
    root = str(Path(umbel.__file__).resolve().parent.parent)
    path = f"import sys; sys.path[:] = [{root!r}, *filter(None, sys.path)]"
    return [sys.executable, "-c", f"{path}; {code}", *arguments]


def main(arguments: list[str]) -> int:
    """Threads, work folder, tier, unit."""
    from umbel import _umbel
    from umbel.errors import Error
    from umbel.scale.memory import peak_rss_bytes

    threads, work, tier, unit = arguments
    try:
        _umbel.begin_worker()
        _umbel.run_task(work, 0, int(tier), int(unit), 0, int(threads))
        with contextlib.suppress(OSError):  # a full disk may have no room for it
            peak = Path(work, f"t{tier}", "unit", f"u{int(unit):06d}.peak")
            peak.write_text(str(peak_rss_bytes()))
        return 0
    except Error as error:
        code = _CODES.index(error.code) if error.code in _CODES else _UNSUPPORTED
        said = str(error)
    except MemoryError:
        code = _IO
        said = (
            f"unit {unit} of tier {tier} needs more memory than there is: give more, and go on "
            "with resume"
        )
    with contextlib.suppress(OSError):  # there may be no room for this either
        os.write(2, said.encode("utf-8", "backslashreplace"))
    return 10 + code
