"""The comparison of builders on a device, with a stand-in for the program that measures."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest

import umbel
from helpers.commands import BUILD, Outcome
from umbel.bench import charts
from umbel.bench.bvh import cuda as bvh_cuda

STAND_IN = """#!{python}
import json, struct, sys
if {fails}:
    print("cuda_bvh_bench: CUDA finds no device", file=sys.stderr)
    sys.exit(3)
names, scenes = [], []
arguments = iter(sys.argv[1:])
for argument in arguments:
    if argument == "--runs":
        runs = int(next(arguments))
    elif argument == "--builder":
        names.append(next(arguments))
    else:
        head = open(argument, "rb").read().split(b"end_header")[0].decode()
        assert "binary_little_endian" in head
        head = head.replace("uint8", "uchar").replace("int32", "int")
        assert "uchar int" in head
        count = int(head.split("element face ")[1].split()[0])
        builders = [
            {{"builder": name, "sah": 10.0 * k, "nodes": 100, "scratch_bytes": 1000,
             "stages": {{"boxes": 0.5, "tree": 1.5 * k}}, "refit_ms": 0.25,
             "primary_ms": 1.0 * k, "bounce_ms": 3.0 * k}}
            for k, name in enumerate(names or ["sweep", "lbvh"], 1)
        ]
        scenes.append({{"scene": argument.split("/")[-1][:-4], "triangles": count,
                       "primary_rays": 8000, "bounce_rays": 6000, "builders": builders}})
print(json.dumps({{"device": "Stand-in", "runs": runs, "scenes": scenes}}))
"""


@pytest.fixture
def program(monkeypatch, tmp_path):
    def make(fails=False):
        path = tmp_path / "program"
        path.write_text(STAND_IN.format(python=sys.executable, fails=fails))
        path.chmod(0o755)
        monkeypatch.setenv("UMBEL_CUDA_BVH_BENCH", str(path))

    make()
    return make


@pytest.fixture
def mesh_file(tmp_path):
    path = tmp_path / "ball.obj"
    umbel.save(path, umbel.shapes.sphere(2))
    return path


@pytest.fixture
def run(capsys):
    """Runs `umbel bench bvh --device ARGUMENTS` in this process."""
    from umbel.cli.app import app

    def bench(*arguments):
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            app(["bench", "bvh", "--device", *map(str, arguments)], prog_name="umbel")
        out, err = capsys.readouterr()
        return Outcome(int(ended.value.code or 0), out, err)

    return bench


def test_tables_and_charts_are_written(run, program, mesh_file, tmp_path):
    folder = tmp_path / "out"
    result = run("cuda", mesh_file, "-o", folder, "--runs", 4)
    assert result.status == 0, result.err
    text = (folder / "bvh_cuda.md").read_text()
    assert "# Builders of hierarchies on Stand-in" in text
    assert "320 triangles" in text
    assert "Medians of 4 runs" in text
    assert (folder / "bvh_cuda.csv").is_file()
    assert (folder / "bvh_cuda_ball.png").is_file() == charts.available()


def test_ratios_are_to_the_sweep_without_its_build(run, program, mesh_file):
    result = run("cuda", mesh_file, "--json")
    assert result.status == 0, result.err
    sweep, lbvh = result.json["builders"]
    assert sweep["speed_ratio"] == 1
    assert lbvh["speed_ratio"] == 0.5
    assert lbvh["sah_ratio"] == 2
    assert lbvh["build_ms"] == 3.5
    assert np.isclose(lbvh["lq_ratio"], (3.5 + 8 * 8) / (8 * 4))
    assert np.isclose(sweep["hq_ratio"], (2 + 128 * 4) / (128 * 4))
    assert np.isclose(lbvh["mtriangles_per_second"], 320 / 3.5 / 1e3)
    assert np.isclose(lbvh["bounce_mrays"], 1.0)


def test_builders_are_passed_on_and_the_sweep_is_always_there(run, program, mesh_file):
    result = run("cuda", mesh_file, "--builder", "hploc", "--builder", "sweep", "--json")
    names = [row["builder"] for row in result.json["builders"]]
    assert names == ["hploc", "sweep"]


def test_scenes_without_a_sweep_have_no_ratios():
    scene = {
        "scene": "large",
        "triangles": 1000,
        "primary_rays": 1,
        "bounce_rays": 1,
        "builders": [
            {
                "builder": "lbvh",
                "sah": 3.0,
                "nodes": 1,
                "scratch_bytes": 1,
                "stages": {"tree": 1.0},
                "refit_ms": 1.0,
                "primary_ms": 1.0,
                "bounce_ms": 1.0,
            }
        ],
    }
    found = bvh_cuda.compared(json.dumps({"device": "X", "runs": 1, "scenes": [scene]}))
    assert found.rows[0]["hq_ratio"] is None
    assert "large" in bvh_cuda.report(found)


def test_without_a_device_it_says_so(run, program, mesh_file, monkeypatch, tmp_path):
    program(fails=True)
    result = run("cuda", mesh_file)
    assert result.status != 0
    assert "CUDA finds no device" in result.err
    monkeypatch.setenv("UMBEL_CUDA_BVH_BENCH", str(tmp_path / "none"))
    result = run("cuda", mesh_file)
    assert result.status != 0
    assert "needs the program cuda_bvh_bench" in result.err
    assert "--device is 'gpu'" in run("gpu", mesh_file).err


def test_the_same_code_is_compared_on_the_processor(run, monkeypatch, mesh_file, tmp_path):
    program = BUILD / "bench" / "device_bvh_bench"
    if not program.is_file():
        pytest.skip(f"{program.name} is not built")
    monkeypatch.setenv("UMBEL_CUDA_BVH_BENCH", str(program))
    folder = tmp_path / "out"
    builders = ("--builder", "lbvh", "--builder", "kmeans-q1")
    result = run("cuda", mesh_file, "--runs", 1, "-o", folder, *builders)
    assert result.status == 0, result.err
    text = (folder / "bvh_cuda.md").read_text()
    assert "# Builders of hierarchies on one core of the processor" in text
    rows = [line.split("|")[1].strip() for line in text.splitlines() if line.startswith("| ")]
    assert {"lbvh", "kmeans-q1", "sweep"} <= set(rows)
    assert "| builder | boxes | codes | clusters | tree |" in text  # stages
