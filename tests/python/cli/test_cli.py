"""Every command: what it says, what it writes, how it ends."""

from __future__ import annotations

import hashlib
import json
import os
import pty
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import umbel
from helpers.commands import Umbel
from helpers.cuda_packages import packaged
from helpers.meshes import is_closed, triangle_keys

BUILD_FIELDS = [
    "input_triangles",
    "input_vertices",
    "levels",
    "groups",
    "clusters",
    "triangles_all_levels",
    "root_groups",
    "root_triangles",
    "stuck_groups",
    "mean_fill",
    "max_cluster_vertices",
    "seconds",
    "triangles_per_second",
    "peak_rss_bytes",
    "file_bytes",
    "bytes_per_input_triangle",
    "sha256",
]
NOT_STORED = {"seconds", "triangles_per_second", "peak_rss_bytes"}
INFO_FIELDS = [f for f in BUILD_FIELDS if f not in NOT_STORED] + [
    *("format_version", "pages", "materials", "instances", "bounds")
]
VERIFY_FIELDS = [
    "ok",
    "cuts",
    "cracks",
    "overlaps",
    "limit_violations",
    "monotone",
    "checksum_errors",
]
EXTRACT_FIELDS = ["triangles", "vertices", "max_error"]
CLUSTER_FIELDS = [
    "clusters",
    "mean_fill",
    "min_size",
    "max_size",
    "mean_vertices",
    "max_vertices",
    "surface_area_ratio",
    "sah",
    "overlap",
    "seconds",
    "triangles_per_second",
]


def test_build_says_what_it_made(
    umbel_command: Umbel, blob_ply: Path, blob_asset: Path, tmp_path: Path
) -> None:
    output = tmp_path / "out.umbel"
    done = umbel_command("build", blob_ply, "-o", output, "--json")
    assert done.status == 0 and done.err == ""
    said = done.json
    assert set(BUILD_FIELDS) <= set(said)
    assert said["input_triangles"] == 20_480 and said["input_vertices"] == 10_242
    assert said["root_groups"] == 1 and said["stuck_groups"] == 0
    assert said["max_cluster_vertices"] <= 128
    assert said["file_bytes"] == output.stat().st_size
    assert said["sha256"] == hashlib.sha256(output.read_bytes()).hexdigest()
    assert said["bytes_per_input_triangle"] == pytest.approx(said["file_bytes"] / 20_480)
    assert said["triangles_per_second"] == pytest.approx(20_480 / said["seconds"])
    assert 10e6 < said["peak_rss_bytes"] < 2e9
    clusters = umbel.Asset(output).tables.clusters
    total = int(clusters["triangle_count"].sum())
    assert said["clusters"] == len(clusters)
    assert said["triangles_all_levels"] == total
    assert said["mean_fill"] == pytest.approx(total / (len(clusters) * 128))
    assert said["input"] == str(blob_ply) and said["output"] == str(output)
    # As the Python function made it, but that it also says of what and how.
    made, expected = umbel.Asset(output), umbel.Asset(blob_asset)
    assert made.meshes == expected.meshes
    assert np.array_equal(made.page_sizes, expected.page_sizes)
    metadata = made.info["metadata"]
    assert metadata["source"].pop("sha256") == hashlib.sha256(blob_ply.read_bytes()).hexdigest()
    assert metadata["source"].pop("options")["max_triangles"] == 128
    assert metadata == expected.info["metadata"]
    assert os.listdir(tmp_path) == ["out.umbel"]


def test_vertices_count_as_they_are_stored(umbel_command: Umbel, tmp_path: Path) -> None:
    mesh, asset = tmp_path / "a.obj", tmp_path / "a.umbel"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nv 5 5 5\nf 1 2 3\nf 1 3 4\n")
    for command in (["info", mesh], ["build", mesh, "-o", asset], ["info", asset]):
        assert umbel_command(*command, "--json").json["input_vertices"] == 5


