"""Real glTF scenes through assets and back: nothing of how they look is lost, Khronos's validator
finds no error in what is written, and pictures are the same."""

from __future__ import annotations

import math
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import umbel
from helpers.commands import DATA
from helpers.gltf_files import SCENES, TEXTURED, image_bytes, json_of, validator_errors
from umbel.io.gltf.materials import extensions_in
from umbel.trace.picture import auto_exposure, tone_map

pytestmark = [
    pytest.mark.skipif(not DATA.is_dir(), reason=f"no meshes at {DATA}"),
    pytest.mark.filterwarnings("ignore::umbel.LoadWarning"),
]
SIDE, SAMPLES = 80, 48
LEAST_DB = 40.0


def extracted(source: Path, folder: Path, instances: str) -> Path:
    """The finest level of the file's asset."""
    asset, out = folder / f"{instances}.umbel", folder / f"{instances}.glb"
    umbel.build_scene(source, instances=instances).save(asset)
    opened = umbel.Asset(asset)
    umbel.save(out, opened.scene_of(opened.scene_cuts(level=0)))
    return out


@pytest.mark.parametrize("name", SCENES)
def test_the_validator_finds_no_error(name: str, tmp_path: Path) -> None:
    source = DATA / name
    written = [extracted(source, tmp_path, "on"), extracted(source, tmp_path, "off")]
    for loaded, out in ((umbel.load, "mesh.glb"), (umbel.load_scene, "scene.gltf")):
        written.append(tmp_path / out)
        umbel.save(written[-1], loaded(source))
    assert validator_errors(*written) == []


def decibels(a: np.ndarray, b: np.ndarray) -> float:
    error = float(np.mean((a.astype(np.float64) - b) ** 2))
    return 10 * math.log10(255**2 / error) if error else 99.0


@pytest.mark.parametrize("name", TEXTURED)
def test_extracted_scenes_look_the_same(
    name: str, tmp_path: Path, record_property: pytest.RecordProperty
) -> None:
    source = DATA / "textured" / name
    renderer = umbel.Renderer(source)
    camera = renderer.camera("auto:35,15", SIDE, SIDE)
    pixels = renderer.film(camera, width=SIDE, height=SIDE).add(SAMPLES).pixels
    exposure = auto_exposure(pixels)
    for instances in ("on", "off"):
        again = umbel.Renderer(extracted(source, tmp_path, instances))
        got = again.film(camera, width=SIDE, height=SIDE).add(SAMPLES).pixels
        found = decibels(tone_map(pixels, exposure), tone_map(got, exposure))
        record_property(instances, found)
        assert found >= LEAST_DB, (instances, found)


@pytest.mark.parametrize("name", ["NormalTangentTest", "cat", "house"])
def test_obj_looks_the_same(name: str, tmp_path: Path) -> None:
    renderer = umbel.Renderer(DATA / "textured" / f"{name}.glb")
    camera = renderer.camera("auto:35,15", SIDE, SIDE)
    umbel.save(tmp_path / "a.obj", renderer.mesh)
    views = [
        one.film(camera, width=SIDE, height=SIDE).add(SAMPLES).pixels
        for one in (renderer, umbel.Renderer(tmp_path / "a.obj"))
    ]
    exposure = auto_exposure(views[0])
    assert decibels(*(tone_map(view, exposure) for view in views)) >= LEAST_DB


@pytest.mark.parametrize("name", TEXTURED)
def test_extracted_scenes_have_all_of_the_source(name: str, tmp_path: Path) -> None:
    source = DATA / "textured" / name
    out = extracted(source, tmp_path, "on")
    before, after = json_of(source), json_of(out)
    for key in ("copyright", "extras"):
        assert after["asset"].get(key) == before["asset"].get(key)
    assert after.get("extras") == before.get("extras")

    def names(root: dict, table: str) -> Counter:
        return Counter(entry.get("name", "") for entry in root.get(table, []))

    for table in ("materials", "nodes", "cameras", "skins"):
        assert not names(before, table) - names(after, table) - Counter([""])
    used = extensions_in(before["materials"]) | extensions_in(before.get("textures", []))
    assert used <= set(after.get("extensionsUsed", []))
    for mine, theirs in zip(after["materials"], before["materials"], strict=False):
        assert set(mine.get("extensions", {})) == set(theirs.get("extensions", {}))
    assert set(image_bytes(source)) <= set(image_bytes(out))


def test_the_same_scene_gives_the_same_bytes(tmp_path: Path) -> None:
    source = DATA / "textured" / "house.glb"
    files = []
    for threads in (1, 3):
        path = tmp_path / f"{threads}.umbel"
        umbel.build_scene(source, instances="on", threads=threads).save(path, threads=threads)
        files.append(path.read_bytes())
    assert files[0] == files[1]


def test_nothing_is_said_of_files_that_lose_nothing(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for name in ("Ingenuity", "NormalTangentTest", "ClearCoatTest", "jet-fighter"):
            extracted(DATA / "textured" / f"{name}.glb", tmp_path, "on")
