"""What commands say when something is wrong: file, flag, what to do; and that results name what
they are of."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
from collections import namedtuple
from pathlib import Path

import numpy as np
import pytest

import umbel
from helpers.commands import COMMAND, Umbel
from umbel.cli.failure import naming_file, with_flags
from umbel.cli.inputs import bytes_of
from umbel.cli.outputs import check_space
from umbel.cli.run import Failure, hear
from umbel.scale.memory import as_bytes


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A mesh of 320 triangles, and its asset beside it."""
    path = tmp_path_factory.mktemp("small") / "max_items.ply"
    umbel.save(path, umbel.shapes.sphere(2))
    umbel.build_lod(path).save(path.with_suffix(".umbel"))
    return path


def test_arguments_are_named_as_flags() -> None:
    flags = {"max_items": "--max-triangles", "max_triangles": "--max-triangles", "bins": "--bins"}
    assert with_flags("min is 3, more than max_items, 2", flags).endswith("--max-triangles, 2")
    assert with_flags("bins is 1, not 4", flags) == "--bins is 1, not 4"
    assert with_flags("not without bins=True", flags) == "not without --bins"
    assert with_flags("too many bins: max_triangles", flags) == "too many bins: --max-triangles"
    assert with_flags("--max-triangles is 1", flags) == "--max-triangles is 1"
    assert hear("a.glb: instances='on' keeps nodes") == "a.glb: --instances on keeps nodes"
    path = "a/max_items.obj"
    assert with_flags(f"{path}: max_items is 0", flags, [path]) == f"{path}: --max-triangles is 0"
    assert naming_file("triangle 3 is wrong", path, [path]) == f"{path}: triangle 3 is wrong"
    assert naming_file(f"cannot read {path}", path, [path]) == f"cannot read {path}"
    assert naming_file("out.glb is a folder", path, [path, "out.glb"]) == "out.glb is a folder"


def test_sizes_are_the_same_for_all_commands() -> None:
    for text in ("64MB", "2 GB", "1tb", "3TiB", "1e3 kB", "7"):
        assert bytes_of("--budget", text) == as_bytes(text)
    for text in ("0", "nan", "1PB", "-2GB", ""):
        with pytest.raises(Failure, match="--budget must be a size"):
            bytes_of("--budget", text)


@pytest.mark.parametrize(
    ("arguments", "flag"),
    [
        (["cluster", "IN", "--max-triangles", 0], "--max-triangles"),
        (["cluster", "IN", "--min-triangles", 999], "--min-triangles"),
        (["cluster", "IN", "--presplit", -1], "--presplit"),
        (["bvh", "IN", "--kary", "--builder", "kmeans", "--clusters", 1], "--clusters"),
        (["kdtree", "IN", "--cost", "-1,2"], "--cost"),
        (["render", "IN", "-o", "OUT.png", "--bounces", -1], "--bounces"),
        (["render", "IN", "-o", "OUT.png", "--light=-1,0,0"], "--light"),
        (["render", "IN", "-o", "OUT.png", "--camera", "auto", "--camera", "file:2"], "no persp"),
        (["extract", "ASSET", "-o", "OUT.ply", "--level", 99], "--level"),
        (["extract", "ASSET", "-o", "OUT.ply", "--level", -1], "--level"),
        (["extract", "ASSET", "-o", "OUT.ply", "--triangles", 0], "--triangles"),
        (["extract", "ASSET", "-o", "OUT.ply", "--triangles", -9], "--triangles"),
        (["extract", "ASSET", "-o", "OUT.ply", "--triangles", 1], "the coarsest cut has"),
        (["extract", "ASSET", "-o", "OUT.ply", "--error", -1], "--error"),
        (["extract", "ASSET", "-o", "OUT.ply", "--error", "nan"], "--error"),
        (["build", "IN", "-o", "OUT.umbel", "--precision", 16], "16mm"),
        (["bench", "bvh", "--generated", 5], "--generated"),
    ],
)
def test_wrong_values_name_the_flag(
    umbel_command: Umbel, small: Path, tmp_path: Path, arguments: list[object], flag: str
) -> None:
    places = {"IN": small, "ASSET": small.with_suffix(".umbel")}
    named = [
        tmp_path / str(word) if str(word).startswith("OUT") else places.get(str(word), word)
        for word in arguments
    ]
    done = umbel_command(*named, "--json")
    assert done.status == 1 and flag in done.json["error"]
    assert done.err == f"umbel: {done.json['error']}\n"
    given = str(named[1])
    if Path(given).exists():
        assert done.json["input"] == given and given in done.json["error"]
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("command", ["build", "bvh", "kdtree", "cluster", "render"])
def test_what_is_not_finite_names_the_remedy(
    umbel_command: Umbel, tmp_path: Path, command: str
) -> None:
    mesh = umbel.shapes.sphere(2)
    mesh.positions = mesh.positions.copy()
    mesh.positions[5] = np.inf
    source = tmp_path / "inf.ply"
    umbel.save(source, mesh)
    output = {"build": ["-o", tmp_path / "x.umbel"], "render": ["-o", tmp_path / "x.png"]}
    done = umbel_command(command, source, *output.get(command, []), "--json")
    assert done.status == 1 and "--drop-invalid" in done.json["error"]
    assert str(source) in done.json["error"] and "vertex 5" in done.json["error"]