def test_build_is_the_same_on_every_run_and_thread_count(
    umbel_command: Umbel, blob_ply: Path, tmp_path: Path
) -> None:
    hashes = set()
    for threads in (1, 2, 2):
        output = tmp_path / f"{len(hashes)}.umbel"
        done = umbel_command("build", blob_ply, "-o", output, "--json", "--threads", threads)
        hashes.add(done.json["sha256"])
    assert len(hashes) == 1


def test_build_takes_its_limits(umbel_command: Umbel, blob_ply: Path, tmp_path: Path) -> None:
    output = tmp_path / "out.umbel"
    limits = ["--max-triangles", 64, "--max-vertices", 50, "--group-size", "8:12"]
    done = umbel_command("build", blob_ply, "-o", output, *limits, "--json")
    tables = umbel.Asset(output).tables
    assert done.json["max_cluster_vertices"] <= 50
    assert tables.clusters["triangle_count"].max() <= 64
    assert tables.groups["cluster_count"].max() <= 12
    info = umbel_command("info", output, "--json").json
    assert info["config"]["max_group"] == 12 and info["max_vertices"] == 50


def test_build_attributes_and_precision(umbel_command: Umbel, tmp_path: Path) -> None:
    mesh = umbel.shapes.blob(3)
    mesh.uvs = mesh.positions[:, :2].copy()
    source = tmp_path / "uv.glb"
    umbel.save(source, mesh)
    output = tmp_path / "out.umbel"
    for kept, flag in ((["uvs"], "auto"), ([], "none")):
        assert umbel_command("build", source, "-o", output, "--attributes", flag).status == 0
        assert umbel_command("info", output, "--json").json["attributes"] == kept
    for precision, step in (("2mm", 2**-9), ("0.5 mm", 2**-11)):
        done = umbel_command("build", source, "-o", output, "--precision", precision, "--json")
        assert done.json["grid_step"] == step and done.json["largest_move"] <= step
        assert umbel_command("info", output, "--json").json["grid_step"] == step
    done = umbel_command("build", source, "-o", output, "--precision", "8bits", "--json")
    assert done.status == 0 and 2**-8 <= done.json["grid_step"] <= 2**-4
    for wrong in ("16", "0.1", "fine", "0bits", "99bits", "1.5bits", "-1mm", "nanmm"):
        done = umbel_command("build", source, "-o", output, "--precision", wrong, "--json")
        assert done.status == 1 and "--precision" in done.json["error"]
    done = umbel_command("build", source, "-o", output, "--precision", "16")
    assert "16mm" in done.err and "16bits" in done.err


def test_drop_invalid_says_how_many(umbel_command: Umbel, tmp_path: Path) -> None:
    mesh = umbel.shapes.sphere(3)
    mesh.positions = mesh.positions.copy()
    mesh.positions[9] = np.nan
    touched = int((mesh.triangles == 9).any(axis=1).sum())
    source, output = tmp_path / "nan.ply", tmp_path / "out.umbel"
    umbel.save(source, mesh)
    refused = umbel_command("build", source, "-o", output)
    assert refused.status == 1 and not output.exists()
    assert len(refused.err.splitlines()) == 1 and "9" in refused.err
    done = umbel_command("build", source, "-o", output, "--drop-invalid", "--json")
    assert done.status == 0 and done.json["dropped_triangles"] == touched
    assert str(touched) in done.err
    assert umbel_command("verify", output, "--json").json["ok"] is True


def test_info_of_an_asset(umbel_command: Umbel, blob_ply: Path, tmp_path: Path) -> None:
    output = tmp_path / "out.umbel"
    built = umbel_command("build", blob_ply, "-o", output, "--json").json
    done = umbel_command("info", output, "--json")
    assert done.status == 0
    said = done.json
    assert set(INFO_FIELDS) <= set(said)
    for field in set(BUILD_FIELDS) - NOT_STORED:
        assert said[field] == built[field], field
    assert 1 <= said["pages"] <= said["groups"] and said["instances"] == 1
    positions = umbel.shapes.blob(5).positions
    assert np.allclose(said["bounds"], [positions.min(axis=0), positions.max(axis=0)])
    assert said["source"]["file"] == blob_ply.name


