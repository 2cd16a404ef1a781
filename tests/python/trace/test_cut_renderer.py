"""Pictures of assets within a budget, and the simulation of streaming."""

import io
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import umbel
from helpers.commands import Umbel
from umbel.bench import stream as bench
from umbel.io.textures.images import TextureImage
from umbel.trace.cut_renderer import CutRenderer


@pytest.fixture(scope="module")
def herd(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Nine blobs and a torus in one file."""
    lods = [
        umbel.build_lod(umbel.shapes.blob(5, seed=3), precision="14bits"),
        umbel.build_lod(umbel.shapes.torus(48, 24), precision="14bits"),
    ]
    places = []
    for k in range(9):
        matrix = np.eye(4)
        matrix[:3, 3] = (3 * (k % 3), 0, -3 * (k // 3))
        places.append((0, matrix))
    places.append((1, np.diag([2.0, 1.0, 1.0, 1.0])))
    path = tmp_path_factory.mktemp("herd") / "herd.umbel"
    umbel.save_asset(path, lods, places, page_bytes=16384)
    return path


def camera(error: float = 1.0) -> umbel.Camera:
    return umbel.Camera((3, 2, 8), target=(3, 0, -3), height=40, pixel_error=error)


def test_instances_share_what_they_show(herd: Path) -> None:
    asset = umbel.Asset(herd)
    renderer = CutRenderer(asset, camera(0.5), 64_000_000)
    one = asset.cut(error=0)
    assert renderer.pixel_error == 0.5
    assert renderer.triangles > 9 * 50
    assert renderer.bytes <= renderer.estimate <= 64_000_000
    assert len(one)
    # Many places cost far less than as many meshes.
    assert renderer.bytes < 0.5 * 110 * renderer.triangles


def test_a_budget_makes_errors_grow_until_it_is_kept(herd: Path) -> None:
    asset = umbel.Asset(herd)
    rich = CutRenderer(asset, camera(0.02), 64_000_000)
    poor = CutRenderer(asset, camera(0.02), rich.bytes // 4)
    assert rich.pixel_error == 0.02
    assert poor.pixel_error > 0.02
    assert poor.bytes <= rich.bytes // 4
    assert 0 < poor.triangles < rich.triangles
    with pytest.raises(umbel.Error, match=r"budget is 1000, but .* at least") as refused:
        CutRenderer(asset, camera(), 1000)
    least = int(str(refused.value).split()[-1])
    with pytest.raises(umbel.Error, match=f"at least {least}"):
        CutRenderer(asset, camera(), least - 1)
    try:  # the pages fit now
        CutRenderer(asset, camera(), least)
    except umbel.Error as error:
        assert "even the coarsest cut takes" in str(error)


class Failing(io.FileIO):
    """A file whose places each fail so many times before they can be read; its head never does."""

    failures = 0

    def read(self, count: int = -1) -> bytes:
        tries = self.__dict__.setdefault("tries", Counter())
        tries[self.tell()] += 1
        if self.tell() > 0 and tries[self.tell()] <= self.failures:
            raise OSError("the server is busy")
        return super().read(count)


def test_pages_that_fail_are_read_again_rather_than_shown_coarser(herd: Path) -> None:
    whole = CutRenderer(umbel.Asset(herd), camera(0.1), 64_000_000)
    file = Failing(herd)
    asset = umbel.Asset(file)
    residency = umbel.Residency(asset)  # reads the coarsest pages
    residency.close()
    file.tries.update(dict.fromkeys(file.tries, 2))
    file.failures = 2
    again = CutRenderer(asset, camera(0.1), 64_000_000)
    assert (again.pixel_error, again.triangles) == (whole.pixel_error, whole.triangles)
    file.failures = 1 << 30
    with pytest.raises(umbel.Error, match="the server is busy"):
        CutRenderer(asset, camera(0.1), 64_000_000)


def test_the_picture_is_that_of_the_same_scene_as_one_mesh(herd: Path) -> None:
    asset = umbel.Asset(herd)
    parts, first = [], 0
    triangles = []
    for mesh, matrix in asset.instances:
        part = asset.mesh(asset.mesh_tables(mesh).cut(level=0), mesh)
        parts.append(part.positions @ matrix[:, :3].T + matrix[:, 3])
        triangles.append(part.triangles + first)
        first += len(part.positions)
    whole = umbel.Mesh(np.concatenate(parts).astype(np.float32), np.concatenate(triangles))
    size = {"width": 48, "height": 36}
    expected = umbel.Renderer(whole).film(camera(), **size).add(16).pixels
    pixels = CutRenderer(asset, camera(0.05), 64_000_000).film(camera(), **size).add(16).pixels
    assert np.abs(pixels - expected).mean() < 0.03 * expected.mean()


def test_bounces_may_meet_a_coarser_cut(herd: Path) -> None:
    asset = umbel.Asset(herd)
    size = {"width": 48, "height": 36}
    fine = CutRenderer(asset, camera(0.1), 64_000_000)
    both = CutRenderer(asset, camera(0.1), 64_000_000, bounce_error=16)
    assert both.triangles == fine.triangles
    assert both.bytes > fine.bytes
    one = both.film(camera(), **size).add(32).pixels
    other = fine.film(camera(), **size).add(32).pixels
    assert 0 < np.abs(one - other).mean() < 0.05 * other.mean()
    with pytest.raises(umbel.Error, match="bounce_error"):
        CutRenderer(asset, camera(), 64_000_000, bounce_error=0.5)


def test_materials_may_be_hidden(umbel_command: Umbel, tmp_path: Path) -> None:
    lods = []
    for name, mesh in (
        ("body", umbel.shapes.blob(4, seed=1)),
        ("shell", umbel.shapes.torus(24, 12)),
    ):
        lods.append(
            umbel.build_lod(
                umbel.Mesh(
                    mesh.positions,
                    mesh.triangles,
                    material_ids=np.zeros(len(mesh.triangles), np.uint32),
                    materials=[umbel.Material(name=name)],
                )
            )
        )
    path = tmp_path / "a.umbel"
    umbel.save_asset(path, lods)
    asset = umbel.Asset(path)
    shown = {
        hide: CutRenderer(asset, camera(0.01), 64_000_000, hide=hide).triangles
        for hide in ((), ("sh*",), ("body",))
    }
    assert 0 < shown[("sh*",)] < shown[()]
    assert shown[("sh*",)] + shown[("body",)] == shown[()]
    with pytest.raises(umbel.Error, match="body, shell"):
        CutRenderer(asset, camera(), 64_000_000, hide=["nothing"])
    options = ["-o", tmp_path / "o.png", "--width", 24, "--height", 16, "--spp", 1, "--json"]
    said = umbel_command("render", path, *options, "--budget", "8MB", "--hide", "shell").json
    assert 0 < said["triangles"] <= shown[("sh*",)]


def test_textures_stay_where_other_meshes_have_no_uvs(tmp_path: Path) -> None:
    Image.new("RGB", (2, 2), (255, 0, 0)).save(tmp_path / "red.png")
    painted = umbel.Material(
        "painted", images={"base_color": TextureImage(path=tmp_path / "red.png")}
    )
    lods = []
    for number in range(2):
        mesh = umbel.shapes.blob(4, seed=1)
        mesh.uvs = np.zeros((len(mesh.positions), 2), np.float32) if number else None
        mesh.materials = [umbel.Material("grey", base_color=(0.5, 0.5, 0.5, 1)), painted]
        mesh.material_ids = np.full(len(mesh.triangles), number, np.uint32)
        lods.append(umbel.build_lod(mesh))
    aside = np.eye(4)
    aside[0, 3] = 6
    umbel.save_asset(tmp_path / "a.umbel", lods, [(0, np.eye(4)), (1, aside)])
    view = umbel.Camera((6, 0, 8), target=(6, 0, 0), height=12, pixel_error=1.0)
    renderer = CutRenderer(umbel.Asset(tmp_path / "a.umbel"), view, 64_000_000)
    albedo, _ = renderer.film(view, width=12, height=12).features(4)
    assert albedo[6, 6] == pytest.approx((1, 0, 0))


@pytest.mark.parametrize("sets", [1, 2])
def test_textures_need_their_set_of_uvs(tmp_path: Path, sets: int) -> None:
    Image.new("RGB", (2, 2), (255, 0, 0)).save(tmp_path / "red.png")
    mesh = umbel.shapes.blob(4, seed=1)
    mesh.uvs = np.zeros((len(mesh.positions), 2), np.float32)
    mesh.uv_sets = [mesh.uvs] * (sets - 1)
    painted = umbel.Material(
        "painted",
        roughness=0.5,
        images={"base_color": TextureImage(path=tmp_path / "red.png")},
        textures={"base_color": {"texCoord": 1}},
    )
    mesh.materials, mesh.material_ids = [painted], np.zeros(len(mesh.triangles), np.uint32)
    umbel.build_lod(mesh).save(tmp_path / "a.umbel")
    view = umbel.Camera((0, 0, 8), target=(0, 0, 0), height=12, pixel_error=1.0)
    with warnings.catch_warnings(record=True) as said:
        renderer = CutRenderer(umbel.Asset(tmp_path / "a.umbel"), view, 64_000_000)
    albedo, _ = renderer.film(view, width=12, height=12).features(4)
    assert albedo[6, 6] == pytest.approx((1, 0, 0) if sets == 2 else (1, 1, 1))
    assert ["texture coordinates 1" in str(one.message) for one in said] == [True] * (2 - sets)


def test_the_command_keeps_to_the_budget(umbel_command: Umbel, herd: Path, tmp_path: Path) -> None:
    out = tmp_path / "o.png"
    size = ["--width", 24, "--height", 16, "--spp", 1]
    said = umbel_command("render", herd, "-o", out, *size, "--budget", "1MB", "--json").json
    assert out.is_file()
    assert 0 < said["scene_bytes"] <= 1_000_000
    assert said["pixel_error"] >= 1
    assert said["triangles"] > 0
    for budget in ("0", "much", "5XB"):
        bad = umbel_command("render", herd, "-o", out, *size, "--budget", budget)
        assert bad.status == 1
        assert "--budget" in bad.err
    bad = umbel_command("render", herd, "-o", out, *size, "--budget", "1KB")
    assert "--budget is 1000, but" in bad.err


def test_the_simulation_loads_what_is_needed(tmp_path: Path) -> None:
    budgets = (0.05, 0.5, 1.0)
    found = bench.simulate({"blob": bench.blob}, seconds=1.0, budgets=budgets)
    assert len(found.rows) == len(bench.LINES) * len(budgets)
    rows = {(row["line"], row["budget"]): row for row in found.rows}
    for line in bench.LINES:
        errors = [rows[line, budget]["median_error"] for budget in budgets]
        assert errors == sorted(errors, reverse=True)
    assert rows["disk", 1.0]["near"] >= 0.75
    assert rows["disk", 0.05]["near"] < 0.2
    assert rows["bad network", 1.0]["failures"] > 0
    assert rows["disk", 1.0]["failures"] == 0
    assert all(0 < row["loaded_over_needed"] < 5 for row in found.rows)
    written = bench.write(found, tmp_path)
    assert {"stream.md", "stream.csv"} <= {path.name for path in written}
    assert all(path.stat().st_size > 100 for path in written)
