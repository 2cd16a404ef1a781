"""A file that is being written is never seen half, and leaves nothing when it is interrupted."""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

import umbel
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


def write_two(folder: Path) -> None:
    with files.replacing_together() as opened:
        for name in ("a.bin", "b.bin"):
            with opened(folder / name) as file:
                file.write(NEW)


def write_one(folder: Path) -> None:
    files.write_all(folder / "a.bin", [NEW[:10], NEW[10:]])


@pytest.mark.parametrize(
    ("names", "write"), [(["a.bin"], write_one), (["a.bin", "b.bin"], write_two)]
)
def test_an_interrupt_at_any_line_leaves_the_old_files_or_the_new_ones(
    tmp_path: Path, names: list[str], write: Callable[[Path], None]
) -> None:
    interrupted = 0
    for line in range(1, 1000):
        for name in names:
            (tmp_path / name).write_bytes(OLD)
        trace = Interrupt(line)
        before = sys.gettrace()
        sys.settrace(trace)
        try:
            write(tmp_path)
        except KeyboardInterrupt:
            interrupted += 1
        finally:
            sys.settrace(before)
        assert sorted(os.listdir(tmp_path)) == names
        left = {(tmp_path / name).read_bytes() for name in names}
        assert left in ({OLD}, {NEW})
        if trace.left > 0:
            break
    assert interrupted > 10
    assert left == {NEW}


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(files.Error, match=r"cannot write .*nowhere"):
        files.write_all(tmp_path / "nowhere" / "a.bin", [NEW])
    assert os.listdir(tmp_path) == []


def test_a_folder_is_no_file_to_replace(tmp_path: Path) -> None:
    (tmp_path / "b.bin").mkdir()
    with pytest.raises(files.Error, match=r"cannot write .*b.bin: Is a directory"):
        write_two(tmp_path)
    assert os.listdir(tmp_path) == ["b.bin"]


def test_a_new_file_has_the_usual_permissions(tmp_path: Path) -> None:
    (tmp_path / "usual").write_bytes(b"")
    files.write_all(tmp_path / "a.bin", [NEW])
    assert (tmp_path / "a.bin").stat().st_mode == (tmp_path / "usual").stat().st_mode


@pytest.mark.parametrize("name", ["n" * 251 + ".bin", "\u00e9" * 125 + ".bin"])
def test_names_may_be_as_long_as_the_system_allows(tmp_path: Path, name: str) -> None:
    files.write_all(tmp_path / name, [NEW])
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_bytes() == NEW


def test_a_link_stays_one(tmp_path: Path) -> None:
    real, link = tmp_path / "real.bin", tmp_path / "link.bin"
    link.symlink_to(real)
    for old in (None, OLD):
        if old:
            real.write_bytes(old)
        files.write_all(link, [NEW])
        assert link.is_symlink() and real.read_bytes() == NEW


def test_a_pipe_is_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.bin"
    os.mkfifo(pipe)
    with pytest.raises(umbel.Error, match=r"pipe\.bin is not a regular file"):
        files.write_all(pipe, [NEW])
    assert pipe.is_fifo()
