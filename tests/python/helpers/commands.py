"""Where the repository and the real meshes are, and how the command line is run."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[3]
DATA = Path(os.environ.get("UMBEL_DATA") or ROOT.parent / "shared" / "data")
BUILD = ROOT / "build" / "release"
COMMAND = [sys.executable, "-m", "umbel"]


@dataclass
class Outcome:
    """How a command ended and what it said."""

    status: int
    out: str
    err: str

    @property
    def json(self) -> dict[str, Any]:
        return json.loads(self.out)


Umbel = Callable[..., Outcome]
