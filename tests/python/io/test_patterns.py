"""Which files a pattern stands for: those of glob, also where links go round."""

from __future__ import annotations

import errno
import glob
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

import umbel
from umbel.io.patterns import matches


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("a/1.ply", "a/b/2.ply", "a/b/c/3.obj", "a/.d/4.ply", "a[1]/b/5.ply", "6.ply"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(b"")
    (tmp_path / "a/link").symlink_to("../a[1]")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "pattern",
    [
        *(
            "**/*",
            "**/*.ply",
            "a/**/*.ply",
            "./a/**/*.ply",
            "*/b/**/*",
            "a/**/b/**/*.ply",
            "a*/*/*",
        ),
        *("a[[]1]/**/*", "**/b/*.ply", "a/**.ply", "none/**/*", "a/1.ply/**/*", "*"),
    ],
)
def test_files_are_those_of_glob(tree: Path, pattern: str) -> None:
    assert matches(pattern) == sorted(set(glob.glob(pattern, recursive=True)))
    absolute = os.path.join(glob.escape(str(tree)), pattern)
    assert matches(absolute) == sorted(set(glob.glob(absolute, recursive=True)))


def test_links_that_go_round_are_not_followed(tree: Path) -> None:
    before = matches("**/*.ply")
    (tree / "a/b/up").symlink_to("..")
    (tree / "a/self").symlink_to(".")
    (tree / "a/b/c/top").symlink_to(tree)
    (tree / "a/round").symlink_to("round")
    assert matches("**/*.ply") == before
    assert matches("a/b/**/*.ply") == ["a/b/2.ply"]  # where they lead out of the pattern's folder
    assert matches("a/b/up/*.ply") == ["a/b/up/1.ply"]


def test_folders_that_cannot_be_read_are_named(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scandir = os.scandir

    # Not by the folder's mode, which does not keep root out.
    def refuses(path: str) -> Iterator[os.DirEntry[str]]:
        if os.path.realpath(path) == str(tree / "a/b"):
            raise PermissionError(errno.EACCES, "Permission denied", path)
        return scandir(path)

    monkeypatch.setattr(os, "scandir", refuses)
    sentence = "a/b/: left out: this folder cannot be read: Permission denied"
    with pytest.warns(umbel.LoadWarning, match=sentence):
        assert matches("a/**/*.ply") == ["a/1.ply", "a/link/b/5.ply"]
