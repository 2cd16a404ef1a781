"""`umbel build` of many files: what is built, skipped and named, and that nothing is left half."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import umbel
from helpers.commands import COMMAND, Outcome, Umbel
from umbel.cli.building import pool
from umbel.cli.building.build_file import is_whole
from umbel.io.textures.images import TextureImage
from umbel.lod.metadata import stored

SUFFIXES = (".obj", ".ply", ".glb")


def _broken(path: Path, kind: str, mesh: umbel.Mesh) -> None:
    """A file that no asset can be made of."""
    if kind == "nan":
        mesh.positions = mesh.positions.copy()
        mesh.positions[3] = np.nan
    if kind == "range":
        mesh.triangles = mesh.triangles.copy()
        mesh.triangles[2, 1] = len(mesh.positions) + 7
    umbel.save(path, mesh)
    if kind == "truncated":
        data = path.read_bytes()
        path.write_bytes(data[: len(data) * 2 // 3])
    if kind in ("empty", "text"):
        path.write_bytes(b"" if kind == "empty" else b"hello world\nthis is no mesh\n")


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sixty small files in folders, ten of them broken."""
    folder = tmp_path_factory.mktemp("models")
    rng = random.Random(7)
    kinds = ["truncated", "text", "empty", "nan", "range"] * 2
    for k in range(60):
        mesh = umbel.shapes.torus(8 + k % 5, 6)
        mesh.positions = mesh.positions * np.float32(rng.uniform(1, 2))
        place = folder / f"part{k % 3}" / ("deep/er" if k % 4 == 0 else "")
        place.mkdir(parents=True, exist_ok=True)
        if k % 6 == 5:
            kind = kinds.pop()
            _broken(place / f"bad_{kind}_{k:02}.ply", kind, mesh)
        else:
            umbel.save(place / f"mesh_{k:02}{SUFFIXES[k % 3]}", mesh)
    return folder


def _lines(done: Outcome) -> list[dict[str, Any]]:
    return [json.loads(line) for line in done.out.splitlines()]


def _files(folder: Path) -> list[str]:
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())