def test_info_of_a_mesh(umbel_command: Umbel, blob_ply: Path, tmp_path: Path) -> None:
    said = umbel_command("info", blob_ply, "--json").json
    assert said["kind"] == "mesh" and said["valid"] is True
    assert said["input_triangles"] == 20_480 and said["input_vertices"] == 10_242
    assert said["file_bytes"] == blob_ply.stat().st_size
    assert {"format_version", "pages", "materials", "instances", "bounds"} <= set(said)
    mesh = umbel.shapes.sphere(1)
    mesh.positions = mesh.positions.copy()
    mesh.positions[0] = np.nan
    umbel.save(tmp_path / "nan.ply", mesh)
    said = umbel_command("info", tmp_path / "nan.ply", "--json").json
    assert said["valid"] is False and said["problem"]


def test_verify_says_what_holds(umbel_command: Umbel, blob_asset: Path) -> None:
    done = umbel_command("verify", blob_asset, "--json", "--cuts", 10)
    assert done.status == 0 and set(VERIFY_FIELDS) <= set(done.json)
    said = done.json
    assert said["ok"] is True and said["monotone"] is True and said["cuts"] == 10
    assert [said[k] for k in ("cracks", "overlaps", "limit_violations", "checksum_errors")] == [
        0
    ] * 4
    assert umbel_command("verify", blob_asset, "--json").json["cuts"] == 64
    assert said["warnings"] == said["problems"] == [] and "error" not in said


def test_verify_in_a_fixed_memory_says_the_same(
    umbel_command: Umbel, blob_asset: Path, tmp_path: Path
) -> None:
    whole = umbel_command("verify", blob_asset, "--json").json
    paged = umbel_command("verify", blob_asset, "--json", "--memory", "200MB").json
    assert paged["ok"] is True and paged | {"seconds": 0} == whole | {"seconds": 0}
    bad = bytearray(blob_asset.read_bytes())
    bad[-1000] ^= 0x10
    (tmp_path / "bad.umbel").write_bytes(bad)
    done = umbel_command("verify", tmp_path / "bad.umbel", "--json", "--memory", "200MB")
    assert done.status == 3 and done.json["checksum_errors"] >= 1
    refused = umbel_command("verify", blob_asset, "--memory", "1KB")
    assert refused.status != 0 and "at least" in refused.err
    assert "--memory must be a size" in umbel_command("verify", blob_asset, "--memory", "big").err


@pytest.mark.parametrize("where", [0.3, 0.6, 0.9])
def test_verify_finds_a_changed_byte(
    umbel_command: Umbel, blob_asset: Path, tmp_path: Path, where: float
) -> None:
    bad = bytearray(blob_asset.read_bytes())
    bad[int(len(bad) * where)] ^= 0x10
    path = tmp_path / "bad.umbel"
    path.write_bytes(bad)
    done = umbel_command("verify", path, "--json")
    assert done.status == 3
    assert done.json["ok"] is False and done.json["checksum_errors"] >= 1
    assert done.json["warnings"] == [] and done.json["error"] in done.err
    assert len(done.err.splitlines()) == 1


@pytest.mark.parametrize("kept", [0, 10, 1000, -1])
def test_verify_finds_a_truncated_file(
    umbel_command: Umbel, blob_asset: Path, tmp_path: Path, kept: int
) -> None:
    path = tmp_path / "short.umbel"
    path.write_bytes(blob_asset.read_bytes()[:kept])
    done = umbel_command("verify", path, "--json")
    assert done.status == 3 and done.json["ok"] is False
    for command in (["info", path], ["extract", path, "--level", "0", "-o", tmp_path / "x.ply"]):
        refused = umbel_command(*command)
        assert refused.status == 1 and len(refused.err.splitlines()) == 1
    assert not (tmp_path / "x.ply").exists()


