"""`umbel bvh`: its fields, its settings, its files, and what it says when something is wrong."""

from __future__ import annotations

import os
import resource
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import umbel
from helpers.commands import DATA, Outcome, Umbel

FIELDS = [
    *("builder", "nodes", "leaves", "max_depth", "sah_cost", "epo", "build_seconds"),
    *("primary_mrays_per_second", "diffuse_mrays_per_second", "bytes"),
]
BUILDERS = umbel.bvh.builders()
Run = Callable[..., Outcome]


@pytest.fixture
def bvh_command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Runs `umbel bvh ARGUMENTS` in this process, with small pictures: starting Python and tracing
    large ones is most of what the command takes."""
    from umbel.cli import structures
    from umbel.cli.app import app

    monkeypatch.setattr(structures, "PICTURE", 32)

    def run(*arguments: object) -> Outcome:
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            app(["bvh", *map(str, arguments)], prog_name="umbel")
        out, err = capsys.readouterr()
        return Outcome(int(ended.value.code or 0), out, err)

    return run


def test_fields_are_those_of_the_contract(umbel_command: Umbel, blob_ply: Path) -> None:
    done = umbel_command("bvh", blob_ply, "--json")
    assert done.status == 0 and done.err == ""
    said = done.json
    assert set(FIELDS) <= set(said)
    tree = umbel.build_bvh2(blob_ply)
    found = tree.statistics((3, 2))
    for field in ("nodes", "leaves", "max_depth", "references", "sah_cost"):
        assert said[field] == found[field]
    assert said["epo"] == tree.epo((3, 2))
    assert said["triangles"] == 20_480 and said["builder"] == "quality" and said["width"] == 8
    assert said["bytes"] == umbel.Bvh(blob_ply).statistics()["bytes"]
    for field in ("build_seconds", "primary_mrays_per_second", "diffuse_mrays_per_second"):
        assert said[field] > 0


def test_text_says_the_same(bvh_command: Run, small_ply: Path) -> None:
    done = bvh_command(small_ply)
    assert done.status == 0
    fields = list(bvh_command(small_ply, "--json").json)
    fields.remove("warnings")  # are said on standard error
    assert [line.partition(":")[0] for line in done.out.splitlines()] == fields


@pytest.mark.parametrize("builder", [*umbel.bvh.PRESETS, *BUILDERS, "kmeans-q2", "aac-hq"])
def test_every_builder_builds(bvh_command: Run, small_ply: Path, builder: str) -> None:
    said = bvh_command(small_ply, "--builder", builder, "--json").json
    assert said["builder"] == builder
    expected = umbel.build_bvh2(small_ply, builder=builder).statistics((3, 2))
    assert said["nodes"] == expected["nodes"] and said["sah_cost"] == expected["sah_cost"]
    assert 0 < said["epo"] < said["sah_cost"] and said["primary_mrays_per_second"] > 0


def test_every_setting_arrives(bvh_command: Run, small_ply: Path) -> None:
    plain = {b: umbel.build_bvh2(small_ply, builder=b).statistics((3, 2)) for b in BUILDERS}
    for builder, flags in (
        ("binned", "--max-leaf-size 1"),
        ("binned", "--max-depth 11"),
        ("binned", "--bins 4"),
        ("binned", "--reinsertion-rounds 3"),
        ("kmeans", "--clusters 3"),
        ("kmeans", "--candidates 1"),
        ("kmeans", "--iterations 0"),
        ("kmeans", "--distance manhattan"),
        ("aac", "--aac-leaf-size 40"),
        ("aac", "--aac-epsilon 0"),
        ("hlbvh", "--hlbvh-bits 3"),
        ("ploc", "--ploc-radius 1"),
        ("atrbvh", "--treelet-size 3"),
        ("atrbvh", "--treelet-rounds 1"),
    ):
        if builder not in BUILDERS:
            continue
        said = bvh_command(small_ply, "--builder", builder, *flags.split(), "--json").json
        key, value = flags[2:].replace("-", "_").split()
        option = {key: value if key == "distance" else float(value) if "." in value else int(value)}
        expected = umbel.build_bvh2(small_ply, builder=builder, **option).statistics((3, 2))
        assert said["sah_cost"] == expected["sah_cost"], flags
        assert said["sah_cost"] != plain[builder]["sah_cost"], flags


def test_clusters_of_kmeans_are_measured_as_they_are(bvh_command: Run, small_ply: Path) -> None:
    run = bvh_command(small_ply, "--builder", "kmeans", "--kary", "--clusters", 8, "--json").json
    tree = umbel.build_kary(small_ply, clusters=8, cost=(3.0, 2.0), max_leaf_size=8)
    assert run["nodes"] == len(tree.nodes)
    assert run["sah_cost"] == pytest.approx(tree.sah_cost())
    assert run["epo"] is None
    assert run["wide_nodes"] == run["nodes"] - run["leaves"]
    wrong = bvh_command(small_ply, "--builder", "sweep", "--kary")
    assert wrong.status == 1 and "kmeans" in wrong.err


def test_forms_and_costs(bvh_command: Run, small_ply: Path) -> None:
    plain = bvh_command(small_ply, "--json").json
    for width in (2, 4):
        said = bvh_command(small_ply, "--width", width, "--json").json
        assert said["width"] == width and said["wide_nodes"] > plain["wide_nodes"]
        assert said["sah_cost"] == plain["sah_cost"]
    compact = bvh_command(small_ply, "--compact", "--json").json
    assert compact["bytes"] < 0.8 * plain["bytes"]
    costly = bvh_command(small_ply, "--cost", "1,10", "--json").json
    assert costly["leaves"] > plain["leaves"]
    one = bvh_command(small_ply, "--threads", 1, "--json").json
    assert one["sah_cost"] == plain["sah_cost"]
    for flags in (["--morton-bits", 30], ["--spatial-budget", 1], ["--spatial-overlap", 0.5]):
        assert bvh_command(small_ply, "--builder", "sbvh", *flags, "--json").status == 0


def test_the_file_holds_the_hierarchy(bvh_command: Run, small_ply: Path, tmp_path: Path) -> None:
    output = tmp_path / "small.umbvh"
    said = bvh_command(small_ply, "-o", output, "--width", 4, "--json").json
    assert said["file_bytes"] == output.stat().st_size
    loaded = umbel.Bvh.load(output)
    assert loaded.statistics()["width"] == 4 and loaded.statistics()["bytes"] == said["bytes"]
    directions = np.random.default_rng(1).normal(size=(50, 3))
    expected = umbel.Bvh(small_ply).intersect([0, 0, 0], directions)
    assert np.array_equal(loaded.intersect([0, 0, 0], directions).t, expected.t)
    again = tmp_path / "again.umbvh"
    bvh_command(small_ply, "--output", again, "--width", 4, "--threads", 1)
    assert again.read_bytes() == output.read_bytes()


def test_meshes_without_surface_are_measured(bvh_command: Run, tmp_path: Path) -> None:
    empty = tmp_path / "empty.ply"
    umbel.save(empty, umbel.Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.uint32)))
    said = bvh_command(empty, "--json", "-o", tmp_path / "empty.umbvh").json
    assert said["nodes"] == 0 and said["sah_cost"] == 0 and said["epo"] == 0
    assert (
        said["primary_mrays_per_second"] == 0 and len(umbel.Bvh.load(tmp_path / "empty.umbvh")) == 0
    )
    line = tmp_path / "line.ply"
    umbel.save(line, umbel.Mesh([[0, 0, 0], [1, 1, 1], [2, 2, 2]], [[0, 1, 2], [0, 0, 0]]))
    for builder in BUILDERS:
        said = bvh_command(line, "--builder", builder, "--json").json
        assert said["nodes"] >= 1 and said["diffuse_mrays_per_second"] >= 0


def test_mistakes_are_one_sentence(bvh_command: Run, small_ply: Path, tmp_path: Path) -> None:
    garbage = tmp_path / "garbage.ply"
    garbage.write_bytes(os.urandom(5000))
    nan = tmp_path / "nan.ply"
    positions = umbel.shapes.sphere(2).positions.copy()
    positions[3] = np.nan
    umbel.save(nan, umbel.Mesh(positions, umbel.shapes.sphere(2).triangles))
    for arguments, sentence in (
        ([tmp_path / "missing.ply"], "missing.ply"),
        ([garbage], "garbage.ply"),
        ([tmp_path], str(tmp_path)),
        ([nan], "not finite"),
        ([small_ply, "--builder", "magic"], "sweep"),
        ([small_ply, "--builder", "kmeans-q9"], "q1"),
        ([small_ply, "--width", 3], "--width"),
        ([small_ply, "--cost", "3"], "--cost"),
        ([small_ply, "--cost", "3,x"], "--cost"),
        ([small_ply, "--cost", "0,1"], "--cost"),
        ([small_ply, "--max-leaf-size", 0], "--max-leaf-size"),
        ([small_ply, "--max-leaf-size", -1], "--max-leaf-size"),
        ([small_ply, "--max-depth", 3], "--max-depth"),
        ([small_ply, "--bins", 1000], "--bins"),
        ([small_ply, "--spatial-budget", "nan"], "--spatial-budget"),
        ([small_ply, "--clusters", 1], "--clusters"),
        ([small_ply, "--morton-bits", 31], "--morton-bits"),
        ([small_ply, "--device", "cuda"], "CUDA"),
        ([small_ply, "-o", tmp_path / "out.txt"], ".umbvh"),
        ([small_ply, "-o", tmp_path / "no" / "out.umbvh"], "no folder"),
        ([small_ply, "-o", "/proc/out.umbvh"], "out.umbvh"),
    ):
        done = bvh_command(*arguments, "--json")
        assert done.status == 1, arguments
        assert done.json == {"error": done.err[len("umbel: ") : -1], "input": str(arguments[0])}
        assert done.err.startswith("umbel: ") and len(done.err.strip().splitlines()) == 1
        assert sentence in done.err, done.err
    assert sorted(os.listdir(tmp_path)) == ["garbage.ply", "nan.ply"]
    dropped = bvh_command(nan, "--drop-invalid", "--json").json
    assert dropped["triangles"] == 320 and dropped["references"] < 320


@pytest.mark.parametrize(
    "flags", [["--drop-invalid"], ["--drop-invalid", "--builder", "kmeans", "--kary"]]
)
def test_a_vertex_that_is_not_there_is_named_as_written(
    bvh_command: Run, tmp_path: Path, flags: list[str]
) -> None:
    bad = tmp_path / "bad.obj"
    bad.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 9\n", encoding="utf-8")
    done = bvh_command(bad, *flags)
    assert (done.status, done.out) == (1, "")
    assert f"{bad}, line 5: vertex index 9 is beyond the 3 there are;" in done.err


def test_usage_is_status_two(bvh_command: Run, small_ply: Path) -> None:
    for arguments in (
        [],
        [small_ply, "--bins", "many"],
        [small_ply, "--distance", "far"],
        [small_ply, "--device", "tpu"],
        [small_ply, "--threads", -1],
        [small_ply, "--no-such-flag"],
    ):
        done = bvh_command(*arguments)
        assert done.status == 2 and done.out == "" and done.err


def _small_files() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))


def test_a_full_disk_is_one_sentence(umbel_command: Umbel, small_ply: Path, tmp_path: Path) -> None:
    output = tmp_path / "out.umbvh"
    done = umbel_command("bvh", small_ply, "-o", output, preexec_fn=_small_files)
    assert done.status == 1 and done.out == "" and len(done.err.strip().splitlines()) == 1
    assert "Traceback" not in done.err and os.listdir(tmp_path) == []
    output.write_bytes(b"the old one")
    umbel_command("bvh", small_ply, "-o", output, preexec_fn=_small_files)
    assert output.read_bytes() == b"the old one" and os.listdir(tmp_path) == ["out.umbvh"]


@pytest.mark.parametrize(
    "name", sorted(p.name for p in DATA.glob("nasty_synth_*.ply")) if DATA.is_dir() else []
)
def test_nasty_meshes_are_measured(bvh_command: Run, data: Path, name: str) -> None:
    done = bvh_command(data / name, "--json")
    if name in ("nasty_synth_nan_inf.ply", "nasty_synth_index_out_of_range.ply"):
        assert done.status == 1 and len(done.err.strip().splitlines()) == 1
        return
    assert done.status == 0, done.err
    assert all(done.json[field] is not None for field in FIELDS)


def test_flags_that_have_no_effect_on_the_builder_are_named(
    bvh_command: Run, small_ply: Path
) -> None:
    for builder, flags, why in (
        ("quality", ("--treelet-size", 5), "it is for --builder atrbvh, not quality"),
        ("fast", ("--bins", 16), "it is for --builder binned, not fast"),
        ("kmeans-q2", ("--ploc-radius", 5), "it is for --builder ploc, not kmeans-q2"),
        ("kmeans", ("--max-depth", 50, "--kary"), "it is not for --kary"),
    ):
        done = bvh_command(small_ply, "--builder", builder, *flags)
        assert done.status == 0
        assert f"umbel: warning: {flags[0]} has no effect: {why}\n" in done.err
    used = ("--bins", 16, "--max-depth", 50, "--reinsertion-rounds", 1)
    assert bvh_command(small_ply, *used).err == ""
