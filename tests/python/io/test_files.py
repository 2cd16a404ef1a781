"""A file that is being written is never seen half, and leaves nothing when it is interrupted."""

import os
import sys
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from umbel.io import files

OLD, NEW = b"old", b"new" * 1000


class Interrupt:
    """A trace function that raises KeyboardInterrupt at the nth line that runs."""

    def __init__(self, line: int) -> None:
        self.left = line

    def __call__(self, frame: FrameType, event: str, _: Any) -> Any:
        if event == "line":
            self.left -= 1
            if self.left == 0:
                raise KeyboardInterrupt
        return self


def test_an_interrupt_at_any_line_leaves_the_old_file_or_the_new_one(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    interrupted = 0
    for line in range(1, 1000):
        path.write_bytes(OLD)
        trace = Interrupt(line)
        before = sys.gettrace()
        sys.settrace(trace)
        try:
            files.write_all(path, [NEW[:10], NEW[10:]])
        except KeyboardInterrupt:
            interrupted += 1
        finally:
            sys.settrace(before)
        assert os.listdir(tmp_path) == ["a.bin"]
        assert path.read_bytes() in (OLD, NEW)
        if trace.left > 0:
            break
    assert interrupted > 10
    assert path.read_bytes() == NEW


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(files.Error, match=r"cannot write .*nowhere"):
        files.write_all(tmp_path / "nowhere" / "a.bin", [NEW])
    assert os.listdir(tmp_path) == []


def test_a_new_file_has_the_usual_permissions(tmp_path: Path) -> None:
    (tmp_path / "usual").write_bytes(b"")
    files.write_all(tmp_path / "a.bin", [NEW])
    assert (tmp_path / "a.bin").stat().st_mode == (tmp_path / "usual").stat().st_mode