@pytest.mark.parametrize("suffix", [".glb", ".ply", ".obj"])
def test_extract_level_zero_is_the_input(
    umbel_command: Umbel, blob_asset: Path, tmp_path: Path, suffix: str
) -> None:
    output = tmp_path / f"fine{suffix}"
    done = umbel_command("extract", blob_asset, "--level", 0, "-o", output, "--json")
    assert done.status == 0 and set(EXTRACT_FIELDS) <= set(done.json)
    assert done.json["max_error"] == 0 and done.json["triangles"] == 20_480
    expected = triangle_keys(umbel.shapes.blob(5), attributes=False)
    assert np.array_equal(triangle_keys(umbel.load(output), attributes=False), expected)


def test_extract_by_budget_and_by_error(
    umbel_command: Umbel, blob_asset: Path, tmp_path: Path
) -> None:
    output = tmp_path / "cut.glb"
    said = umbel_command("extract", blob_asset, "--triangles", 2000, "-o", output, "--json").json
    mesh = umbel.load(output)
    assert len(mesh.triangles) == said["triangles"] <= 2000 and is_closed(mesh)
    assert len(mesh.positions) == said["vertices"] and said["max_error"] > 0
    error = said["max_error"]
    said = umbel_command("extract", blob_asset, "--error", error, "-o", output, "--json").json
    assert said["max_error"] <= error * (1 + 1e-6) and said["triangles"] <= 2000
    assert said["input"] == str(blob_asset) and said["output"] == str(output)
    coarse = umbel_command("extract", blob_asset, "--error", "inf", "-o", output, "--json").json
    built = umbel_command("info", blob_asset, "--json").json
    assert coarse["triangles"] == built["root_triangles"]


def test_cluster_says_how_good_they_are(umbel_command: Umbel, blob_ply: Path) -> None:
    done = umbel_command("cluster", blob_ply, "--json")
    assert done.status == 0 and done.err == "" and set(CLUSTER_FIELDS) <= set(done.json)
    assert done.json["max_size"] <= 128 and 0.5 < done.json["mean_fill"] <= 1


def test_cluster_takes_all_its_flags(umbel_command: Umbel, blob_ply: Path) -> None:
    flags = "--method bisect --device cpu --max-triangles 60 --min-triangles 30 --underfill 0.2"
    flags += " --overlap 0.1 --weights shared-vertices --preset fast --threads 1"
    said = umbel_command("cluster", blob_ply, *flags.split(), "--json").json
    assert said["max_size"] <= 60 and said["min_size"] >= 1
    said = umbel_command("cluster", blob_ply, "--max-vertices", 40, "--json").json
    assert said["max_vertices"] <= 40
    flags = ("--max-vertices", 40, "--vertex-underfill", 0, "--presplit", 300)
    cheap = umbel_command("cluster", blob_ply, *flags, "--json").json
    assert cheap["max_vertices"] <= 40 and cheap["clusters"] != said["clusters"]
    alone = umbel_command("cluster", blob_ply, "--vertex-underfill", 0.1, "--json").json
    assert alone["warnings"] == ["--vertex-underfill has no effect: it is for --max-vertices"]
    done = umbel_command("cluster", blob_ply, "--vertex-underfill", 2)
    assert done.status == 1 and "--vertex-underfill" in done.err
    morton = umbel_command("cluster", blob_ply, "--method", "morton", "--json").json
    assert morton["mean_fill"] == pytest.approx(1.0)