def test_a_pattern_is_built_and_broken_files_are_named(
    umbel_command: Umbel, models: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    pattern = models / "**" / "*.*"
    done = umbel_command("build", pattern, "-o", out, "--jobs", 2, "--keep-going", "--json")
    assert done.status == 1
    lines = _lines(done)
    sources = {str(models / name) for name in _files(models)}
    assert len(lines) == 60 and {line["input"] for line in lines} == sources
    for line in lines:
        output = out / Path(line["input"]).relative_to(models).with_suffix(".umbel")
        assert line["output"] == str(output)
        broken = "bad_" in line["input"]
        assert line["status"] == ("failed" if broken else "built")
        assert output.exists() != broken
        if broken:
            assert line["input"] in line["error"] and line["error"] in done.err
            wanted = "--drop-invalid" if "nan" in line["input"] or "range" in line["input"] else ""
            assert wanted in line["error"] and "=True" not in line["error"]
        else:
            assert line["stored_triangles"] > 0 and umbel.verify(output, 4).ok
    assert len(_files(out)) == 50  # and no temporary file is left
    assert "built 50 files" in done.err and "failed 10 files" in done.err


def test_bytes_do_not_depend_on_how_many_are_built_at_once(
    umbel_command: Umbel, models: Path, tmp_path: Path
) -> None:
    good = sorted(models.rglob("mesh_*"))[:6]
    one, two, alone = tmp_path / "one", tmp_path / "two", tmp_path / "alone.umbel"
    assert umbel_command("build", *good, "-o", one).status == 0
    assert umbel_command("build", *good, "-o", two, "--jobs", 3).status == 0
    assert _files(one) == _files(two) and len(_files(one)) == 6
    for name in _files(one):
        assert (one / name).read_bytes() == (two / name).read_bytes()
    assert umbel_command("build", good[0], "-o", alone).status == 0
    twin = next(p for p in one.rglob("*.umbel") if p.stem == good[0].stem)
    assert alone.read_bytes() == twin.read_bytes()


def test_without_keep_going_the_first_failure_ends_it(
    umbel_command: Umbel, models: Path, tmp_path: Path
) -> None:
    done = umbel_command("build", models, "-o", tmp_path / "out", "--json")
    assert done.status == 1
    lines = _lines(done)
    assert [line["status"] for line in lines].count("failed") == 1
    assert lines[-1]["status"] == "failed" and len(lines) < 60
    assert "not finished" in done.err
    assert set(_files(tmp_path / "out")) == {
        os.path.relpath(line["output"], tmp_path / "out") for line in lines[:-1]
    }


def test_people_get_a_line_a_failure_and_a_summary(
    umbel_command: Umbel, models: Path, tmp_path: Path
) -> None:
    done = umbel_command("build", models, "-o", tmp_path / "out", "--keep-going")
    assert done.status == 1
    assert len(done.err.splitlines()) == 10 and done.err.count("umbel: ") == 10
    assert "50 files" in done.out and "10 files: " in done.out and "Traceback" not in done.err


def test_unchanged_files_are_left_alone(umbel_command: Umbel, tmp_path: Path) -> None:
    source = tmp_path / "in"
    source.mkdir()
    for k in range(4):
        umbel.save(source / f"{k}.obj", umbel.shapes.torus(6 + k, 5))
    (source / "0.obj").write_bytes(b"mtllib 0.mtl\n" + (source / "0.obj").read_bytes())
    (source / "0.mtl").write_bytes(b"newmtl a\nKd 1 0 0\n")
    out = tmp_path / "out"

    def statuses(*flags: object) -> list[str]:
        done = umbel_command("build", source, "-o", out, "--skip-unchanged", "--json", *flags)
        assert done.status == 0, done.err
        return [line["status"] for line in _lines(done)]

    assert statuses() == ["built"] * 4
    times = [os.stat(out / f"{k}.umbel").st_mtime_ns for k in range(4)]
    assert statuses() == ["unchanged"] * 4
    assert times == [os.stat(out / f"{k}.umbel").st_mtime_ns for k in range(4)]
    (source / "0.mtl").write_bytes(b"newmtl a\nKd 0 1 0\n")  # a file that another refers to
    assert statuses() == ["built", "unchanged", "unchanged", "unchanged"]
    umbel.save(source / "2.obj", umbel.shapes.torus(9, 5))
    assert statuses() == ["unchanged", "unchanged", "built", "unchanged"]
    asset = out / "3.umbel"
    asset.write_bytes(asset.read_bytes()[:-1])  # cut short
    assert statuses() == ["unchanged", "unchanged", "unchanged", "built"]
    whole = asset.read_bytes()
    asset.write_bytes(whole[:-9] + bytes([whole[-9] ^ 1]) + whole[-8:])  # damaged
    assert statuses() == ["unchanged", "unchanged", "unchanged", "built"]
    assert asset.read_bytes() == whole
    assert statuses("--max-triangles", 64) == ["built"] * 4
    assert statuses("--max-triangles", 64) == ["unchanged"] * 4
    assert statuses("--precision", "12bits") == ["built"] * 4
    one = umbel_command("build", source / "1.obj", "-o", asset, "--skip-unchanged", "--json").json
    assert one["status"] == "built"  # of another file
    one = umbel_command("build", source / "1.obj", "-o", asset, "--skip-unchanged", "--json").json
    assert one["status"] == "unchanged"


def test_an_asset_with_any_damage_is_not_whole(tmp_path: Path) -> None:
    """In tables, pages, the hierarchy and images."""
    mesh = umbel.shapes.torus(9, 5)
    image = TextureImage(data=b"\x89PNG\r\n\x1a\n" + bytes(range(256)))
    mesh.materials = [umbel.Material(images={"base_color": image})]
    umbel.build_lod(mesh).save(tmp_path / "a.umbel")
    whole = (tmp_path / "a.umbel").read_bytes()
    damaged = tmp_path / "b.umbel"
    for at in range(0, len(whole), 7):
        damaged.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        assert not is_whole(damaged), at
    damaged.write_bytes(whole)
    assert is_whole(damaged)


def test_metadata_hold_no_folder_and_no_time(umbel_command: Umbel, tmp_path: Path) -> None:
    made = []
    for name in ("a", "b"):
        folder = tmp_path / name
        folder.mkdir()
        umbel.save(folder / "mesh.ply", umbel.shapes.torus(8, 6))
        assert umbel_command("build", folder, "-o", folder / "out").status == 0
        made.append((folder / "out" / "mesh.umbel").read_bytes())
        time.sleep(0.01)
    assert made[0] == made[1] and str(tmp_path).encode() not in made[0]


def test_what_cannot_be_meant_is_refused_before_any_work(
    umbel_command: Umbel, models: Path, tmp_path: Path
) -> None:
    twins = tmp_path / "twins"
    twins.mkdir()
    for suffix in (".obj", ".ply"):
        umbel.save(twins / f"same{suffix}", umbel.shapes.sphere(1))
    (tmp_path / "file").write_bytes(b"")
    (tmp_path / "nothing").mkdir()
    good = sorted(models.rglob("mesh_*"))[:2]
    for arguments, words in (
        ([twins, "-o", tmp_path / "out"], ("same.obj", "same.ply", "same.umbel")),
        ([*good, "-o", tmp_path / "out.umbel"], ("out.umbel", "folder")),
        ([good[0], "-o", f"{tmp_path}/one.umbel/"], ("one.umbel/", "last character")),
        ([*good, "-o", tmp_path / "file"], ("file",)),
        ([*good, "-o", "/proc/out"], ("/proc/out",)),
        ([tmp_path / "*.glb", "-o", tmp_path / "out"], ("*.glb",)),
        ([tmp_path / "nothing", "-o", tmp_path / "out"], ("nothing",)),
        ([good[0], tmp_path / "no.obj", "-o", tmp_path / "out"], ("no.obj",)),
        ([*good, "-o", tmp_path / "out", "--jobs", 0], ("--jobs",)),
        ([*good, "-o", tmp_path / "out", "--max-triangles", 1], ("--max-triangles",)),
        ([*good, "-o", tmp_path / "out", "--precision", 16], ("16bits", "16mm")),
    ):
        done = umbel_command("build", *arguments, "--json")
        assert done.status == 1 and set(done.json) == {"error", "input"}
        assert len(done.err.splitlines()) == 1
        assert all(word in done.json["error"] for word in words), done.err
        assert not (tmp_path / "out").exists()


def test_many_warnings_are_not_all_said(umbel_command: Umbel, tmp_path: Path) -> None:
    mesh = b"mtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n"
    for k in range(25):
        (tmp_path / f"{k}.obj").write_bytes(mesh)
    done = umbel_command("build", tmp_path, "-o", tmp_path / "out")
    assert done.status == 0 and done.err.count("warning: ") == 20 and "25; the first 20" in done.out
    done = umbel_command("build", tmp_path, "-o", tmp_path / "out", "--json")
    assert all("none.mtl" in line["warnings"][0] for line in _lines(done))


def test_a_file_that_is_missing_is_one_that_fails(
    umbel_command: Umbel, models: Path, tmp_path: Path
) -> None:
    good, missing = sorted(models.rglob("mesh_*"))[0], models / "missing.obj"
    done = umbel_command("build", missing, good, "-o", tmp_path, "--keep-going", "--json")
    assert done.status == 1
    by_input = {line["input"]: line for line in _lines(done)}
    assert by_input[str(good)]["status"] == "built"
    assert str(missing) in by_input[str(missing)]["error"]


def test_a_pipe_is_read_once(umbel_command: Umbel, models: Path, tmp_path: Path) -> None:
    source = next(models.rglob("mesh_*.ply"))
    os.mkfifo(tmp_path / "pipe")
    with subprocess.Popen(["sh", "-c", f"cat '{source}' > '{tmp_path}/pipe'"]):
        done = umbel_command("build", tmp_path / "pipe", "-o", tmp_path / "a.umbel", "--json")
    assert done.status == 0, done.err
    assert (
        done.json["input_triangles"] == umbel.Asset(tmp_path / "a.umbel").info["source_triangles"]
    )


def test_existing_assets_are_replaced_whole_or_not_at_all(
    umbel_command: Umbel, models: Path, tmp_path: Path
) -> None:
    good, bad = sorted(models.rglob("mesh_*"))[0], sorted(models.rglob("bad_*"))[0]
    out = tmp_path / "out"
    out.mkdir()
    common = Path(os.path.commonpath([good.parent, bad.parent]))
    for source in (good, bad):
        old = out / source.relative_to(common).with_suffix(".umbel")
        old.parent.mkdir(parents=True, exist_ok=True)
        old.write_bytes(b"the old one")
    done = umbel_command("build", good, bad, "-o", out, "--keep-going", "--json")
    by_input = {line["input"]: line for line in _lines(done)}
    assert umbel.verify(by_input[str(good)]["output"], 4).ok
    assert Path(by_input[str(bad)]["output"]).read_bytes() == b"the old one"
    assert len(_files(out)) == 2


WORKER = """
import json, os, signal, sys
for line in sys.stdin:
    job = json.loads(line)
    if "die" in job["input"]:
        os.kill(os.getpid(), signal.SIGKILL)
    if "leave" in job["input"]:
        os._exit(5)
    print(json.dumps({"status": "built", "pid": os.getpid()}), flush=True)
"""


@pytest.fixture
def mortal_workers(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(pool, "COMMAND", [sys.executable, "-c", WORKER])
    yield


@pytest.mark.usefixtures("mortal_workers")
def test_a_worker_that_dies_names_its_file_and_the_rest_goes_on() -> None:
    names = ["a", "die 1", "b", "leave", "c", "d", "die 2", "e"]
    for count in (1, 3):
        answers = pool.work_off(({"input": name} for name in names), count)
        found = {job["input"]: answer for job, answer in answers}
        assert set(found) == set(names)
        for name in ("a", "b", "c", "d", "e"):
            assert found[name]["status"] == "built"
        assert found["die 1"]["status"] == "failed" and "SIGKILL" in found["die 1"]["error"]
        assert found["die 2"]["error"].startswith("die 2: ")
        assert "status 5" in found["leave"]["error"]


def _children(process: int) -> list[int]:
    try:
        return [
            int(word)
            for word in Path(f"/proc/{process}/task/{process}/children").read_text().split()
        ]
    except OSError:
        return []


def test_an_interrupted_run_leaves_whole_files_only(tmp_path: Path) -> None:
    source, out = tmp_path / "in", tmp_path / "out"
    source.mkdir()
    mesh = umbel.shapes.blob(5)
    for k in range(30):
        umbel.save(source / f"{k:02}.ply", mesh)
    process = subprocess.Popen(
        [*COMMAND, "build", str(source), "-o", str(out), "--jobs", "2", "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    first = process.stdout.readline()
    assert json.loads(first)["status"] == "built"
    workers = _children(process.pid)
    process.send_signal(signal.SIGINT)
    rest, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert err.endswith("umbel: interrupted\n") and "Traceback" not in err
    assert json.loads(rest.splitlines()[-1])["error"] == "interrupted"
    assert len(workers) == 2 and not any(Path(f"/proc/{worker}").exists() for worker in workers)
    files = _files(out)
    assert 1 <= len(files) < 30
    assert all(stored(out / name) for name in files)
