"""Every example runs, and the README's are among them."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import umbel
from helpers.commands import ROOT
from umbel.testing import giant
from umbel.viewer.server import PAGE

PYTHON_EXAMPLES = sorted((ROOT / "examples" / "python").glob("*.py"))
BUILD = ROOT / "build" / "release"


def _run(*command: object, folder: Path, **environment: str) -> str:
    done = subprocess.run(
        [str(part) for part in command],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=600,  # an example that waits for somebody
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture
def path_with_umbel(tmp_path: Path) -> str:
    """A PATH on which `umbel` is the package under test."""
    folder = tmp_path / "bin"
    folder.mkdir()
    command = folder / "umbel"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m umbel "$@"\n')
    command.chmod(0o755)
    return f"{folder}:{os.environ['PATH']}"


@pytest.mark.parametrize("example", PYTHON_EXAMPLES, ids=lambda path: path.stem)
def test_python_examples_run(example: Path, tmp_path: Path) -> None:
    assert _run(sys.executable, example, folder=tmp_path)


def test_the_city_is_built_once(tmp_path: Path) -> None:
    script = ROOT / "examples" / "city" / "city.py"
    options = ("--triangles", "30e3", "--tile-lots", "1", "--unit-triangles", "20000")
    command = (sys.executable, script, "city", *options, "--memory", "1GB")
    said = _run(*command, "--until", "asset", folder=tmp_path)
    assert re.search(r"^tiles: .*\"files\": 4", said, re.MULTILINE)
    city = tmp_path / "city"
    figures = json.loads((city / "figures.json").read_text())
    asset = umbel.Asset(city / "city.umbel")
    assert sum(m.images != {} for m in asset.materials) == 9 == len(asset.materials)
    assert len(asset.mesh(asset.cut(level=0)).triangles) == figures["tiles"]["triangles"]
    assert umbel.verify(city / "city.umbel")
    if PAGE.is_dir():
        assert "asset: done before" in _run(*command, "--until", "site", folder=tmp_path)
        assert (city / "site" / "index.html").is_file()
    assert "| asset |" in (city / "figures.md").read_text()


def test_python_examples_take_files(blob_ply: Path, tmp_path: Path) -> None:
    folder = ROOT / "examples" / "python"
    assert "clusters" in _run(sys.executable, folder / "1_clusters.py", blob_ply, folder=tmp_path)
    said = _run(
        *(sys.executable, folder / "2_levels_of_detail.py", blob_ply, "x.umbel"), folder=tmp_path
    )
    assert "verified: True" in said and (tmp_path / "x.umbel").is_file()
    alone = _run(sys.executable, folder / "2_levels_of_detail.py", blob_ply, folder=tmp_path)
    assert alone == said and (tmp_path / "mesh.umbel").is_file()
    assert "trimesh:" in _run(sys.executable, folder / "4_rays.py", blob_ply, folder=tmp_path)


def test_a_forest_of_few_trees_is_written_without_a_tree(tmp_path: Path) -> None:
    script = ROOT / "examples" / "python" / "7_forest.py"
    done = subprocess.run(
        [sys.executable, script, "20"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.stderr.startswith("the file lists so few trees")
    assert len(umbel.Asset(tmp_path / "forest.umbel").instances) == 21


def test_shell_example_runs(blob_ply: Path, tmp_path: Path, path_with_umbel: str) -> None:
    script = ROOT / "examples" / "shell" / "levels.sh"
    out = tmp_path / "out"
    _run("bash", script, blob_ply, out, folder=tmp_path, PATH=path_with_umbel)
    assert len(umbel.load(out / "blob_1000.glb").triangles) <= 1000
    assert len(list(out.iterdir())) == 4


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder into which the C++ library is installed."""
    if not (BUILD / "cmake_install.cmake").is_file() or shutil.which("cmake") is None:
        pytest.skip("the C++ library is not built in build/release")
    prefix = tmp_path_factory.mktemp("prefix")
    done = subprocess.run(
        ["cmake", "--install", BUILD, "--prefix", prefix, "--component", "library"],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        pytest.skip("the C++ library in build/release is not complete: make build")
    return prefix


def _cpp(source: Path, prefix: Path, build: Path) -> None:
    cache = (BUILD / "CMakeCache.txt").read_text()
    tbb = re.search(r"^TBB_DIR:\w+=(.+)$", cache, re.MULTILINE)
    _run(
        *("cmake", "-S", source, "-B", build, f"-DCMAKE_PREFIX_PATH={prefix}"),
        *([f"-DTBB_DIR={tbb[1]}"] if tbb else []),
        folder=build.parent,
    )
    _run("cmake", "--build", build, folder=build.parent)


def test_cpp_examples_run(installed: Path, tmp_path: Path) -> None:
    build = tmp_path / "build"
    _cpp(ROOT / "examples" / "cpp", installed, build)
    assert "clusters" in _run(build / "1_clusters", folder=tmp_path)
    assert ": ok" in _run(build / "2_levels_of_detail", folder=tmp_path)
    assert "nodes from the file" in _run(build / "3_rays", folder=tmp_path)
    assert ": ok" in _run(build / "4_larger_than_memory", folder=tmp_path)
    assert not (tmp_path / "terrain.umbel.work").exists()


def test_c_examples_run(installed: Path, tmp_path: Path) -> None:
    build = tmp_path / "build"
    _cpp(ROOT / "examples" / "c", installed, build)
    assert "clusters" in _run(build / "1_clusters", folder=tmp_path)
    picture = _run(build / "2_rays", folder=tmp_path)
    assert "a cut of at most 100 clusters" in _run(build / "3_cluster_structures", folder=tmp_path)
    assert picture.count("#") > 300 and picture.count(".") > 300


def _readme(language: str) -> str:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert blocks, f"README.md has no {language} example"
    return "\n".join(blocks)


def test_readme_python_runs(blob_ply: Path, tmp_path: Path) -> None:
    shutil.copy(blob_ply, tmp_path / "dragon.ply")
    (tmp_path / "readme.py").write_text(_readme("python"))
    _run(sys.executable, "readme.py", folder=tmp_path)
    assert (tmp_path / "dragon.umbel").is_file()


def test_readme_shell_runs(blob_ply: Path, tmp_path: Path, path_with_umbel: str) -> None:
    shutil.copy(blob_ply, tmp_path / "dragon.ply")
    (tmp_path / "models" / "trees").mkdir(parents=True)
    umbel.save(tmp_path / "models" / "trees" / "oak.glb", umbel.shapes.torus(12, 8))
    giant.write_tiles(giant.city(2000, seams=True), tmp_path / "tiles", ".glb", 1000)
    lines = [line for line in _readme("sh").splitlines() if line.startswith("umbel ")]
    assert len(lines) >= 4
    # The viewer serves until it is interrupted (see test_view.py).
    lines = [line for line in lines if not line.startswith("umbel view ")]
    _run("bash", "-ec", "\n".join(lines), folder=tmp_path, PATH=path_with_umbel)
    assert (tmp_path / "assets" / "trees" / "oak.umbel").is_file()
    assert (tmp_path / "city.png").is_file()


def test_readme_cpp_runs(installed: Path, tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.mkdir()
    (source / "main.cpp").write_text(_readme("cpp"))
    (source / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.24)\nproject(readme LANGUAGES CXX)\n" + _readme("cmake")
    )
    _cpp(source, installed, tmp_path / "build")
    assert _run(tmp_path / "build" / "app", folder=tmp_path)
    assert (tmp_path / "terrain.umbel").is_file()


def test_readme_c_runs(installed: Path, tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.mkdir()
    (source / "main.c").write_text(_readme("c"))
    (source / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.24)\nproject(readme LANGUAGES C CXX)\n"
        + _readme("cmake").replace("main.cpp", "main.c")
    )
    _cpp(source, installed, tmp_path / "build")
    assert _run(tmp_path / "build" / "app", folder=tmp_path) == "triangle 0 at t = 1.0\n"