def test_cluster_warns_of_flags_that_its_method_does_not_have(
    umbel_command: Umbel, small_ply: Path
) -> None:
    for method, flags in (
        ("morton", ("--max-vertices", 20)),
        ("morton", ("--min-triangles", 9)),
        ("morton", ("--preset", "exact")),
        ("hybrid", ("--overlap", 0.5)),
        ("hybrid", ("--weights", "shared-vertices")),
        ("morton", ("--weights", "shared-vertices=0.3,normals=2")),
    ):
        done = umbel_command("cluster", small_ply, "--method", method, *flags, "--json")
        (said,) = done.json["warnings"]
        assert f"{flags[0]} has no effect: it is for --method bisect" in said
    done = umbel_command("cluster", small_ply, "--method", "hybrid", "--max-vertices", 20, "--json")
    assert done.json["max_vertices"] <= 20


def test_cluster_weights_leave_fewer_vertices(umbel_command: Umbel, blob_ply: Path) -> None:
    flags = ("--max-triangles", 40, "--json")
    plain = umbel_command("cluster", blob_ply, *flags).json
    weighed = umbel_command("cluster", blob_ply, "--weights", "shared-vertices", *flags).json
    assert plain["ratio_cut"] == 0 and weighed["ratio_cut"] > 0
    assert weighed["mean_vertices"] < plain["mean_vertices"]
    all_vertices = [said["mean_vertices"] * said["clusters"] for said in (plain, weighed)]
    assert all_vertices[1] < 1.01 * all_vertices[0]


def test_cluster_writes_arrays_and_colours(
    umbel_command: Umbel, blob_ply: Path, tmp_path: Path
) -> None:
    said = umbel_command("cluster", blob_ply, "-o", tmp_path / "c.npz", "--json").json
    with np.load(tmp_path / "c.npz") as arrays:
        assert np.array_equal(np.sort(arrays["items"]), np.arange(20_480))
        assert len(arrays["offsets"]) == said["clusters"] + 1
        assert arrays["items"].dtype == arrays["offsets"].dtype == np.uint32
    assert umbel_command("cluster", blob_ply, "-o", tmp_path / "c.glb").status == 0
    shown = umbel.load(tmp_path / "c.glb")
    assert np.array_equal(
        triangle_keys(shown, attributes=False),
        triangle_keys(umbel.shapes.blob(5), attributes=False),
    )
    first = shown.colors[shown.triangles[:, 0]]
    assert len(np.unique(first, axis=0)) > said["clusters"] // 2


def test_cuda_that_is_not_there_is_one_sentence(umbel_command: Umbel, blob_ply: Path) -> None:
    done = umbel_command("cluster", blob_ply, "--device", "cuda")
    assert done.status == 1 and "CUDA" in done.err and len(done.err.splitlines()) == 1
    done = umbel_command("cluster", blob_ply, "--device", "cuda", "--method", "bisect")
    assert done.status == 1 and "morton and hybrid" in done.err


@pytest.mark.parametrize("method", ["morton", "hybrid"])
def test_a_device_makes_the_clusters_of_the_processor(
    umbel_command: Umbel,
    blob_ply: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    method: str,
) -> None:
    packaged("processor", monkeypatch)
    here, there = tmp_path / "here.npz", tmp_path / "there.npz"
    said = umbel_command("cluster", blob_ply, "--method", method, "-o", here, "--json").json
    given = ("--device", "cuda", "--method", method)
    done = umbel_command("cluster", blob_ply, *given, "-o", there, "--json")
    assert done.status == 0, done.err
    found = done.json
    for result in (said, found):
        for name in ("output", "seconds", "triangles_per_second", "file_bytes"):
            result.pop(name)
    assert found == said
    with np.load(here) as one, np.load(there) as other:
        assert np.array_equal(one["items"], other["items"])
        assert np.array_equal(one["offsets"], other["offsets"])