@pytest.mark.parametrize("command", ["bvh", "kdtree"])
def test_no_flag_is_named_that_does_not_help(
    umbel_command: Umbel, tmp_path: Path, command: str
) -> None:
    source = tmp_path / "missing.obj"
    source.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 9\n")
    remedy = "; `umbel build --drop-invalid` leaves such triangles out\n"
    for flags in ([], ["--drop-invalid"]):
        done = umbel_command(command, source, *flags)
        assert done.status == 1 and "vertex index" in done.err
        assert done.err.endswith(remedy) and done.err.count("--drop-invalid") == 1


def test_info_refuses_what_build_refuses(umbel_command: Umbel, tmp_path: Path) -> None:
    mesh = umbel.shapes.sphere(2)
    source = tmp_path / "far.ply"
    for scale, valid in ((9e17, True), (2e18, False)):
        umbel.save(source, umbel.Mesh(mesh.positions * np.float32(scale), mesh.triangles))
        said = umbel_command("info", source, "--json").json
        assert said["valid"] is valid and (valid or "is too large" in said["problem"])
        done = umbel_command("build", source, "-o", tmp_path / "far.umbel")
        assert done.status == (0 if valid else 1)
        assert valid or ("is too large" in done.err and "drop-invalid" not in done.err)

    # Far apart and small: rounding to floats leaves nothing of half of the triangles.
    lines = [
        f"v {1e9 * (i % 2) + x} {i + y} 0"
        for i in range(20)
        for x, y in ((0, 0), (1e-4, 0), (0, 1e-4))
    ]
    faces = [f"f {i + 1} {i + 2} {i + 3}" for i in range(0, 60, 3)]
    source = tmp_path / "wide.obj"
    source.write_text("\n".join(lines + faces) + "\n")
    said = umbel_command("info", source, "--json").json
    done = umbel_command("build", source, "-o", tmp_path / "wide.umbel")
    assert said["valid"] is False and done.err == f"umbel: {said['problem']}\n"


def test_a_pipe_has_no_size(umbel_command: Umbel, small: Path, tmp_path: Path) -> None:
    output = tmp_path / "a.umbel"
    for command, size in (
        (["info", "/dev/stdin"], "file_bytes: -"),
        (["build", "/dev/stdin", "-o", output], "vertices\n"),
    ):
        with subprocess.Popen(["cat", small], stdout=subprocess.PIPE) as cat:
            done = umbel_command(*command, stdin=cat.stdout)
        assert done.status == 0 and size in done.out and "0 bytes" not in done.out


@pytest.mark.parametrize("rule", ["ignore", "error"])
def test_results_hold_warnings_whatever_the_environment_says(
    umbel_command: Umbel, tmp_path: Path, rule: str
) -> None:
    source = tmp_path / "a.obj"
    source.write_bytes(b"mtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n")
    environment = {**os.environ, "PYTHONWARNINGS": rule}
    for command in (["info", source], ["build", source, "-o", f"{tmp_path}/"]):
        done = umbel_command(*command, "--json", env=environment)
        assert done.status == 0 and "none.mtl" in done.json["warnings"][0], done.err


