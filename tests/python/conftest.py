"""Fixtures of all tests."""

from __future__ import annotations

import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest

from helpers.commands import COMMAND, DATA, Outcome, Umbel

# A shell that starts the tests in the background has them ignore Ctrl-C, and so what they start.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def umbel_command() -> Umbel:
    """Runs `umbel ARGUMENTS` in a process of its own."""

    def run(*arguments: object, **options: Any) -> Outcome:
        done = subprocess.run(
            [*COMMAND, *map(str, arguments)],
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
            **options,
        )
        return Outcome(done.returncode, done.stdout, done.stderr)

    return run


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of real meshes."""
    if not DATA.is_dir():
        pytest.skip(f"no meshes at {DATA}; set UMBEL_DATA")
    return DATA


def _saved_blob(folders: pytest.TempPathFactory, subdivisions: int) -> Path:
    import umbel

    path = folders.mktemp("meshes") / "blob.ply"
    umbel.save(path, umbel.shapes.blob(subdivisions))
    return path


@pytest.fixture(scope="session")
def blob_ply(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A closed mesh of 20,480 triangles in a file."""
    return _saved_blob(tmp_path_factory, 5)


@pytest.fixture(scope="session")
def small_ply(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One of 1,280 triangles."""
    return _saved_blob(tmp_path_factory, 3)


@pytest.fixture(scope="session")
def blob_asset(blob_ply: Path) -> Path:
    """The asset of that mesh."""
    import umbel

    path = blob_ply.with_suffix(".umbel")
    umbel.build_lod(blob_ply).save(path)
    return path
