"""The drawings of the documentation are those that scripts/figures.py makes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from helpers.commands import ROOT


def test_drawings_are_what_the_script_makes(tmp_path: Path) -> None:
    command = [sys.executable, ROOT / "scripts" / "figures.py", "-o", tmp_path]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    made = {path.name: path.read_text("utf-8") for path in tmp_path.iterdir()}
    kept = {path.name for path in (ROOT / "docs" / "images").glob("*.svg")}
    assert kept == made.keys()
    for name, text in made.items():
        assert text == (ROOT / "docs" / "images" / name).read_text("utf-8"), (
            f"{name} differs: run scripts/figures.py"
        )