@pytest.mark.parametrize("builder", ["fast", "quality", "kmeans-q2"])
def test_a_device_builds_a_tree(
    umbel_command: Umbel, blob_ply: Path, monkeypatch: pytest.MonkeyPatch, builder: str
) -> None:
    packaged("processor", monkeypatch)
    given = ("bvh", blob_ply, "--builder", builder, "--json")
    done = umbel_command(*given, "--device", "cuda")
    assert done.status == 0, done.err
    found, said = done.json, umbel_command(*given).json
    assert found.keys() == said.keys()
    assert found["references"] == found["triangles"] == said["triangles"]
    assert 0.8 * said["sah_cost"] < found["sah_cost"] < 1.6 * said["sah_cost"]
    assert found["max_depth"] <= 32
    assert found["nodes"] - 1 + found["leaves"] >= 8 ** (found["max_depth"] // 3)
    assert found["bytes"] == 80 * found["nodes"] + 48 * found["references"]
    assert found["primary_mrays_per_second"] > 0 and found["diffuse_mrays_per_second"] > 0
    done = umbel_command(*given, "--device", "cuda", "--bins", "8")
    assert done.status == 1 and "--bins" in done.err
    done = umbel_command(*given, "--device", "cuda", "--width", "4")
    assert done.status == 1 and "width" in done.err


def test_plain_output_has_a_line_a_field(umbel_command: Umbel, blob_asset: Path) -> None:
    done = umbel_command("info", blob_asset)
    assert "input_triangles: 20,480" in done.out.splitlines()
    assert "\x1b" not in done.out


def test_a_terminal_gets_a_table_and_a_progress_bar(blob_ply: Path, tmp_path: Path) -> None:
    said = _on_a_terminal("build", blob_ply, "-o", tmp_path / "a.umbel", patience=0)
    assert "20,480 triangles" in said and "million triangles/s" in said
    assert "%" in said and "━" in said


def test_what_is_done_soon_shows_no_bar(blob_ply: Path, tmp_path: Path) -> None:
    said = _on_a_terminal("build", blob_ply, "-o", tmp_path / "a.umbel", patience=1e9)
    assert "20,480" in said and "100%" not in said and "━" not in said


def test_a_narrow_terminal_shows_values(blob_asset: Path) -> None:
    said = _on_a_terminal("info", blob_asset, patience=1e9, columns=30)
    assert "20,480" in said


def _on_a_terminal(*arguments: object, patience: float, columns: int = 100) -> str:
    """What the command shows at a terminal; with bars for what takes longer than `patience`."""
    program = (
        f"import umbel.cli, umbel.cli.progress as p; p.PATIENCE = {patience}; umbel.cli.main()"
    )
    main, other = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": str(columns)}
    process = subprocess.Popen(
        [sys.executable, "-c", program, *map(str, arguments)],
        stdout=other,
        stderr=other,
        stdin=other,
        env=environment,
    )
    os.close(other)
    said = b""
    while True:
        try:
            block = os.read(main, 65536)
        except OSError:  # Linux's way to say that the terminal's other side is closed
            break
        if not block:
            break
        said += block
    os.close(main)
    assert process.wait() == 0, said
    return said.decode()


@pytest.mark.parametrize("command", ["build", "info", "verify", "extract", "cluster"])
def test_every_command_has_help_and_the_common_flags(umbel_command: Umbel, command: str) -> None:
    done = umbel_command(command, "--help", env={**os.environ, "COLUMNS": "200"})
    assert done.status == 0 and "--json" in done.out and "--threads" in done.out


def test_help_needs_no_heavy_modules(umbel_command: Umbel) -> None:
    done = umbel_command("--help", env={**os.environ, "PYTHONPROFILEIMPORTTIME": "1"})
    assert done.status == 0
    imported = {line.rpartition("|")[2].strip() for line in done.err.splitlines()}
    assert "umbel.cli" in imported
    assert not imported & {"numpy", "umbel._umbel", "matplotlib", "trimesh"}


def test_version(umbel_command: Umbel) -> None:
    assert umbel_command("--version").out.split() == ["umbel", umbel.__version__]


def test_json_is_one_object_on_one_line(umbel_command: Umbel, blob_asset: Path) -> None:
    out = umbel_command("info", blob_asset, "--json").out
    assert out.count("\n") == 1 and isinstance(json.loads(out), dict)