def test_references_leave_the_folder_by_a_flag_only(umbel_command: Umbel, tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    (tmp_path / "red.mtl").write_bytes(b"newmtl red\nKd 1 0 0\n")
    source, output = folder / "a.obj", tmp_path / "a.umbel"
    source.write_bytes(b"mtllib ../red.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n")
    flags = ["-o", output, "--skip-unchanged", "--json"]
    done = umbel_command("build", source, *flags)
    assert done.status == 0 and len(done.json["warnings"]) == 1
    assert "--allow-outside" in done.json["warnings"][0] and "../red.mtl" in done.err
    done = umbel_command("build", source, *flags, "--allow-outside")
    assert done.json["status"] == "built" and done.json["warnings"] == []
    assert umbel.Asset(output).materials[0].base_color[:3] == (1.0, 0.0, 0.0)
    assert umbel_command("build", source, *flags, "--allow-outside").json["status"] == "unchanged"
    (tmp_path / "red.mtl").write_bytes(b"newmtl red\nKd 1 1 0\n")
    assert umbel_command("build", source, *flags, "--allow-outside").json["status"] == "built"
    for command in (["info"], ["cluster"], ["bvh"], ["kdtree"]):
        assert umbel_command(*command, source, "--allow-outside").err == ""
    done = umbel_command("build", source.as_uri(), *flags, "--allow-outside")
    assert done.status == 1 and "--allow-outside" in done.json["error"]


def test_a_grid_that_is_too_coarse_needs_force(umbel_command: Umbel, tmp_path: Path) -> None:
    source, output = tmp_path / "fine.ply", tmp_path / "out.umbel"
    umbel.save(source, umbel.shapes.blob(5))
    arguments = ["build", source, "-o", output, "--precision", "5bits", "--json"]
    done = umbel_command(*arguments)
    assert done.status == 1 and not output.exists()
    for word in ("--force", "--precision", str(source), "of 20480 triangles"):
        assert word in done.json["error"]
    done = umbel_command(*arguments, "--force")
    assert done.status == 0 and umbel.verify(output, 8).ok


def test_results_name_input_and_output(umbel_command: Umbel, small: Path, tmp_path: Path) -> None:
    asset = small.with_suffix(".umbel")
    picture = ["--width", 16, "--height", 16, "--spp", 1]
    for arguments in (
        ["build", small, "-o", tmp_path / "a.umbel"],
        ["info", small],
        ["info", asset],
        ["verify", asset],
        ["extract", asset, "--level", 0, "-o", tmp_path / "a.glb"],
        ["cluster", small, "-o", tmp_path / "a.npz"],
        ["bvh", small, "-o", tmp_path / "a.umbvh"],
        ["kdtree", small, "-o", tmp_path / "a.umkd"],
        ["render", small, "-o", tmp_path / "a.png", *picture],
    ):
        done = umbel_command(*arguments, "--json")
        assert done.status == 0, done.err
        assert done.json["input"] == str(arguments[1])
        if "-o" in arguments:
            assert done.json["output"] == str(arguments[arguments.index("-o") + 1])
            assert done.json["warnings"] == []


def test_outputs_are_checked_before_the_input_is_read(
    umbel_command: Umbel, small: Path, tmp_path: Path
) -> None:
    asset = small.with_suffix(".umbel")
    (tmp_path / "folder.ply").mkdir()
    os.mkfifo(tmp_path / "pipe.ply")
    copy = tmp_path / "mesh.ply"
    shutil.copyfile(small, copy)
    link = tmp_path / "link.umbel"
    link.symlink_to(copy)
    (tmp_path / "away.umbel").symlink_to(tmp_path / "no" / "a.umbel")
    for arguments, word in (
        (["build", "nothing.ply", "-o", tmp_path / "a.txt"], ".umbel"),
        (
            ["build", "http://127.0.0.1:1/a", "-o", tmp_path / "a.umbel", "--allow-outside"],
            "--allow",
        ),
        (["build", "nothing.ply", "-o", tmp_path / "no" / "a.umbel"], "no folder"),
        (["build", "nothing.ply", "-o", "/proc/a.umbel"], "/proc"),
        (["build", "nothing.ply", "-o", tmp_path / "away.umbel"], "no folder"),
        (["build", copy, "-o", link], "is the input"),
        (["extract", asset, "--level", 0, "-o", tmp_path / "folder.ply"], "is a folder"),
        (["extract", asset, "--level", 0, "-o", tmp_path / "pipe.ply"], "no ordinary file"),
        (["render", "nothing.ply", "-o", tmp_path / "a.bmp"], ".png"),
        (["cluster", "nothing.ply", "-o", tmp_path / "a.bmp"], ".npz"),
        (["bench", "clusters", "-o", copy], "is a file"),
        (["view", asset, "--export", tmp_path / "no" / "a"], "no folder"),
    ):
        done = umbel_command(*arguments)
        assert done.status == 1 and word in done.err and "nothing.ply:" not in done.err
        assert len(done.err.splitlines()) == 1
    assert copy.read_bytes() == small.read_bytes()


def test_pictures_beside_the_output_are_checked_before_the_input_is_read(
    umbel_command: Umbel, tmp_path: Path
) -> None:
    (tmp_path / "a-normal.png").mkdir()
    done = umbel_command("render", "nothing.ply", "-o", tmp_path / "a.png", "--features")
    assert done.status == 1 and "a-normal.png is a folder" in done.err


@pytest.mark.parametrize(
    "flags",
    [
        ["bvh", "--builder", "nope"],
        ["bvh", "--width", 3],
        ["bvh", "--builder", "kmeans", "--kary", "--clusters", 100],
        ["bvh", "--bins", 2],
        ["bvh", "--device", "cuda", "--bins", 8],
        ["kdtree", "--builder", "nope"],
        ["kdtree", "--max-references", 0],
        ["cluster", "--max-vertices", 2],
        ["cluster", "--underfill", "nan"],
        ["render", "-o", "OUT.png", "--width", 0],
        ["render", "-o", "OUT.png", "--spp", 1 << 25],
        ["render", "-o", "OUT.png", "--camera", "1,2,3:0,0,0:400"],
        ["render", "-o", "OUT.png", "--camera", "auto:1"],
        ["render", "-o", "OUT.png", "--bounces", 9999],
        ["render", "-o", "OUT.png", "--heatmap", "overlap", "--clusters", "none.npz"],
    ],
)
def test_settings_are_checked_before_the_input_is_read(
    umbel_command: Umbel, tmp_path: Path, flags: list[object]
) -> None:
    command, *given = [word if word != "OUT.png" else tmp_path / "out.png" for word in flags]
    done = umbel_command(command, "nothing.ply", *given)
    assert done.status == 1 and len(done.err.splitlines()) == 1
    assert done.err.startswith("umbel: nothing.ply: ")


def test_pictures_replace_no_texture_of_the_mesh(umbel_command: Umbel, tmp_path: Path) -> None:
    mesh = umbel.shapes.grid(4, 4)
    flat = np.full((8, 8, 3), 0.5, np.float32)
    for name in ("m-albedo", "n-2"):
        umbel.save_picture(tmp_path / f"{name}.png", flat)
    (tmp_path / "m.mtl").write_text("newmtl a\nmap_Kd m-albedo.png\nnewmtl b\nmap_Kd n-2.png\n")
    umbel.save(tmp_path / "plain.obj", mesh)
    lines = (tmp_path / "plain.obj").read_text()
    source = tmp_path / "m.obj"
    source.write_text(f"mtllib m.mtl\nusemtl a\n{lines}")
    asset = tmp_path / "m.umbel"
    umbel.build_lod(source).save(asset, textures="external")
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    small = ("--width", 8, "--height", 8, "--spp", 1, "--json")
    for read, output, more in (
        (source, "m.png", ["--features"]),
        (source, "m-albedo.png", []),
        (source, "m-albedo.png", ["--heatmap", "overlap"]),
        (source, "n.png", ["--camera", "auto", "--camera", "auto:0,0"]),
        (asset, "m.png", ["--features"]),
    ):
        done = umbel_command("render", read, "-o", tmp_path / output, *more, *small)
        assert done.status == 1 and f"is a file that {read} refers to" in done.json["error"]
    assert before == {path: path.read_bytes() for path in tmp_path.iterdir()}
    for _ in range(2):  # its own pictures are replaced
        done = umbel_command("render", source, "-o", tmp_path / "out.png", "--features", *small)
        assert done.status == 0, done.err


def test_a_disk_without_room_is_found_before_the_build(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage(10**9, 10**9, 1000))
    check_space(tmp_path / "a.umbel", 1000)
    with pytest.raises(Failure, match="no space left"):
        check_space(tmp_path / "a.umbel", 1001)


def test_an_interrupted_command_says_so_as_an_object(tmp_path: Path) -> None:
    source, output = tmp_path / "pipe.ply", tmp_path / "out.umbel"
    os.mkfifo(source)
    process = subprocess.Popen(
        [*COMMAND, "build", str(source), "-o", str(output), "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    writer = -1
    while writer < 0 and process.poll() is None:
        try:
            writer = os.open(source, os.O_WRONLY | os.O_NONBLOCK)
        except OSError:  # nobody reads yet
            time.sleep(0.05)
    out = err = ""
    for _ in range(6):
        process.send_signal(signal.SIGINT)
        try:
            out, err = process.communicate(timeout=10)
            break
        except subprocess.TimeoutExpired:  # it came just before a read, which it does not wake
            continue
    os.close(writer)
    assert process.returncode == 130 and err == "umbel: interrupted\n"
    assert json.loads(out) == {"error": "interrupted", "input": str(source)}
    assert os.listdir(tmp_path) == ["pipe.ply"]


def test_an_output_at_fault_is_no_input(umbel_command: Umbel, small: Path) -> None:
    done = umbel_command("bench", "clusters", "-o", small, "--json")
    assert done.json == {"error": f"{small} is a file, not a folder", "input": None}


def test_a_command_that_is_unknown_has_no_input(umbel_command: Umbel) -> None:
    for arguments in (["fly", "a.obj"], ["bench", "fly"], []):
        done = umbel_command(*arguments, "--json")
        assert done.status == 2 and done.json["input"] is None and done.json["error"]
    done = umbel_command("build", "--max-triangles", "5", "a.obj", "--json")
    assert done.status == 2 and done.json["input"] == "a.obj"
    done = umbel_command("build", "--", "-a.obj", "-o", "a.umbel", "--json")
    assert done.status == 2 and done.json["input"] == "-a.obj"
