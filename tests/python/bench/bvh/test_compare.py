"""`umbel bench bvh`: what it compares, how it normalises, what it writes, how it ends."""

from __future__ import annotations

import csv
import dataclasses
import importlib.util
import math
import re
import time
from pathlib import Path

import numpy as np
import pytest

import umbel
from helpers.commands import Umbel
from umbel.accel.tree_options import builders
from umbel.accel.trees import build_bvh2, kmeans_times
from umbel.bench.bvh import columns, methods, paths, report, totals, tracing
from umbel.bench.bvh import compare as bench
from umbel.bench.bvh import kmeans as bvh_kmeans
from umbel.bench.bvh.plant import GROUND, plant
from umbel.bench.bvh.scenes import PRESETS, SETTINGS, Kmeans, scene
from umbel.bench.timing import Span

HAS_MATPLOTLIB = importlib.util.find_spec("matplotlib") is not None
QUICK = methods.Effort(runs=1, share=0.003, threads=1)


@pytest.fixture(scope="module")
def blob() -> umbel.Mesh:
    return umbel.shapes.blob(4)


@pytest.fixture(scope="module")
def found(blob: umbel.Mesh) -> bench.Comparison:
    return bench.compare({"blob": lambda: blob}, QUICK)


def row(builder: str, build: float, sample: float, **changes: object) -> dict:
    """One as `normalised` and `cheapest` take it."""
    given = {
        "scene": "s",
        "width": 2,
        "builder": builder,
        "build_seconds": build,
        "widen_seconds": 0.0,
        "sample_seconds": sample,
        "sample_rays": 5e6,
        "sah_cost": 100.0,
        "epo": 10.0,
        "mrays_per_second": 1 / sample,
    }
    return given | changes


def test_ratios_are_to_a_full_sweep_that_takes_no_time() -> None:
    sweep, other = totals.normalised(
        [
            row("sweep", 5.0, 0.5, widen_seconds=1.0),
            row("lbvh", 1.5, 0.625, widen_seconds=0.5, sah_cost=150.0, epo=25.0),
        ]
    )
    assert (sweep["lq_seconds"], sweep["hq_seconds"]) == (10.0, 70.0)  # its own build counts here
    assert (other["lq_seconds"], other["hq_seconds"]) == (7.0, 82.0)
    assert all(sweep[key] == 1.0 for key in columns.RATIOS)
    assert [other[key] for key in columns.RATIOS] == [1.5, 2.5, 0.8, 7.0 / 4.0, 82.0 / 64.0]


def test_ratios_stay_within_a_scene_and_a_width() -> None:
    rows = [
        row("sweep", 1.0, 1.0),
        row("sweep", 1.0, 0.5, width=8),
        row("sweep", 1.0, 4.0, scene="t", epo=None),
        row("lbvh", 0.0, 0.5, width=8),
        row("lbvh", 0.0, 2.0, scene="t", epo=None),
    ]
    ratios = [(r["hq_ratio"], r["epo_ratio"]) for r in totals.normalised(rows)]
    assert ratios == [(1, 1), (1, 1), (1, None), (1, 1), (0.5, None)]


def test_the_cheapest_builder_is_the_lower_envelope() -> None:
    rows = [
        row("sweep", 9.0, 1.0),
        row("lbvh", 1.0, 3.0),
        row("binned", 2.0, 2.0),
        row("never", 8.0, 1.9),  # crosses binned after sweep has taken over
        row("worse", 4.0, 4.0),
    ]
    chosen = [(r["builder"], r["from_samples"]) for r in totals.cheapest(rows)]
    assert chosen == [("lbvh", 0.0), ("binned", 1.0), ("sweep", 7.0)]
    rays = [r["from_mrays"] for r in totals.cheapest(rows)]
    assert rays == pytest.approx([0.0, 5.0, 35.0])
    for samples in np.linspace(0.0, 20.0, 41):
        (best,) = [name for name, begin in chosen if begin <= samples][-1:]
        cost = {r["builder"]: r["build_seconds"] + samples * r["sample_seconds"] for r in rows}
        assert cost[best] == pytest.approx(min(cost.values()))


