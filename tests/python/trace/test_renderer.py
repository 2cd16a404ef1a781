"""`umbel render` and what is behind it: files, cameras, materials, and what is refused."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import umbel
from helpers.commands import COMMAND, Outcome, Umbel
from helpers.pictures import (
    BLUE,
    DARK,
    EVEN,
    GREEN,
    RED,
    WHITE,
    data_uri,
    emitting,
    names,
    png,
    seen,
    write_square,
)
from umbel.trace.picture import auto_exposure, check_format, save_picture, tone_map
from umbel.trace.shading import Shading

SMALL = ("--width", 24, "--height", 16, "--spp", 2)
FIELDS = ["seconds", "mrays_per_second", "triangles", "samples", "rays", "output", "position"]

# ---- files and options


def test_a_png_and_what_is_said_of_it(umbel_command: Umbel, blob_ply: Path, tmp_path: Path) -> None:
    out = tmp_path / "blob.png"
    done = umbel_command("render", blob_ply, "-o", out, *SMALL, "--json")
    assert done.status == 0 and done.err == ""
    assert [f for f in FIELDS if f not in done.json] == []
    assert done.json["triangles"] == 20480
    assert done.json["primary_rays"] == 24 * 16 * 2
    assert os.listdir(tmp_path) == ["blob.png"]
    with Image.open(out) as image:
        assert image.size == (24, 16) and image.mode == "RGB"
        assert np.asarray(image).std() > 5


def test_an_exr_has_the_radiance_itself(
    umbel_command: Umbel, blob_ply: Path, tmp_path: Path
) -> None:
    module = pytest.importorskip("OpenEXR")
    out = tmp_path / "blob.exr"
    assert umbel_command("render", blob_ply, "-o", out, *SMALL).status == 0
    expected = umbel.render(blob_ply, width=24, height=16, samples=2)
    with module.File(str(out)) as file:
        np.testing.assert_array_equal(file.channels()["RGB"].pixels, expected)
    assert os.listdir(tmp_path) == ["blob.exr"]


def test_the_same_bytes_for_any_threads_and_passes(
    umbel_command: Umbel, blob_ply: Path, tmp_path: Path
) -> None:
    def picture(*options: object) -> bytes:
        out = tmp_path / "out.png"
        size = ("--width", 40, "--height", 30, "--spp", 5)
        assert umbel_command("render", blob_ply, "-o", out, *size, *options).status == 0
        return out.read_bytes()

    expected = picture("--threads", 1)
    assert picture("--threads", 3) == expected
    assert picture("--progressive") == expected
    assert picture("--seed", 2) != expected


def test_several_cameras_make_numbered_files(
    umbel_command: Umbel, blob_ply: Path, tmp_path: Path
) -> None:
    cameras = ("--camera", "auto", "--camera", "auto:120,30:50", "--camera=0,0,4:0,0,0:40")
    done = umbel_command("render", blob_ply, "-o", tmp_path / "b.png", *SMALL, *cameras, "--json")
    assert done.status == 0
    assert sorted(os.listdir(tmp_path)) == ["b-1.png", "b-2.png", "b-3.png"]
    assert done.json["view_3"]["position"] == [0, 0, 4]
    assert done.json["view_2"]["fov"] == pytest.approx(50, abs=1e-3)
    assert len({(tmp_path / f).read_bytes() for f in os.listdir(tmp_path)}) == 3


def test_the_file_s_own_cameras(umbel_command: Umbel, tmp_path: Path) -> None:
    nodes = [
        {"mesh": 0},
        {"children": [2], "translation": [0, 0, 2]},
        {"camera": 0, "name": "front", "translation": [0, 0, 3], "rotation": [0, 0, 1, 0]},
        {"camera": 1},
        {"camera": 0, "translation": [0, 0, 9]},
    ]
    cameras = [
        {"type": "perspective", "perspective": {"yfov": 0.4, "znear": 0.1}},
        {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0, "zfar": 9}},
    ]
    path = write_square(
        tmp_path / "a.gltf",
        emitting(),
        nodes=nodes,
        cameras=cameras,
        scenes=[{"nodes": [0, 1, 3, 4]}],
    )
    mesh = umbel.load(path)
    assert [c.name for c in mesh.cameras] == ["front", ""]
    assert mesh.cameras[0].position == (0, 0, 5) and mesh.cameras[0].up == (0, -1, 0)
    pixels = umbel.render(
        mesh, camera="file:front", environment=DARK, width=16, height=16, samples=4
    )
    assert names(pixels) == "wbgr"  # upside down
    done = umbel_command(
        "render", path, "-o", tmp_path / "o.png", *SMALL, "--camera", "file", "--json"
    )
    assert done.status == 0 and done.json["view_2"]["position"] == [0, 0, 9]
    for text, word in (("file:back", "2"), ("file:3", "front")):
        done = umbel_command("render", path, "-o", tmp_path / "x.png", *SMALL, "--camera", text)
        assert done.status == 1 and word in done.err
    with pytest.raises(umbel.Error, match="no perspective camera"):
        umbel.render(umbel.shapes.blob(2), camera="file", width=4, height=4, samples=1)


def test_an_asset_shows_the_cut_that_the_camera_needs(
    umbel_command: Umbel, blob_asset: Path, tmp_path: Path
) -> None:
    out = ("-o", tmp_path / "a.png", *SMALL, "--json")
    coarse = umbel_command("render", blob_asset, *out).json
    assert coarse["accel"] == "lod" and coarse["triangles"] < 5000
    fine = umbel_command("render", blob_asset, *out, "--pixel-error", 0.01).json
    assert fine["triangles"] > coarse["triangles"]
    assert umbel_command("render", blob_asset, *out, "--accel", "bvh").json["triangles"] == 20480


def test_a_progressive_picture_that_is_interrupted_is_whole(blob_ply: Path, tmp_path: Path) -> None:
    out = tmp_path / "p.png"
    options = ["--progressive", "--spp", "100000", "--width", "64", "--height", "48"]
    process = subprocess.Popen(
        [*COMMAND, "render", str(blob_ply), "-o", str(out), *options], stderr=subprocess.PIPE
    )
    deadline = time.monotonic() + 120
    while not out.exists() and time.monotonic() < deadline and process.poll() is None:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 130 and err.decode().strip() == "umbel: interrupted"
    assert os.listdir(tmp_path) == ["p.png"]
    with Image.open(out) as image:
        image.load()


def test_progress_is_told_and_cancels() -> None:
    told: list[float] = []
    umbel.render(
        umbel.shapes.blob(3),
        width=64,
        height=64,
        samples=1,
        progress=lambda fraction, stage: told.append(fraction),
    )
    assert told == sorted(told) and told[0] >= 0 and told[-1] <= 1
    with pytest.raises(umbel.Cancelled):
        umbel.render(
            umbel.shapes.blob(3), width=64, height=64, samples=1, progress=lambda *_: False
        )


# ---- materials


def test_a_texture_stands_where_its_uvs_say(tmp_path: Path) -> None:
    path = write_square(tmp_path / "a.gltf", emitting(), sampler={"magFilter": 9728})
    assert names(seen(path)) == "rgbw"


@pytest.mark.parametrize(("wrap", "expected"), [(10497, "rgrg"), (33071, "rggg"), (33648, "rggr")])
def test_wrap_modes(tmp_path: Path, wrap: int, expected: str) -> None:
    path = write_square(
        tmp_path / "a.gltf",
        emitting(),
        uvs=((0, 0.2), (2, 0.2), (2, 0.2), (0, 0.2)),
        sampler={"magFilter": 9728, "wrapS": wrap},
    )
    assert names(seen(path), rows=(8,), columns=(2, 6, 9, 13)) == expected


def test_uv_transforms(tmp_path: Path) -> None:
    def corners(**transform: Any) -> str:
        use = {"extensions": {"KHR_texture_transform": transform}}
        return names(
            seen(write_square(tmp_path / "a.gltf", emitting(**use), sampler={"magFilter": 9728}))
        )

    assert corners(offset=[0.5, 0]) == "grwb"
    assert corners(scale=[0.5, 1]) == "rrbb"
    # Coordinates turn counter-clockwise, so the image clockwise.
    assert corners(rotation=np.pi / 2) == "brwg"


def test_one_image_with_two_samplers_is_two_textures(tmp_path: Path) -> None:
    material = emitting()
    material["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 1}
    path = write_square(
        tmp_path / "a.gltf",
        material,
        textures=[{"source": 0, "sampler": 0}, {"source": 0, "sampler": 1}],
        samplers=[{"wrapS": 33071}, {"wrapS": 10497}],
    )
    assert len(Shading(umbel.load(path)).textures) == 2


def test_alpha_masks_cut_holes_and_blending_lets_light_through(tmp_path: Path) -> None:
    image = {"uri": data_uri(png([[(0, 0, 0, 255), (0, 0, 0, 64)]]), "image/png")}
    material: dict[str, Any] = {
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0},
        "extensions": {"KHR_materials_specular": {"specularFactor": 0}},
    }
    for mode, behind in (("OPAQUE", 0.0), ("MASK", 1.0), ("BLEND", 191 / 255)):
        path = write_square(
            tmp_path / "a.gltf",
            material | {"alphaMode": mode, "alphaCutoff": 0.5},
            image=image,
            sampler={"magFilter": 9728},
        )
        pixels = seen(path, EVEN, samples=256)
        covered, open_ = pixels[4:12, 2:6].mean(), pixels[4:12, 10:14].mean()
        # What is black still reflects a little, as a dielectric does.
        assert covered < 0.06
        assert open_ == pytest.approx(behind, abs=0.06)


def test_vertex_colours_are_multiplied() -> None:
    mesh = umbel.Mesh(
        np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
        colors=np.array([[1, 0.5, 0, 1]] * 4, np.float32),
    )
    r, g, b = seen(mesh, EVEN, samples=64, max_bounces=4)[8, 8]
    assert r == pytest.approx(0.75, abs=0.02) and g == pytest.approx(r / 2, abs=0.02) and b == 0


def test_obj_textures_are_the_right_way_up(tmp_path: Path) -> None:
    (tmp_path / "t.png").write_bytes(png([[RED, GREEN], [BLUE, WHITE]]))
    (tmp_path / "a.mtl").write_text("newmtl m\nKd 1 1 1\nmap_Kd t.png\n")
    (tmp_path / "a.obj").write_text(
        "mtllib a.mtl\nusemtl m\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n"
        "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"
    )
    assert names(seen(tmp_path / "a.obj", EVEN, samples=64)) == "rgbw"


@pytest.mark.parametrize("image", [{"uri": "gone.png"}, {"uri": "data:image/png;base64,AAAA"}])
def test_a_texture_that_cannot_be_had_is_a_warning(
    umbel_command: Umbel, tmp_path: Path, image: dict[str, str]
) -> None:
    path = write_square(tmp_path / "a.gltf", emitting(), image=image)
    out = tmp_path / "a.png"
    done = umbel_command("render", path, "-o", out, *SMALL)
    assert done.status == 0 and out.exists()
    assert "warning" in done.err and "texture" in done.err and "Traceback" not in done.err


def test_hidden_materials_are_left_out(tmp_path: Path) -> None:
    path = write_square(tmp_path / "a.gltf", emitting() | {"name": "outline[1]"})
    for pattern in ("out*", "outline[?]", "outline[1]"):
        assert len(umbel.Renderer(path, hide=[pattern]).mesh.triangles) == 0
        assert len(umbel.Renderer(path, hide=pattern).mesh.triangles) == 0
    with pytest.raises(umbel.Error, match="outline"):
        umbel.Renderer(path, hide=["glass"])


# ---- what is refused


def assert_one_sentence(done: Outcome, status: int = 1) -> None:
    assert done.status == status, done.err
    assert not done.out or done.json["error"] in done.err  # with --json
    assert len(done.err.strip().splitlines()) == 1 and done.err.startswith("umbel: ")


def test_faults_are_one_sentence(
    umbel_command: Umbel, blob_ply: Path, blob_asset: Path, tmp_path: Path
) -> None:
    broken = umbel.shapes.blob(2)
    broken.positions[5] = np.nan
    nan = tmp_path / "nan.ply"
    umbel.save(nan, broken)
    out = ("-o", tmp_path / "x.png")
    for arguments, word in (
        ([nan, *out], "5"),
        ([tmp_path / "no.ply", *out], "no.ply"),
        ([blob_ply, "-o", tmp_path / "x.jpg"], ".png"),
        ([blob_ply, "-o", tmp_path / "no" / "x.png"], "folder"),
        ([blob_ply, *out, "--spp", 0], "spp"),
        ([blob_ply, *out, "--width", 0], "width"),
        ([blob_ply, *out, "--height", 40000], "height"),
        ([blob_ply, *out, "--width", 32768, "--height", 32768], "268435456"),
        ([blob_ply, *out, "--camera", "nowhere"], "nowhere"),
        ([blob_ply, *out, "--camera=0,0,1:0,0,1:30"], "target"),
        ([blob_ply, *out, "--camera=0,0,9:0,0,1:200"], "field of view"),
        ([blob_ply, *out, "--camera=nan,0,9:0,0,1:20"], "numbers"),
        ([blob_ply, *out, "--camera", "auto:30,95"], "elevation"),
        ([blob_ply, *out, "--camera", "file"], "camera"),
        ([blob_ply, *out, "--exposure", "bright"], "exposure"),
        ([blob_ply, *out, "--shadow-samples", 3], "--shadow-samples"),
        ([blob_ply, *out, "--bounces", 5000], "--bounces"),
        ([blob_ply, *out, "--clamp", -1], "clamp"),
        ([blob_ply, *out, "--light", "1,2"], "--light"),
        ([blob_ply, *out, "--sun", "5"], "--sun"),
        ([blob_ply, *out, "--sun", "inf,40"], "--sun must be a number, not inf"),
        ([blob_ply, *out, "--hide", "x"], "material"),
        ([blob_ply, *out, "--accel", "lod"], "asset"),
        ([blob_ply, *out, "--pixel-error", 1], "lod"),
        ([blob_asset, *out, "--pixel-error", 0], "more than 0"),
    ):
        done = umbel_command("render", *arguments, "--json")
        assert_one_sentence(done)
        assert word in done.err
    assert os.listdir(tmp_path) == ["nan.ply"]


@pytest.mark.parametrize(
    ("name", "value"), [("sun_azimuth", "east"), ("sun_size", 30), ("sun", None), ("sky", np.inf)]
)
def test_faults_of_the_environment_are_named(name: str, value: Any) -> None:
    with pytest.raises(umbel.Error, match=rf"environment\.{name} .*{value}"):
        umbel.Renderer(umbel.shapes.blob(2), environment=umbel.Environment(**{name: value}))


def test_an_empty_mesh_shows_the_sky(umbel_command: Umbel, tmp_path: Path) -> None:
    path = tmp_path / "empty.ply"
    umbel.save(path, umbel.Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32)))
    done = umbel_command("render", path, "-o", tmp_path / "a.png", *SMALL, "--ground", "--json")
    assert done.status == 0 and done.json["triangles"] == 0


def test_a_floor_stands_under_a_mesh_with_every_attribute() -> None:
    blob = umbel.shapes.blob(3, seed=1)
    n = len(blob.positions)
    mesh = umbel.Mesh(
        blob.positions,
        blob.triangles,
        normals=np.tile(np.float32([0, 0, 1]), (n, 1)),
        tangents=np.tile(np.float32([1, 0, 0, 1]), (n, 1)),
        uvs=np.zeros((n, 2), np.float32),
        uv_sets=[np.zeros((n, 2), np.float32)],
        colors=np.ones((n, 4), np.float32),
        joints=np.zeros((n, 4), np.uint32),
        weights=np.tile(np.float32([1, 0, 0, 0]), (n, 1)),
    )
    image = umbel.render(mesh, width=16, height=12, samples=1, ground=True)
    assert np.isfinite(image).all()


def test_a_floor_is_not_the_material_of_a_mesh_that_has_numbers_of_materials_alone() -> None:
    blob = umbel.shapes.blob(3, seed=1)
    ids = np.arange(len(blob.triangles), dtype=np.uint32) % 3
    mesh = umbel.Mesh(blob.positions, blob.triangles, material_ids=ids)
    film = umbel.Renderer(mesh, ground=True).film(width=16, height=16)
    albedo, _ = film.features(4)
    assert albedo[8, 8] == pytest.approx(0.75)


def _small_files() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (2_000, 2_000))


@pytest.mark.parametrize("kind", ["png", "exr"])
def test_a_full_disk_is_one_sentence_and_keeps_the_old_picture(
    umbel_command: Umbel, blob_ply: Path, tmp_path: Path, kind: str
) -> None:
    if kind == "exr":
        pytest.importorskip("OpenEXR")
    out = tmp_path / f"a.{kind}"
    out.write_bytes(b"old")
    size = ("--width", 64, "--height", 64, "--spp", 1)
    done = umbel_command("render", blob_ply, "-o", out, *size, preexec_fn=_small_files)
    assert_one_sentence(done)
    assert out.read_bytes() == b"old" and os.listdir(tmp_path) == [out.name]


@pytest.mark.parametrize(
    ("kind", "module", "word"), [("exr", "OpenEXR", "OpenEXR"), ("png", "PIL", "Pillow")]
)
def test_a_missing_package_is_named_before_any_work(
    monkeypatch: pytest.MonkeyPatch, kind: str, module: str, word: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(umbel.Error, match=f"{word}.*pip install"):
        check_format(Path(f"a.{kind}"))


# ---- from radiance to bytes


def test_tone_mapping_is_monotone_and_takes_any_number() -> None:
    ramp = np.repeat(np.geomspace(1e-4, 1e4, 600), 3).reshape(600, 1, 3)
    mapped = tone_map(ramp, 0)
    assert (np.diff(mapped[:, 0, 0].astype(int)) >= 0).all()
    assert mapped[0, 0, 0] <= 1 and mapped[-1, 0, 0] == 255
    odd = np.array([[[np.nan, np.inf, -np.inf], [-1.0, 0.0, 1e38]]])
    assert tone_map(odd).tolist() == [[[0, 255, 0], [0, 0, 255]]]


def test_exposure_takes_radiance_of_any_unit() -> None:
    ramp = np.linspace(0, 2, 300, dtype=np.float32).reshape(1, 100, 3)
    for stops in (-40, 40):
        assert np.array_equal(tone_map(ramp * 2.0**stops, -stops), tone_map(ramp, 0))


def test_automatic_exposure_undoes_a_change_of_light() -> None:
    picture = np.random.default_rng(1).uniform(0.1, 1, (20, 30, 3))
    assert auto_exposure(picture * 8) == pytest.approx(auto_exposure(picture) - 3, abs=1e-4)
    np.testing.assert_allclose(
        tone_map(picture * 8).astype(int), tone_map(picture).astype(int), atol=1
    )
    assert auto_exposure(np.zeros((2, 2, 3))) == 0


def test_pictures_of_wrong_shape_or_name_are_refused(tmp_path: Path) -> None:
    with pytest.raises(umbel.Error, match="shape"):
        save_picture(tmp_path / "a.png", np.zeros((4, 4)))
    with pytest.raises(umbel.Error, match="pictures are"):
        save_picture(tmp_path / "a.bmp", np.zeros((4, 4, 3)))
    assert os.listdir(tmp_path) == []


# ---- real scenes


@pytest.mark.parametrize(
    "name", ["littlest_tokyo.glb", "car_lamborghini.glb", "sponza_dabrovic_66k.obj"]
)
@pytest.mark.filterwarnings("ignore::umbel.LoadWarning")
def test_real_scenes_have_light_and_no_holes_in_their_numbers(data: Path, name: str) -> None:
    pixels = umbel.render(data / name, width=48, height=32, samples=2)
    assert np.isfinite(pixels).all() and pixels.min() >= 0
    assert 0.02 < pixels.mean() < 5
