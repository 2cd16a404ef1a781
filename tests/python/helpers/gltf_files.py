"""What is in a glTF file, and what Khronos's validator says of it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from helpers.commands import DATA, ROOT

UNTEXTURED = [
    "car_lamborghini.glb", "littlest_tokyo.glb", "CesiumMan.glb", "Fox.glb", "morph_stress.glb",
    "two_cylinder_engine.glb", "dragon_11k_res4.ply", "sponza_dabrovic_66k.obj",
    "statue_athena_uv_normals.ply", "smallpine.glb",
]  # fmt: skip
TEXTURED = sorted(path.name for path in (DATA / "textured").glob("*.glb"))
SCENES = [f"textured/{name}" for name in TEXTURED] + UNTEXTURED


def json_of(path: Path) -> dict[str, Any]:
    """The JSON of a .glb or .gltf file."""
    data = path.read_bytes()
    if data[:4] != b"glTF":
        return json.loads(data)
    size = int.from_bytes(data[12:16], "little")
    return json.loads(data[20 : 20 + size])


def binary_of(path: Path) -> bytes:
    """The binary chunk of a .glb file."""
    data = path.read_bytes()
    size = int.from_bytes(data[12:16], "little")
    return data[28 + size :]


def image_bytes(path: Path) -> list[bytes]:
    """The embedded images of a .glb file."""
    root, binary = json_of(path), binary_of(path)
    views = [root["bufferViews"][image["bufferView"]] for image in root.get("images", [])]
    return [binary[v.get("byteOffset", 0) :][: v["byteLength"]] for v in views]


def validator_errors(*paths: Path) -> list[str]:
    """What Khronos's glTF validator calls errors in the files. Skips the test without Node or
    without a network to install the validator from, except in CI."""
    if shutil.which("npm") is None and not os.environ.get("CI"):
        pytest.skip("no npm")
    command = [ROOT / "scripts" / "node.sh", "validate", "--", *(p.absolute() for p in paths)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    if done.returncode and not (ROOT / "viewer" / "node_modules" / "gltf-validator").is_dir():
        assert not os.environ.get("CI"), done.stderr
        pytest.skip("gltf-validator cannot be installed")
    assert done.returncode == 0, done.stderr
    if "{" not in done.stdout:
        pytest.skip(done.stdout)
    found = json.loads(done.stdout[done.stdout.index("{") :])
    return [f"{Path(name).name}: {e}" for name, one in found.items() for e in one["errors"]]
