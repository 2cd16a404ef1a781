"""What `make gpu` does where programs fail or do not end: it goes on, and says so. The GPU and the
programs are stand-ins."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

import umbel

ROOT = Path(__file__).resolve().parents[2]
PATHS = ROOT / "build/release/bench/device_paths_bench"
SMI = """
case "$*" in
  -L) echo "GPU 0: Stand-in 9" ;;
  *name*) echo "Stand-in 9" ;;
  *) echo 9.0 ;;
esac
"""


def put_program(path: Path, body: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/usr/bin/env bash\n{body}\n")
    path.chmod(0o755)


@pytest.fixture
def machine(tmp_path: Path):
    """Runs the script with a GPU and programs that work, but for some; returns what it said."""
    names = ("cuda_bench", "cuda_query_bench", "cuda_frame_example", "cuda_bvh_bench")
    programs = {"umbel_cuda_tests": "echo tested"} | {name: f"echo '# {name}'" for name in names}

    def run(
        mode: str, packed: bool = False, settings: dict[str, str] | None = None, **changed: str
    ) -> tuple[int, str, Path]:
        carry, out = tmp_path / "carry", tmp_path / "out"
        out.mkdir(exist_ok=True)
        for name, body in (programs | changed).items():
            put_program(carry / "bin" / name, body)
        if packed:
            with tarfile.open(carry / "carried.tar.gz", "w:gz") as archive:
                archive.add(carry / "bin", "bin")
            shutil.rmtree(carry / "bin")
        put_program(tmp_path / "path" / "nvidia-smi", SMI)
        environment = {
            **os.environ,
            "PATH": f"{tmp_path / 'path'}:{os.environ['PATH']}",
            "OUT": str(out),
            "UMBEL_GPU_CARRY": str(carry),
            "UMBEL_GPU_RESULTS": str(tmp_path / "results"),
            "UMBEL_GPU_LOGS": str(tmp_path / "logs"),
            "UMBEL_GPU_SECONDS": "9",
            "PYTHON": sys.executable,
            **(settings or {}),
        }
        done = subprocess.run(
            [ROOT / "scripts" / "gpu.sh", mode],
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=600,
        )
        with tarfile.open(out / "gpu-results.tar.gz") as archive:
            assert any(
                name.endswith("tests.log") or mode != "measure" for name in archive.getnames()
            )
        page = {"measure": "", "check": "-checks", "paths": "-paths-steps"}[mode]
        page = f"gpu-stand-in-9{page}.md"
        return done.returncode, (tmp_path / "results" / page).read_text(), out

    return run


def outcomes(page: str) -> dict[str, str]:
    rows = [line.split("|") for line in page.splitlines() if line.startswith("| ")]
    return {row[1].strip(): row[2].strip() for row in rows[1:]}


def test_all_steps_are_done_and_figures_are_kept(machine) -> None:
    status, page, _ = machine("measure")
    assert status == 0
    found = outcomes(page)
    for step in ("smallest-tests", "tests", "clusters", "rays-and-selection", "frame"):
        assert found[step] == "passed"
    assert found["hierarchies"].startswith("skipped")  # there are no meshes
    assert "# cuda_bench" in page and "# cuda_query_bench" in page


def test_what_fails_or_does_not_end_stops_nothing_else(machine) -> None:
    status, page, _ = machine("measure", umbel_cuda_tests="exit 3", cuda_bench="sleep 60")
    assert status == 1
    found = outcomes(page)
    assert found["smallest-tests"] == found["tests"] == "failed (3)"
    assert found["clusters"] == "out of time"
    assert found["frame"].startswith("skipped: no time")
    assert "cuda_query_bench" not in page


@pytest.mark.parametrize(
    "said",
    [
        "device_arrays.cuh:32: Skipped\nthere is no CUDA device here",
        "# Clusters without a CUDA device",
    ],
)
def test_tests_that_skip_for_want_of_a_device_do_not_pass(machine, said: str) -> None:
    status, page, _ = machine("measure", umbel_cuda_tests=f"echo '{said}'")
    assert status == 1
    assert outcomes(page)["tests"] == "failed: CUDA finds no device that it can use"
    assert outcomes(page)["clusters"] == "passed"


def test_a_crash_is_told_from_time_that_ran_out(machine) -> None:
    status, page, _ = machine("measure", cuda_bench="kill -SEGV $$")
    assert status == 1
    assert outcomes(page)["clusters"] == "failed (139)"
    assert outcomes(page)["frame"] == "passed"


def test_carried_programs_are_unpacked(machine) -> None:
    status, page, _ = machine("measure", packed=True)
    assert status == 0
    assert outcomes(page)["tests"] == "passed"


@pytest.fixture
def scenes(tmp_path: Path) -> Path:
    """Two scenes, as they are carried."""
    umbel.save(tmp_path / "ball.ply", umbel.shapes.blob(3))
    folder = tmp_path / "carry" / "scenes"
    subprocess.run(
        [sys.executable, "-B", ROOT / "bench/device_scenes.py", folder, "--plant", "20000",
         tmp_path / "ball.ply"],
        check=True,
    )  # fmt: skip
    return folder


SMALL = {
    "UMBEL_GPU_SECONDS": "500",
    "UMBEL_GPU_LEAST": "5",
    "UMBEL_GPU_PATHS": "--size 32,32 --samples 2 --pass 1 --runs 1 "
    "--builder sweep --builder lbvh --builder hploc --builder kmeans",
}


@pytest.mark.skipif(not PATHS.is_file(), reason=f"{PATHS.name} is not built")
def test_pictures_are_traced_scene_by_scene(machine, scenes: Path, tmp_path: Path) -> None:
    # A scene fails; the others are traced all the same.
    only_ball = f'[[ "$*" == *ball* ]] || exit 4; exec {PATHS} "$@"'
    status, page, out = machine("paths", settings=SMALL, cuda_paths_bench=only_ball)
    assert status == 1
    assert outcomes(page) == {"paths-ball": "passed", "paths-plant": "failed (1)"}
    # The next call traces what is missing alone.
    program = f'exec {PATHS} "$@"'
    status, page, out = machine("paths", settings=SMALL, cuda_paths_bench=program)
    assert status == 0
    assert outcomes(page) == {"paths-plant": "passed"}
    results = (tmp_path / "results/gpu-stand-in-9-paths.md").read_text()
    assert "| builder | ball | plant | mean |" in results
    with tarfile.open(out / "gpu-results.tar.gz") as archive:
        names = {Path(name).name for name in archive.getnames()}
    assert {"ball.json", "plant.json", "gpu-stand-in-9-paths.md"} <= names
    # There is nothing left to do, but what is asked for is done again.
    status, page, _ = machine("paths", settings=SMALL, cuda_paths_bench=program)
    assert status == 0 and outcomes(page) == {}


def test_no_scene_begins_without_time(machine, scenes: Path) -> None:
    settings = {**SMALL, "UMBEL_GPU_LEAST": "5000"}
    status, page, _ = machine("paths", settings=settings, cuda_paths_bench="exit 0")
    assert status == 1
    assert outcomes(page) == dict.fromkeys(("paths-ball", "paths-plant"), "skipped: call again")


def test_tables_need_nothing_but_python(tmp_path: Path) -> None:
    builders = ", ".join(
        f'{{"builder": "{name}", "sah": 10, "nodes": 9, "scratch_bytes": 1, "refit_ms": 1, '
        '"primary_ms": 1, "bounce_ms": 1, "stages": {"tree": 1}}'
        for name in ("lbvh", "sweep")
    )
    (tmp_path / "measured.json").write_text(
        '{"device": "Stand-in", "runs": 1, "scenes": [{"scene": "ball", "triangles": 9, '
        f'"primary_rays": 5, "bounce_rays": 5, "builders": [{builders}]}}]}}'
    )
    hidden = "import sys; sys.modules.update({'umbel._umbel': None, 'numpy': None}); import runpy; "
    module = "runpy.run_module('umbel.bench.bvh.cuda', run_name='__main__')"
    done = subprocess.run(
        [sys.executable, "-S", "-c", hidden + module, "measured.json", ".", "table"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT / "python")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "## ball" in (tmp_path / "table.md").read_text()


def test_without_a_gpu_it_says_so() -> None:
    done = subprocess.run(
        [ROOT / "scripts" / "gpu.sh"], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 1
    assert "there is no NVIDIA GPU here" in done.stderr