def test_a_sample_is_scaled_from_the_paths_to_the_pixels() -> None:
    pixels = 64 * 48
    tallies = [
        tracing.Tally(2.0, pixels // 4, 4000),
        tracing.Tally(1.0, pixels // 2, 8000),
    ]
    figures = tracing.trace_figures(tallies, pixels)
    assert figures == {
        "rays": 12000,
        "mrays_per_second": pytest.approx(0.004),
        "view1_mrays_per_second": pytest.approx(0.002),
        "view2_mrays_per_second": pytest.approx(0.008),
        "sample_seconds": pytest.approx((8.0 + 2.0) / 2),
        "sample_rays": pytest.approx(16_000),
    }


def test_every_builder_is_compared_at_every_width(
    found: bench.Comparison, blob: umbel.Mesh
) -> None:
    published = dict(methods.PUBLISHED.values())
    names = [*builders(), *published, "best", *methods.STRUCTURES]
    for width in (2, 8):
        own = [r for r in found.rows if r["width"] == width]
        assert own[0]["builder"] == "sweep" and sorted(r["builder"] for r in own) == sorted(names)
    for r in found.rows:
        if r["builder"] in methods.STRUCTURES:
            structure = methods.STRUCTURES[r["builder"]](blob, cost=(3, 2))
            assert r["sah_cost"] == structure.statistics()["sah_cost"] and r["epo"] is None
            assert r["build_seconds"] > 0 and r["mrays_per_second"] > 0 and r["hq_ratio"] > 0
            continue
        settings = published.get(r["builder"], {})
        tree = build_bvh2(blob, builder=r["builder"].split()[0], **settings)
        assert r["sah_cost"] == tree.sah_cost((3, 2)) and r["epo"] == tree.epo((3, 2))
        assert r["build_seconds"] > 0 and r["mrays_per_second"] > 0 and r["hq_ratio"] > 0
        assert r["lq_seconds"] == pytest.approx(
            r["build_seconds"] + r["widen_seconds"] + 8 * r["sample_seconds"]
        )
    assert len({r["rays"] for r in found.rows}) == 1  # the same for all
    assert found.settings == {"blob": "k 8, p 5, i 2"}
    for mean in found.means:  # of one scene: its own
        (own,) = [
            r for r in found.rows if (r["width"], r["builder"]) == (mean["width"], mean["builder"])
        ]
        assert mean["sah_ratio"] == pytest.approx(own["sah_ratio"])


def test_kmeans_is_taken_apart(found: bench.Comparison) -> None:
    assert list(dict.fromkeys(r["preset"] for r in found.stages)) == list(PRESETS)
    for r in found.stages:
        assert r["seconds"] >= 0 and r["stage"]
        assert Kmeans(r["clusters"], r["candidates"], r["iterations"]) == PRESETS[r["preset"]]
    tried = {(r["builder"], r["clusters"], r["iterations"]) for r in found.iterations}
    ways = [(v, k) for v in bvh_kmeans.VARIANTS for k, _ in bvh_kmeans.SEEDED]
    assert tried == {(v, k, i) for v, k in ways for i in bvh_kmeans.COUNTS}
    (sweep,) = {r["sweep"] for r in found.iterations}
    assert sweep == next(r["sah_cost"] for r in found.rows if r["builder"] == "sweep")


def test_stages_are_scaled_to_processor_time() -> None:
    seconds = bvh_kmeans.processor_seconds({"seeding": 1.0, "iterations": 2.0}, 8.0, 4.0)
    assert seconds == {"seeding": 0.5, "iterations": 1.0, "other": 2.5}


def test_stages_make_a_whole(blob: umbel.Mesh) -> None:
    began = time.perf_counter()
    stages = kmeans_times(blob, clusters=16, iterations=5)
    whole = time.perf_counter() - began
    assert set(stages) | {"other"} == set(bvh_kmeans.STAGE_NAMES)
    assert all(seconds > 0 for seconds in stages.values()) and sum(stages.values()) < whole


def test_parts_can_be_left_out(blob: umbel.Mesh) -> None:
    effort = methods.Effort(runs=1, threads=1, parts=("stages",))
    only = bench.compare({"blob": lambda: blob}, effort, kmeans=Kmeans(4, 2, 1))
    assert only.stages and not only.rows and not only.iterations and not only.means
    assert "SAH cost" not in report.report(only) and only.settings == {"blob": "k 4, p 2, i 1"}
    with pytest.raises(umbel.Error, match="stages, iterations, not rays"):
        bench.compare({"blob": lambda: blob}, methods.Effort(parts=("rays",)))


def test_builders_can_be_chosen(blob: umbel.Mesh) -> None:
    effort = methods.Effort(
        1,
        share=0.003,
        widths=(2,),
        threads=1,
        parts=("builders",),
        builders=("ploc", "ploc 2018", "binned"),
    )
    chosen = bench.compare({"blob": lambda: blob}, effort)
    assert [row["builder"] for row in chosen.rows] == ["sweep", "binned", "ploc 2018", "ploc"]
    with pytest.raises(umbel.Error, match="no builder 'plock'"):
        methods.methods(Kmeans(8, 5, 2), ["plock"])


def test_whole_pictures_are_traced_in_passes(blob: umbel.Mesh) -> None:
    effort = methods.Effort(
        runs=2,
        samples=20,
        share=1.0,
        resolution=(32, 16),
        widths=(2,),
        threads=1,
        parts=("builders",),
        builders=("lbvh",),
    )
    assert tracing.passes(20) == [8, 8, 4]
    sweep, lbvh = bench.compare({"blob": lambda: blob}, effort).rows
    assert sweep["rays"] == lbvh["rays"] > 3 * 20 * 32 * 16  # three views, and shadow rays
    for r in (sweep, lbvh):  # all of every picture was traced, so nothing is scaled up
        assert r["sample_rays"] == pytest.approx(r["rays"] / 3 / 20)
        assert r["sample_seconds"] == pytest.approx(
            r["rays"] / r["mrays_per_second"] * 1e-6 / 3 / 20
        )
    cameras = scene("blob", lambda: blob, size=(32, 16)).cameras
    first, second = (
        paths.camera_rays(cameras[0], 1, 1.0, np.random.default_rng(seed), (32, 16))
        for seed in (1, (1, 1))
    )
    assert len(first[1]) == 32 * 16 and not np.array_equal(first[1], second[1])


@pytest.mark.parametrize(
    ("samples", "share", "says"),
    [
        (8, 1.0, "8 paths a pixel of whole pictures were traced. .* LQ is measured, and HQ is 16"),
        (128, 1.0, "whole pictures were traced, each ray once. .* HQ is measured"),
        (2, 1.0, "whole pictures .* both in proportion"),
        (1, 0.05, "1 path a pixel in 0.05 of the pictures' tiles .* extrapolated"),
    ],
)
def test_the_report_says_what_is_extrapolated(
    found: bench.Comparison, samples: int, share: float, says: str
) -> None:
    effort = methods.Effort(samples=samples, share=share, resolution=(256, 192))
    text = report.report(dataclasses.replace(found, effort=effort))
    assert re.search(says, text) and "Three views of 256 x 192" in text
    assert ("extrapolated" in text) == (share < 1)


def test_a_comparison_can_be_cancelled(blob: umbel.Mesh) -> None:
    told: list[tuple[float, str]] = []

    def progress(fraction: float, what: str) -> bool:
        told.append((fraction, what))
        return len(told) < 9

    with pytest.raises(umbel.Cancelled):
        bench.compare({"blob": lambda: blob}, QUICK, progress=progress)
    fractions = [fraction for fraction, _ in told]
    assert len(told) == 9 and fractions == sorted(fractions)
    assert all(what.startswith("blob: ") for _, what in told)


def test_parts_of_progress_lie_within_their_whole() -> None:
    told = []
    span = Span(lambda fraction, what: told.append((fraction, what)), "x", 0.5)
    span.part(0.5, 1.0).part(0.0, 0.5)(0.5, "y")
    assert told == [(pytest.approx(0.5 + 0.5 * 0.625), "x: y")]


# The rays


def test_rays_do_not_depend_on_the_tree(blob: umbel.Mesh) -> None:
    (camera, *_) = scene("blob", lambda: blob).cameras
    views = [
        paths.path_view(umbel.Bvh(blob, builder=builder), blob, camera, share=0.01)
        for builder in ("sweep", "lbvh")
    ]
    assert views[0].paths == 31 * 256 and views[0].rays == views[1].rays > 31 * 256
    for one, other in zip(views[0].batches, views[1].batches, strict=True):
        assert one.shadow == other.shadow
        for a, b in zip(one.rays, other.rays, strict=True):
            assert np.array_equal(a, b)
            assert np.isfinite(a).all()


def test_camera_rays_pass_through_the_pixels(blob: umbel.Mesh) -> None:
    (camera, *_) = scene("blob", lambda: blob).cameras
    origins, directions = paths.camera_rays(camera, 2, 1.0, np.random.default_rng(1))
    assert len(origins) == 2 * paths.WIDTH * paths.HEIGHT
    assert np.allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-5)
    assert np.allclose(origins, camera.position)
    forward = np.array(camera.target) - np.array(camera.position)
    forward /= np.linalg.norm(forward)
    assert np.allclose(
        directions.mean(axis=0) / np.linalg.norm(directions.mean(axis=0)), forward, atol=1e-3
    )
    high = math.tan(camera.fov_y / 2)
    corner = math.atan(math.hypot(high, high * paths.WIDTH / paths.HEIGHT))
    angles = np.arccos(np.clip(directions @ forward, -1, 1))
    assert 0.98 * corner < angles.max() <= corner + 1e-3


def test_previews_show_the_silhouette() -> None:
    ball = umbel.shapes.sphere(5)
    made = scene("ball", lambda: ball)
    grey = paths.preview(umbel.Bvh(ball), ball, made.cameras[0])
    assert grey.shape == (180, 240) and (grey[0] == 255).all() and grey[90, 120] < 255
    # The ball just fills the picture: its disc, and nothing else, is darker than the sky.
    share = np.pi / 4 * (1 - 0.06) ** 2 * 180**2 / grey.size
    assert (grey < 255).mean() == pytest.approx(share, rel=0.1)


def test_a_share_of_a_picture_is_spread_over_it() -> None:
    x, y = paths._pixels(0.1)
    assert len(set(zip(x.tolist(), y.tolist(), strict=True))) == len(x) == 307 * 256
    quarters, _, _ = np.histogram2d(x, y, bins=4, range=[[0, 1024], [0, 768]])
    assert quarters.min() > 0.7 * quarters.mean()


def test_rooms_are_lit_from_where_they_are_seen() -> None:
    corners = np.array([[x, y, z] for x in (0, 8) for y in (0, 3) for z in (0, 5)], np.float32)
    walls = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    inward = umbel.Mesh(corners, [[w[0], w[i], w[i + 1]] for w in walls for i in (1, 2)])
    (camera, *others) = scene("room", lambda: inward).cameras
    assert all(view.position == camera.position for view in others)
    view = paths.path_view(umbel.Bvh(inward), inward, camera, share=0.01)
    shadows = [batch for batch in view.batches if batch.shadow]
    assert shadows and all(batch.t_max == 1 for batch in shadows)
    for batch in shadows:
        ends = batch.rays[0] + batch.rays[1]
        assert np.linalg.norm(ends - np.array(camera.position), axis=1).max() < 0.5


def test_known_scenes_have_three_views() -> None:
    for setting in SETTINGS:
        assert len(setting.cameras) == 3
    made = scene("Conference Room", lambda: umbel.shapes.blob(3))
    assert made.kmeans == Kmeans(8, 5, 2) and len(made.cameras) == 3
    assert scene("x", lambda: umbel.shapes.blob(3), Kmeans(4, 3, 2)).kmeans == Kmeans(4, 3, 2)


# The generated scene


def test_a_plant_has_about_the_triangles_asked_for() -> None:
    for triangles in (20_000, 100_000, 300_000):
        made = plant(triangles)
        assert len(made.triangles) == pytest.approx(triangles, rel=0.12)
        umbel.validate(made)
        assert np.abs(made.positions[:, [0, 2]]).max() <= GROUND / 2 + 1
        assert np.ptp(made.positions[:, 1]) < GROUND / 2
    again = plant(300_000)
    assert np.array_equal(made.positions, again.positions)
    assert np.array_equal(made.triangles, again.triangles)
    assert not np.array_equal(made.positions, plant(300_000, seed=2).positions)


@pytest.mark.parametrize("triangles", [0, 100, 10**9])
def test_a_plant_of_a_wrong_size_is_refused(triangles: int) -> None:
    with pytest.raises(umbel.Error, match="20,000 to 50,000,000"):
        plant(triangles)


# The command


def test_command_writes_tables_and_charts(umbel_command: Umbel, tmp_path: Path) -> None:
    mesh, folder = tmp_path / "a mesh.ply", tmp_path / "new" / "folder"
    umbel.save(mesh, umbel.shapes.blob(3))
    done = umbel_command(
        *["bench", "bvh", mesh, "-o", folder, "--runs", 1, "--threads", 1, "--json"],
        *["--share", 0.002, "--width", 4, "--kmeans", "6,3,1"],
    )
    assert done.status == 0, done.err
    said = done.json
    assert set(said) >= {"rows", "means", "cheapest", "stages", "iterations", "kmeans", "machine"}
    assert {r["width"] for r in said["rows"]} == {4} and said["share"] == 0.002
    assert said["resolution"] == [1024, 768]
    assert said["kmeans"] == {"a mesh": "k 6, p 3, i 1"}

    for name, rows in {
        "bvh": said["rows"],
        "bvh_cheapest": said["cheapest"],
        "bvh_stages": said["stages"],
        "bvh_iterations": said["iterations"],
    }.items():
        with (folder / f"{name}.csv").open(newline="") as file:
            read = list(csv.DictReader(file))
        assert len(read) == len(rows)
        for line, r in zip(read, rows, strict=True):
            assert line == {key: "" if value is None else str(value) for key, value in r.items()}
    text = (folder / "bvh.md").read_text()
    for r in said["rows"]:
        assert re.search(rf"\| 4 \| {r['builder']} \| .* \| {r['sah_cost']:.1f} \|", text)
    assert "zero build time" in text and said["machine"]["cpu"] in text

    images = {f"bvh_a_mesh_{kind}.png" for kind in ("width4", "stages", "iterations", "views")}
    if HAS_MATPLOTLIB:
        for name in images:
            data = (folder / name).read_bytes()
            assert data.startswith(b"\x89PNG\r\n\x1a\n") and 3000 < len(data) < 150_000
    written = {path.name for path in folder.iterdir()} - images
    tables = {"bvh.csv", "bvh_cheapest.csv", "bvh_stages.csv", "bvh_iterations.csv"}
    assert written == {"bvh.md"} | tables


def test_without_scenes_one_is_made(umbel_command: Umbel) -> None:
    done = umbel_command(
        *["bench", "bvh", "--generated", 20_000, "--part", "stages", "--runs", 1],
    )
    assert done.status == 0, done.err
    assert done.out.startswith("# Builders") and "| plant | Q5 | 64 | 30 | 15 |" in done.out


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--width", 3), "2, 4 or 8"),
        (("--kmeans", "8,5"), "8,5,2"),
        (("--resolution", "640"), "1024x768"),
        (("--resolution", "640x360"), "--resolution must be multiples of 16, not 640 x 360"),
        (("--kmeans", "8,5,x"), "8,5,2"),
        (("--kmeans", "1,5,2", "--part", "builders"), "first number of --kmeans"),
        (("--part", "rays"), "builders, stages, iterations, not rays"),
        (("--generated", 5), "20,000"),
        (("nothing.ply",), "no such file"),
    ],
)
def test_faults_end_with_one_sentence(
    umbel_command: Umbel, arguments: tuple[object, ...], word: str
) -> None:
    done = umbel_command("bench", "bvh", *arguments, "--json")
    assert done.status == 1 and word in done.json["error"]
    assert word in done.err and len(done.err.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("mesh", "word"),
    [
        (umbel.Mesh(np.zeros((3, 3), np.float32), np.zeros((0, 3), np.uint32)), "no triangles"),
        (umbel.Mesh(np.full((3, 3), np.nan, np.float32), [[0, 1, 2]]), "finite"),
    ],
)
def test_meshes_at_fault_are_refused(mesh: umbel.Mesh, word: str) -> None:
    with pytest.raises(umbel.Error, match=word):
        bench.compare({"bad": lambda: mesh}, QUICK)


def test_a_mesh_without_area_is_compared() -> None:
    flat = umbel.Mesh(np.zeros((9, 3), np.float32), np.arange(9).reshape(3, 3))
    found = bench.compare({"flat": lambda: flat}, QUICK)
    assert len(found.rows) == 2 * (len(methods.methods(PRESETS["Q2"])) + len(methods.STRUCTURES))


@pytest.mark.parametrize("arguments", [("--runs", "0"), ("--share", "2"), ("--samples", "0")])
def test_wrong_usage_exits_with_2(umbel_command: Umbel, arguments: tuple[str, ...]) -> None:
    assert umbel_command("bench", "bvh", *arguments).status == 2
