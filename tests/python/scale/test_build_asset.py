"""Builds in units: the same bytes however they are run, stopped or resumed; what is refused."""

from __future__ import annotations

import errno
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import umbel
from umbel.cli.building import pool
from umbel.io.textures.images import TextureImage
from umbel.scale.build_asset import build_asset
from umbel.scale.executor import InProcess
from umbel.scale.memory import is_too_large
from umbel.testing import giant

UNIT = 4000


@pytest.fixture(scope="module")
def terrain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("mesh") / "terrain.ply"
    giant.write(giant.terrain(20_000, seed=3), path)
    return path


@pytest.fixture(scope="module")
def expected(terrain: Path) -> bytes:
    output = terrain.with_name("expected.umbel")
    build_asset(terrain, output, unit_triangles=UNIT, workers=1, threads=1)
    return output.read_bytes()


class Stop(Exception):
    pass


def stopping(after: int) -> Any:
    """A progress callback that raises at its n-th call."""
    left = [after]

    def report(_fraction: float, _stage: str) -> None:
        left[0] -= 1
        if left[0] < 0:
            raise Stop

    return report


def stopped(terrain: Path, output: Path, after: int = 1 << 30, stage: str = "tier 2") -> None:
    """A build that ends when a stage begins, or after so many reports."""

    def report(fraction: float, name: str) -> None:
        if name.startswith(stage):
            raise Stop
        counted(fraction, name)

    counted = stopping(after)
    with pytest.raises(Stop):
        build_asset(terrain, output, unit_triangles=UNIT, workers=1, progress=report)


def test_result_is_sound_and_leaves_no_work(terrain: Path, tmp_path: Path) -> None:
    output = tmp_path / "a.umbel"
    report = build_asset(terrain, output, unit_triangles=UNIT)
    assert umbel.verify(output).ok
    assert report["input_triangles"] == umbel.load(terrain).triangles.shape[0]
    assert os.listdir(tmp_path) == ["a.umbel"]


def test_a_resumed_build_reports_what_is_done(terrain: Path, tmp_path: Path) -> None:
    def begun(resume: bool) -> float:
        """Where the second tier begins."""
        reports: list[tuple[str, float]] = []

        def report(fraction: float, stage: str) -> None:
            reports.append((stage, fraction))

        build_asset(
            terrain,
            tmp_path / "a.umbel",
            unit_triangles=UNIT,
            workers=1,
            resume=resume,
            progress=report,
        )
        return next(fraction for stage, fraction in reports if stage.startswith("tier 2"))

    stopped(terrain, tmp_path / "a.umbel")
    assert begun(resume=True) == begun(resume=False)


@pytest.mark.parametrize("workers", [1, 2])
def test_bytes_do_not_depend_on_workers(
    terrain: Path, expected: bytes, tmp_path: Path, workers: int
) -> None:
    output = tmp_path / "a.umbel"
    build_asset(terrain, output, unit_triangles=UNIT, workers=workers, memory="8GB")
    assert output.read_bytes() == expected


@pytest.mark.parametrize("after", [0, 1, 2, 4, 7])
def test_stopped_build_goes_on(terrain: Path, expected: bytes, tmp_path: Path, after: int) -> None:
    output = tmp_path / "a.umbel"
    stopped(terrain, output, after)
    assert not output.exists()
    with pytest.raises(umbel.Error, match="not finished: go on with resume"):
        build_asset(terrain, output, unit_triangles=UNIT)
    build_asset(terrain, output, unit_triangles=UNIT, resume=True)
    assert output.read_bytes() == expected
    assert not (tmp_path / "a.umbel.work").exists()


def test_what_is_sorted_goes_once_its_tier_is_built(
    terrain: Path, expected: bytes, tmp_path: Path
) -> None:
    output, work = tmp_path / "a.umbel", tmp_path / "a.umbel.work"
    stopped(terrain, output, stage="planning")
    assert list(work.glob("t0/unit/*.parts")) and not list(work.glob("t0/route/*"))
    # Where it is needed after all, it is made again.
    next(work.glob("t0/unit/*.exits")).unlink()
    build_asset(terrain, output, unit_triangles=UNIT, resume=True)
    assert output.read_bytes() == expected


