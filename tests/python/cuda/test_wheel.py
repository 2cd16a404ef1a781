"""The wheel of the library for devices, with a library of the processor in it."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from helpers.cuda_packages import ON_PROCESSOR

ROOT = Path(__file__).resolve().parents[3]
SCRIPT = ROOT / "scripts" / "cuda_wheel.py"
USE = """
import numpy as np
from umbel import cuda
positions = np.random.default_rng(1).normal(size=(30, 3)).astype(np.float32)
clusters = cuda.FrameClusters(positions, np.arange(30, dtype=np.int32).reshape(10, 3))
print(cuda.library_path(), len(clusters.arrays["items"]))
"""


def test_the_package_finds_the_library_of_the_wheel(tmp_path: Path) -> None:
    if not ON_PROCESSOR.is_file():
        pytest.skip(f"there is no {ON_PROCESSOR}")
    made = subprocess.run(
        [sys.executable, SCRIPT, "--library", ON_PROCESSOR, "-o", tmp_path],
        capture_output=True,
        text=True,
        check=True,
    )
    wheel = Path(made.stdout.strip())
    assert wheel.name.startswith("umbel_cuda-") and wheel.suffix == ".whl"
    folder = tmp_path / "installed"
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*install, "--target", folder, wheel], check=True)
    environment = {k: v for k, v in os.environ.items() if k != "UMBEL_CUDA_LIBRARY"}
    paths = [str(folder), environment.get("PYTHONPATH", "")]
    environment["PYTHONPATH"] = os.pathsep.join(path for path in paths if path)
    used = subprocess.run(
        [sys.executable, "-c", USE], capture_output=True, text=True, check=True, env=environment
    )
    assert used.stdout.split() == [str(folder / "umbel_cuda" / "libumbel_cuda_c.so"), "10"]


def test_no_folder_of_the_building_machine_is_searched(tmp_path: Path) -> None:
    own = b"\0$ORIGIN/../../..:$ORIGIN/../../../../lib"
    library = tmp_path / "library.so"
    library.write_bytes(b"before" + own + b":/home/me/lib:/opt/lib\0behind")
    subprocess.run([sys.executable, SCRIPT, "--library", library, "-o", tmp_path], check=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        packed = archive.read("umbel_cuda/libumbel_cuda_c.so")
    assert packed == b"before" + own + bytes(len(":/home/me/lib:/opt/lib") + 1) + b"behind"


def test_without_a_library_it_says_how_to_build_one(tmp_path: Path) -> None:
    missing = [sys.executable, SCRIPT, "--library", tmp_path / "none.so"]
    done = subprocess.run(missing, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "make cuda" in done.stderr
