"""`umbel build`: bits of attributes, costs of clusters and groups."""

from __future__ import annotations

from pathlib import Path

import umbel
from helpers.commands import Umbel
from helpers.meshes import decorated_blob


def test_build_takes_bits_of_attributes_and_costs_of_clusters(
    umbel_command: Umbel, blob_ply: Path, tmp_path: Path
) -> None:
    output = tmp_path / "out.umbel"
    mesh = decorated_blob(4)
    source = tmp_path / "rich.glb"
    umbel.save(source, mesh)
    bits = ["--normal-bits", 9, "--uv-bits", 11, "--color-bits", 0]
    done = umbel_command("build", source, "-o", output, "--precision", "16bits", *bits)
    assert done.status == 0, done.err
    info = umbel.Asset(output).info
    assert (info["normal_bits"], info["tangent_bits"], info["color_bits"]) == (9, 8, 0)
    assert info["uv_step"] == 2**-11

    costs = ["--underfill", 0.75, "--vertex-underfill", 0.25, "--overlap", 0.5]
    groups = ["--group-underfill", 0.125, "--group-overlap", 1, "--min-triangles", 40]
    done = umbel_command("build", blob_ply, "-o", output, *costs, *groups, "--lock-borders")
    assert done.status == 0, done.err
    config = umbel_command("info", output, "--json").json["config"]
    names = ("underfill_cost", "vertex_underfill_cost", "overlap_cost")
    assert [config[name] for name in names] == [0.75, 0.25, 0.5]
    assert [config[f"group_{name}"] for name in (names[0], names[2])] == [0.125, 1]
    assert config["min_triangles"] == 40 and config["lock_borders"] is True

    for wrong in (
        *(["--normal-bits", 17], ["--uv-bits", 25], ["--tangent-bits", 1], ["--underfill", 2]),
        *(["--group-overlap", -1], ["--min-triangles", 300]),
    ):
        done = umbel_command("build", blob_ply, "-o", tmp_path / "no.umbel", *wrong, "--json")
        assert done.status == 1 and done.json["error"].count(wrong[0]) == 1
        assert not (tmp_path / "no.umbel").exists()


def test_flags_that_have_no_effect_on_a_build_are_named(
    umbel_command: Umbel, small_ply: Path, tmp_path: Path
) -> None:
    one = ("build", small_ply, "-o", tmp_path / "out.umbel", "--json")
    flags = ("--jobs", 2, "--keep-going", "--attributes", "none", "--seams", "protect")
    done = umbel_command(*one, *flags, "--uv-bits", 12)
    removed = "it is for attributes, and --attributes none removes them"
    assert done.json["warnings"] == [
        "--jobs has no effect: it is for several assets",
        "--keep-going has no effect: it is for several assets",
        f"--seams has no effect: {removed}",
        f"--uv-bits has no effect: {removed}",
    ]
    done = umbel_command(*one, "--seams", "protect", "--uv-bits", 12)
    assert done.status == 0 and done.json["warnings"] == [] and done.err == ""
    many = ("build", small_ply, "-o", f"{tmp_path}/", "--jobs", 2, "--keep-going")
    assert "no effect" not in umbel_command(*many).err
