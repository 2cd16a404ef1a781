"""Two hundred broken files of each format: an error or a warning, never silence where it can be
known, never a crash, within five seconds and a gigabyte each."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import umbel
from helpers import read_broken
from helpers.broken_files import SOURCES, Damage, damaged
from umbel.io import load

COUNT = 200
READER = Path(read_broken.__file__)


def broken(folder: Path, kind: str) -> dict[str, Damage]:
    """Broken files in a folder, by their paths."""
    rng = np.random.default_rng(sum(kind.encode()))
    sources = {name: make(folder) for name, make in SOURCES[kind].items()}
    made = {}
    for k in range(COUNT):
        name = list(sources)[k % len(sources)]
        damage = damaged(name, sources[name], rng)
        path = folder / f"{k:03}-{name}"
        path.write_bytes(damage.data)
        made[str(path)] = damage
    return made


def outcomes(paths: list[str], warm: Path) -> dict[str, tuple[str, str]]:
    """What a process of limited means says of each file; "killed" is a crash or too long."""
    found: dict[str, tuple[str, str]] = {}
    left = list(paths)
    while left:
        done = subprocess.run(
            [sys.executable, str(READER), str(warm)],
            input="\n".join(left),
            capture_output=True,
            text=True,
            env={**os.environ, "PYTHONPATH": str(Path(umbel.__file__).parents[1])},
            check=False,
        )
        path = ""
        for line in done.stdout.splitlines():
            answer = json.loads(line)
            path = answer.get("path", path)
            if "outcome" in answer:
                found[path] = (answer["outcome"], answer["sentence"])
        if done.returncode != 0:
            assert path, done.stderr
            found[path] = ("killed", f"exit status {done.returncode}: {done.stderr[-300:]}")
        left = [p for p in left if p not in found]
    return found


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs limits of Linux")
@pytest.mark.parametrize("kind", sorted(SOURCES))
def test_broken_files_are_noticed(tmp_path: Path, kind: str) -> None:
    if kind == "glb":
        pytest.importorskip("DracoPy")
    warm = tmp_path / f"whole.{kind}"
    make = next(iter(SOURCES[kind].values()))
    warm.write_bytes(make(tmp_path))
    files = broken(tmp_path, kind)
    found = outcomes(list(files), warm)
    bad = [
        f"{Path(path).name}, {damage.what}: {found[path]}"
        for path, damage in files.items()
        if found[path][0] not in ("error", "warning", *(() if damage.certain else ("silence",)))
    ]
    counts = Counter(said for said, _ in found.values())
    print(f"{kind}: {dict(counts)}, {sum(d.certain for d in files.values())} must be noticed")
    assert not bad, "\n".join(bad)


@pytest.mark.parametrize("kind", sorted(SOURCES))
def test_whole_files_are_read_without_a_word(
    tmp_path: Path, kind: str, recwarn: pytest.WarningsRecorder
) -> None:
    for name, make in SOURCES[kind].items():
        (tmp_path / name).write_bytes(make(tmp_path))
        umbel.validate(load(tmp_path / name))
    assert not [str(w.message) for w in recwarn]