def test_every_damaged_work_file_is_found(terrain: Path, expected: bytes, tmp_path: Path) -> None:
    output = tmp_path / "a.umbel"
    stopped(terrain, output)
    kept = tmp_path / "kept"
    shutil.copytree(tmp_path / "a.umbel.work", kept)
    kinds: dict[str, Path] = {}
    for path in sorted(kept.rglob("*")):
        if path.suffix != ".said" and path.parent.name in ("unit", "route"):
            kinds.setdefault(f"{path.parent.parent.name}{path.suffix}", path)
    assert len(kinds) >= 4
    for path in kinds.values():
        shutil.rmtree(tmp_path / "a.umbel.work")
        shutil.copytree(kept, tmp_path / "a.umbel.work")
        damaged = tmp_path / "a.umbel.work" / path.relative_to(kept)
        data = bytearray(damaged.read_bytes())
        data[len(data) // 3] ^= 0x10
        damaged.write_bytes(data)
        shutil.copytree(tmp_path / "a.umbel.work", tmp_path / "again")
        build_asset(
            terrain, output, unit_triangles=UNIT, resume=True, work=tmp_path / "again", workers=1
        )
        assert output.read_bytes() == expected, path.name


def test_damaged_manifest_is_called_so(terrain: Path, tmp_path: Path) -> None:
    output, manifest = tmp_path / "a.umbel", tmp_path / "a.umbel.work" / "manifest.json"
    stopped(terrain, output, 0)
    data = manifest.read_bytes()
    for at in range(0, data.index(b'"checksum"') - 5, 17):
        manifest.write_bytes(data[:at] + bytes([data[at] ^ 4]) + data[at + 1 :])
        with pytest.raises(umbel.Error, match=r"manifest\.json is damaged: remove its folder"):
            build_asset(terrain, output, unit_triangles=UNIT, resume=True)
    manifest.write_bytes(data)
    build_asset(terrain, output, unit_triangles=UNIT, resume=True)


def test_changed_input_is_refused(terrain: Path, tmp_path: Path) -> None:
    mesh = tmp_path / "mesh.ply"
    shutil.copy(terrain, mesh)
    stopped(mesh, tmp_path / "a.umbel")
    data = bytearray(mesh.read_bytes())
    data[-40] ^= 1
    time.sleep(0.01)
    mesh.write_bytes(data)
    with pytest.raises(umbel.Error, match=r"input has changed|vertex index"):
        build_asset(mesh, tmp_path / "a.umbel", unit_triangles=UNIT, resume=True)


def test_touched_input_is_not(terrain: Path, expected: bytes, tmp_path: Path) -> None:
    stopped(terrain, tmp_path / "a.umbel")
    os.utime(terrain)
    build_asset(terrain, tmp_path / "a.umbel", unit_triangles=UNIT, resume=True)
    assert (tmp_path / "a.umbel").read_bytes()[-1000:] == expected[-1000:]


def test_materials_that_are_no_longer_shared_are_refused(tmp_path: Path) -> None:
    tiles = []
    for k in range(2):
        tiles.append(tmp_path / f"{k}.obj")
        lines = [f"v {10 * k + i % 50} {i // 50} 0\n" for i in range(2500)]
        corners = [50 * y + x + 1 for y in range(49) for x in range(49)]
        faces = [f"f {c} {c + 1} {c + 51}\nf {c} {c + 51} {c + 50}\n" for c in corners]
        tiles[k].write_text("".join([f"mtllib {k}.mtl\n", *lines, "usemtl wall\n", *faces]))
        tiles[k].with_suffix(".mtl").write_text("newmtl wall\nKd 1 1 1\n")
    output = tmp_path / "a.umbel"

    def stop(_fraction: float, stage: str) -> None:
        if stage.startswith("tier 2"):
            raise Stop

    with pytest.raises(Stop):
        build_asset(tiles, output, unit_triangles=UNIT, workers=1, progress=stop)
    tiles[1].with_suffix(".mtl").write_text("newmtl wall\nKd 1 0 0\n")
    with pytest.raises(umbel.Error, match="the input has changed"):
        build_asset(tiles, output, unit_triangles=UNIT, resume=True)
    tiles[1].with_suffix(".mtl").write_text("newmtl wall\nKd 1 1 1\n")
    build_asset(tiles, output, unit_triangles=UNIT, resume=True)
    assert len(umbel.Asset(output).materials) == 1


def test_other_setting_is_refused_by_name(terrain: Path, tmp_path: Path) -> None:
    stopped(terrain, tmp_path / "a.umbel")
    with pytest.raises(umbel.Error, match="max_triangles was 128 and is now 64"):
        build_asset(
            terrain, tmp_path / "a.umbel", unit_triangles=UNIT, resume=True, max_triangles=64
        )


def test_two_builds_in_one_folder_are_refused(terrain: Path, tmp_path: Path) -> None:
    output = tmp_path / "a.umbel"
    said: list[str] = []

    def report(_fraction: float, stage: str) -> None:
        if stage.startswith("tier") and not said:
            with pytest.raises(umbel.Error) as error:
                build_asset(terrain, output, unit_triangles=UNIT, resume=True)
            said.append(str(error.value))

    build_asset(terrain, output, unit_triangles=UNIT, progress=report)
    assert "another build is at work" in said[0]


def test_folder_of_somebody_else_stays(terrain: Path, tmp_path: Path) -> None:
    (tmp_path / "precious.txt").write_text("mine")
    with pytest.raises(umbel.Error, match=r"precious\.txt"):
        build_asset(terrain, tmp_path / "a.umbel", unit_triangles=UNIT, work=tmp_path)
    assert (tmp_path / "precious.txt").read_text() == "mine"


def test_places_where_nothing_can_be_written(terrain: Path, tmp_path: Path) -> None:
    for nothing in ("", "."):
        with pytest.raises(umbel.Error, match=f"the output '{nothing}' names no file"):
            build_asset(terrain, nothing)
    with pytest.raises(umbel.Error, match=r"a\.umbel: there is no folder .*missing"):
        build_asset(terrain, tmp_path / "missing" / "a.umbel", work=tmp_path / "work")
    (tmp_path / "link").symlink_to("missing/a.umbel")
    with pytest.raises(umbel.Error, match=r"there is no folder .*missing"):
        build_asset(terrain, tmp_path / "link")
    with pytest.raises(umbel.Error, match="it is a folder"):
        build_asset(terrain, tmp_path)
    assert os.listdir(tmp_path) == ["link"]


def test_leftovers_behind_a_link_are_removed(terrain: Path, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to("folder/a.umbel")
    gone = subprocess.run(
        [sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True
    )
    (tmp_path / "folder" / f".a.umbel.{int(gone.stdout)}.0.tmp").touch()
    build_asset(terrain, tmp_path / "link", unit_triangles=UNIT)
    assert (tmp_path / "link").is_symlink()
    assert os.listdir(tmp_path / "folder") == ["a.umbel"]


@pytest.mark.parametrize(
    "memory", ["2XB", 0, -1.0, float("nan"), 10**400, [1], np.ones(2)], ids=str
)
def test_memory_that_is_no_size_is_refused(memory: Any, terrain: Path, tmp_path: Path) -> None:
    with pytest.raises(umbel.Error, match="memory must be a size such as '2GB'"):
        build_asset(terrain, tmp_path / "a.umbel", memory=memory)
    assert os.listdir(tmp_path) == []


def test_what_is_no_source_is_refused(tmp_path: Path) -> None:
    for source in (5, None):
        with pytest.raises(umbel.Error, match=f"blocks of triangles, not {source}"):
            build_asset(source, tmp_path / "a.umbel")  # type: ignore[arg-type]
        assert os.listdir(tmp_path) == []


def test_too_little_memory_says_what_would_do(terrain: Path, tmp_path: Path) -> None:
    with pytest.raises(umbel.Error, match=r"of 0\.05 GB is .* need 0\.\d\d GB"):
        build_asset(terrain, tmp_path / "a.umbel", unit_triangles=UNIT, memory="50MB")


def test_input_at_fault_leaves_no_folder(terrain: Path, tmp_path: Path) -> None:
    data = terrain.read_bytes()
    broken, output = tmp_path / "mesh.ply", tmp_path / "a.umbel"
    for fault in (data[:-100], data[:-4] + b"\xff\xff\xff\x7f", b""):
        broken.write_bytes(fault)
        with pytest.raises(umbel.Error, match=r"mesh\.ply"):
            build_asset(broken, output, unit_triangles=UNIT)
        assert os.listdir(tmp_path) == ["mesh.ply"]
    broken.write_bytes(data)
    umbel.build_asset(broken, output, unit_triangles=UNIT)


def test_blocks_that_end_in_an_exception_leave_no_folder(tmp_path: Path) -> None:
    def blocks(error: Exception) -> Any:
        yield np.eye(3), [[0, 1, 2]]
        raise error

    for error in (OSError("no third tile"), RuntimeError("no third tile")):
        with pytest.raises(type(error), match=r"^no third tile$"):
            build_asset(blocks(error), tmp_path / "a.umbel")
        assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("own", ["source/mesh.ply", "t1/notes.txt", "lock", ".a.ply.1.0.tmp"])
def test_folders_of_others_are_left_alone_whatever_their_names(
    own: str, terrain: Path, tmp_path: Path
) -> None:
    file = tmp_path / "work" / own
    file.parent.mkdir(parents=True)
    file.write_bytes(b"precious")
    with pytest.raises(umbel.Error, match="has files that are no build's"):
        build_asset(terrain, tmp_path / "a.umbel", work=tmp_path / "work", unit_triangles=UNIT)
    assert [path for path in (tmp_path / "work").rglob("*") if path.is_file()] == [file]
    assert file.read_bytes() == b"precious"


def test_workers_import_nothing_from_the_folder_that_they_run_in(
    terrain: Path, expected: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("types", "numpy", "umbel"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('not this one')")
    monkeypatch.chdir(tmp_path)
    build_asset(terrain, tmp_path / "a.umbel", unit_triangles=UNIT, workers=1, threads=1)
    assert (tmp_path / "a.umbel").read_bytes() == expected
    assert subprocess.run(pool.COMMAND, input=b"", timeout=60).returncode == 0


def test_metadata_that_is_no_json_is_refused_before_units_are_built(
    terrain: Path, tmp_path: Path
) -> None:
    with pytest.raises(TypeError):
        build_asset(terrain, tmp_path / "a.umbel", metadata={"made": object()})
    assert os.listdir(tmp_path) == []


def test_files_of_the_work_folder_that_cannot_be_written_are_named(
    terrain: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = Path.write_bytes
    for name in ("source_stamp", "t0/source.json"):

        def full(path: Path, data: bytes, name: str = name) -> int:
            if path.as_posix().endswith(name):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return write(path, data)

        monkeypatch.setattr(Path, "write_bytes", full)
        with pytest.raises(umbel.Error, match=f"cannot write .*{name}: No space left") as caught:
            build_asset(terrain, tmp_path / "a.umbel", work=tmp_path / "work", executor=InProcess())
        assert caught.value.code == "io"
        shutil.rmtree(tmp_path / "work")
    (tmp_path / "file").touch()
    with pytest.raises(umbel.Error, match=r"cannot make the folder .*file: File exists"):
        umbel.build_lod(terrain, work=tmp_path / "file")


@pytest.mark.parametrize(
    "setting",
    [{"max_triangles": 257}, {"max_error": float("nan")}, {"group_size": (8, 4)}],
    ids=str,
)
def test_settings_out_of_range_are_refused_as_in_memory(
    setting: dict[str, Any], terrain: Path, tmp_path: Path
) -> None:
    with pytest.raises(umbel.Error) as in_memory:
        umbel.build_lod(terrain, **setting)
    with pytest.raises(umbel.Error) as in_units:
        umbel.build_asset(terrain, tmp_path / "a.umbel", unit_triangles=UNIT, **setting)
    assert str(in_units.value) == str(in_memory.value)
    assert os.listdir(tmp_path) == []


def test_blocks_build_what_the_file_does(terrain: Path, expected: bytes, tmp_path: Path) -> None:
    mesh = umbel.load(terrain)
    half = len(mesh.triangles) // 2
    blocks = [(mesh.positions, mesh.triangles[:half]), (mesh.positions, mesh.triangles[half:])]
    build_asset(blocks, tmp_path / "a.umbel", unit_triangles=UNIT)
    assert umbel.verify(tmp_path / "a.umbel").ok
    other = tmp_path / "expected.umbel"
    other.write_bytes(expected)
    one = umbel.Asset(tmp_path / "a.umbel")
    assert np.array_equal(one.tables.groups, umbel.Asset(other).tables.groups)


def umbel_command(*words: object) -> list[str]:
    return [sys.executable, "-m", "umbel", *map(str, words)]


def test_killed_command_goes_on(terrain: Path, tmp_path: Path) -> None:
    output = tmp_path / "a.umbel"
    command = umbel_command("build", terrain, "-o", output, "--unit-triangles", UNIT)
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    units = tmp_path / "a.umbel.work" / "t0" / "unit"
    while process.poll() is None and not list(units.glob("*.done")):
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert not output.exists()
    subprocess.run([*command, "--resume"], check=True, stdout=subprocess.DEVNULL)
    assert umbel.verify(output).ok
    assert os.listdir(tmp_path) == ["a.umbel"]


def test_names_of_files_may_have_any_characters(
    terrain: Path, expected: bytes, tmp_path: Path
) -> None:
    mesh = tmp_path / 'a\n\tmesh \\u0041 "\x1f".ply'
    shutil.copy(terrain, mesh)
    stopped(mesh, tmp_path / "a.umbel")
    build_asset(mesh, tmp_path / "a.umbel", unit_triangles=UNIT, resume=True)
    assert (tmp_path / "a.umbel").read_bytes()[-1000:] == expected[-1000:]


def test_processes_whose_children_nobody_waits_for(terrain: Path, tmp_path: Path) -> None:
    """As where SIGCHLD is ignored: the system takes how they ended."""

    def ignore() -> None:
        signal.signal(signal.SIGCHLD, signal.SIG_IGN)

    output = tmp_path / "a.umbel"
    command = umbel_command("build", terrain, "-o", output, "--unit-triangles", UNIT)
    subprocess.run(command, check=True, preexec_fn=ignore, timeout=300)
    assert umbel.verify(output).ok


def test_full_disk_is_a_sentence_and_resumable(terrain: Path, tmp_path: Path) -> None:
    output = tmp_path / "a.umbel"
    command = umbel_command("build", terrain, "-o", output, "--unit-triangles", UNIT)

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))

    done = subprocess.run(command, capture_output=True, text=True, preexec_fn=limit)
    assert done.returncode == 1
    assert "File too large" in done.stderr
    assert "--resume" in done.stderr
    assert "Traceback" not in done.stderr
    assert not output.exists()
    subprocess.run([*command, "--resume"], check=True, stdout=subprocess.DEVNULL)
    assert umbel.verify(output).ok


def test_worker_that_cannot_say_why(
    terrain: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the disk is full, there is no room for a sentence either."""
    full = ", and why could not be written to .*: most likely the disk is full"
    for code, more in ((12, full), (1, "$")):
        fails = ["sh", "-c", f"exit {code}"]
        monkeypatch.setattr("umbel.scale.build_asset._command", lambda _, fails=fails: fails)
        with pytest.raises(umbel.Error, match=f"unit . of tier . could not be built{more}"):
            build_asset(terrain, tmp_path / f"{code}.umbel", unit_triangles=UNIT)


def test_textures_take_no_memory_while_units_are_built(tmp_path: Path) -> None:
    mesh = umbel.shapes.terrain(60, 60, 1)
    image = b"\xff\xd8\xff" + np.random.default_rng(1).bytes(64 << 20)
    mesh.materials = [umbel.Material(images={"base_color": TextureImage(data=image)})]
    mesh.material_ids = np.zeros(len(mesh.triangles), np.uint32)
    umbel.save(tmp_path / "a.glb", mesh)
    code = (
        "import resource, sys; from umbel.scale.build_asset import build_asset\n"
        "def taken(): return int(open('/proc/self/statm').read().split()[1])\n"
        "before, most = taken(), 0\n"
        "def report(fraction, stage):\n"
        "    global most\n"
        "    if stage.startswith('tier'): most = max(most, taken() - before)\n"
        "build_asset('a.glb', 'a.umbel', unit_triangles=4000, workers=1, progress=report)\n"
        "print(most * resource.getpagesize())\n"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert 0 < int(done.stdout) < 32 << 20
    stored = umbel.Asset(tmp_path / "a.umbel").materials[0].images["base_color"]
    assert stored.encoded() == image


def test_no_flag_is_suggested_that_units_do_not_have(tmp_path: Path) -> None:
    bad = tmp_path / "bad.obj"
    bad.write_text("v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n")
    command = umbel_command("build", bad, "-o", tmp_path / "a.umbel")
    in_memory = subprocess.run(command, capture_output=True, text=True)
    assert "--drop-invalid" in in_memory.stderr
    in_units = subprocess.run(
        [*command, "--unit-triangles", str(UNIT)], capture_output=True, text=True
    )
    assert in_units.returncode == 1
    assert "not finite" in in_units.stderr
    assert "--drop-invalid" not in in_units.stderr
    assert os.listdir(tmp_path) == ["bad.obj"]


def test_small_files_are_never_too_large(terrain: Path) -> None:
    assert not is_too_large(terrain, memory="1MB")


def test_buffers_of_a_gltf_count(tmp_path: Path) -> None:
    gltf = tmp_path / "a.gltf"
    gltf.write_text('{"buffers": [{"uri": "a.bin", "byteLength": 100000000}, {"byteLength": 3}]}')
    assert is_too_large(gltf, memory="700MB") and not is_too_large(gltf, memory="900MB")
    command = umbel_command("build", gltf, "-o", tmp_path / "a.umbel", "--memory", "700MB")
    done = subprocess.run([*command, "--lock-borders"], capture_output=True, text=True)
    assert "does not fit into that memory" in done.stderr
    for wrong in ("[", "[" * 100_000, '{"buffers": 3}', '{"buffers": [{}]}'):
        gltf.write_text(wrong)
        assert not is_too_large(gltf, memory="1MB")
