"""Assets of scenes: several meshes, each stored once, and the places where they stand."""

import math
from pathlib import Path

import numpy as np
import pytest

import umbel
from helpers.commands import DATA, Umbel
from helpers.meshes import triangle_keys
from umbel.io import Instance, Scene, load_scene
from umbel.lod.arrange import arrange

SCENES = ["two_cylinder_engine.glb", "littlest_tokyo.glb", "smallpine.glb"]


def moved(x: float, scale: float = 1.0) -> np.ndarray:
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[0, 3] = x
    return matrix


def herd(count: int) -> Scene:
    """Blobs in a row, of twice the size each, and a torus that one of the materials is on."""
    blob, torus = umbel.shapes.blob(4, seed=1), umbel.shapes.torus(24, 12)
    materials = [umbel.Material(name="red"), umbel.Material(name="blue")]
    blob.material_ids = np.zeros(len(blob.triangles), np.uint32)
    torus.material_ids = np.ones(len(torus.triangles), np.uint32)
    places = [Instance(0, moved(4.0 * k, 2.0**k)) for k in range(count)]
    return Scene([blob, torus], materials, [*places, Instance(1, moved(-4))], name="herd")


def keys_of_whole(scene: Scene) -> np.ndarray:
    return triangle_keys(scene.flatten())


def shown(path: Path, **how: float) -> umbel.Mesh:
    asset = umbel.Asset(path)
    return asset.scene_mesh(asset.scene_cuts(**how))


def test_each_mesh_says_which_attributes_it_has(tmp_path: Path, umbel_command: Umbel) -> None:
    plain, textured = umbel.shapes.blob(3, seed=1), umbel.shapes.torus(24, 12)
    textured.uvs = np.zeros((len(textured.positions), 2), np.float32)
    scene = Scene([plain, textured], [], [Instance(k, moved(4.0 * k)) for k in (0, 0, 0, 1, 1, 1)])
    umbel.build_scene(scene, instances="on").save(tmp_path / "a.umbel")
    asset = umbel.Asset(tmp_path / "a.umbel")
    assert [mesh["uvs"] for mesh in asset.meshes] == [False, True]
    assert not any(mesh["colors"] for mesh in asset.meshes)
    assert "uvs" in umbel_command("info", tmp_path / "a.umbel", "--json").json["attributes"]


@pytest.mark.parametrize("mode", ["on", "off", "auto"])
def test_level_zero_of_a_scene_is_what_the_source_draws(tmp_path: Path, mode: str) -> None:
    scene = herd(3)
    built = umbel.build_scene(scene, instances=mode)
    built.save(tmp_path / "a.umbel")
    asset = umbel.Asset(tmp_path / "a.umbel")
    assert np.array_equal(triangle_keys(shown(tmp_path / "a.umbel", level=0)), keys_of_whole(scene))
    assert asset.verify(8).ok
    drawn = len(scene.flatten().triangles)
    assert built.report["input_triangles"] == drawn
    assert len(asset.meshes) == (1 if mode == "off" else 2)
    assert len(asset.instances) == (0 if mode == "off" else 4)
    assert [m.name for m in asset.materials] == ["red", "blue"]


def test_auto_keeps_apart_what_is_drawn_more_than_twice() -> None:
    assert len(arrange(herd(2)).meshes) == 1
    assert len(arrange(herd(3)).meshes) == 2
    assert len(arrange(umbel.shapes.blob(3)).meshes) == 1
    with pytest.raises(umbel.Error, match="instances"):
        arrange(herd(2), "maybe")


def test_one_mesh_where_it_is_makes_the_same_file_as_build_lod(tmp_path: Path) -> None:
    blob = umbel.shapes.blob(4, seed=2)
    umbel.build_lod(blob, precision="12bits").save(tmp_path / "a.umbel")
    for mode in ("on", "auto", "off"):
        umbel.build_scene(blob, instances=mode, precision="12bits").save(tmp_path / "b.umbel")
        assert (tmp_path / "a.umbel").read_bytes() == (tmp_path / "b.umbel").read_bytes()


def test_cuts_by_triangles_are_the_finest_that_keep_to_them(tmp_path: Path) -> None:
    umbel.build_scene(herd(3), instances="on").save(tmp_path / "a.umbel")
    asset = umbel.Asset(tmp_path / "a.umbel")
    whole = len(shown(tmp_path / "a.umbel", level=0).triangles)
    for most in (whole, whole // 2, whole // 7):
        cuts = asset.scene_cuts(triangles=most)
        mesh, error = asset.scene_mesh(cuts), asset.scene_error(cuts)
        assert len(mesh.triangles) <= most
        if error > 0:
            finer = asset.scene_mesh(asset.scene_cuts(error=error * (1 - 1e-4)))
            assert len(finer.triangles) > most
    coarsest = shown(tmp_path / "a.umbel", error=math.inf)
    assert 0 < len(coarsest.triangles) <= 4 * 128
    least = len(coarsest.triangles)
    with pytest.raises(umbel.Error, match=f"the coarsest cut has {least}"):
        asset.scene_cuts(triangles=least - 1)
    or_coarsest = asset.scene_cuts(triangles=1, or_coarsest=True)
    assert len(asset.scene_mesh(or_coarsest).triangles) == least
    deepest = max(len(asset.mesh_tables(k).levels) for k in range(len(asset.meshes))) - 1
    assert len(shown(tmp_path / "a.umbel", level=deepest).triangles) > 0
    with pytest.raises(umbel.Error, match=f"the levels are 0 to {deepest}"):
        asset.scene_cuts(level=deepest + 1)


def test_errors_are_in_the_unit_of_the_scene(tmp_path: Path) -> None:
    umbel.build_scene(herd(3), instances="on").save(tmp_path / "a.umbel")
    asset = umbel.Asset(tmp_path / "a.umbel")
    errors = asset.tables.groups["error"]
    error = float(errors[np.isfinite(errors)].max()) * 1.001
    cuts = asset.scene_cuts(error=error)
    assert 0 < asset.scene_error(cuts) <= error
    sizes = [len(asset.scene_mesh([one]).triangles) for one in cuts[:3]]
    assert sizes == sorted(sizes)  # the larger it stands, the finer it is
    assert sizes[0] < sizes[2]
    camera = umbel.Camera((0, 0, 30), height=200)
    assert len(asset.scene_mesh(asset.scene_cuts(camera=camera)).triangles) > 0
    with pytest.raises(umbel.Error, match="exactly one"):
        asset.scene_cuts(error=1, level=0)


def test_the_grid_is_fine_enough_wherever_a_mesh_stands(tmp_path: Path) -> None:
    built = umbel.build_scene(herd(3), instances="on", precision=0.01)
    step = built.report["grid_step"]
    assert step == 2.0**-7
    own = [lod.config["position_step"] for lod in built.lods]
    assert own == [2.0**-9, 2.0**-7]  # the blob stands four times as large
    assert built.report["largest_move"] <= step * 0.5 * 3**0.5
    built.save(tmp_path / "a.umbel")
    assert umbel.verify(tmp_path / "a.umbel", 8).ok


def test_flat_and_mirrored_places_are_kept(tmp_path: Path) -> None:
    mirrored, flat = np.diag([-1.0, 1.0, 1.0, 1.0]), np.diag([1.0, 0.0, 1.0, 1.0])
    scene = Scene([umbel.shapes.blob(3)], [], [Instance(0, m) for m in (mirrored, flat, moved(3))])
    built = umbel.build_scene(scene, instances="on")
    assert [mesh for mesh, _ in built.instances] == [0, 1, 0]
    built.save(tmp_path / "a.umbel")
    assert np.array_equal(triangle_keys(shown(tmp_path / "a.umbel", level=0)), keys_of_whole(scene))
    scene.instances.append(Instance(0, np.full((4, 4), np.nan), name="nowhere"))
    with pytest.raises(umbel.Error, match="nowhere"):
        umbel.build_scene(scene, instances="on")


def test_a_scene_of_nothing_is_an_asset_of_nothing(tmp_path: Path) -> None:
    umbel.build_scene(Scene(), instances="on").save(tmp_path / "a.umbel")
    assert umbel.verify(tmp_path / "a.umbel").ok
    assert not len(shown(tmp_path / "a.umbel", level=0).triangles)


@pytest.mark.skipif(not DATA.is_dir(), reason="there is no data folder")
@pytest.mark.parametrize("name", SCENES)
def test_real_scenes_by_the_command(umbel_command: Umbel, tmp_path: Path, name: str) -> None:
    scene, out = load_scene(DATA / name), tmp_path / "a.umbel"
    drawn = scene.flatten()
    said = umbel_command("build", DATA / name, "-o", out, "--instances", "on", "--json").json
    assert said["input_triangles"] == len(drawn.triangles)
    info = umbel_command("info", out, "--json").json
    assert (info["meshes"], info["instances"]) == (len(scene.meshes), len(scene.instances))
    assert info["materials"] == len(scene.materials)
    for field in ("input_triangles", "stored_triangles", "clusters", "root_groups", "sha256"):
        assert info[field] == said[field]
    assert drawn.bounds is not None
    size = float(np.max(drawn.bounds[1] - drawn.bounds[0]))
    assert (np.array(info["bounds"][0]) <= drawn.bounds[0] + 1e-5 * size).all()
    assert (np.array(info["bounds"][1]) >= drawn.bounds[1] - 1e-5 * size).all()
    assert umbel_command("verify", out, "--cuts", 4, "--json").json["ok"]

    asset = umbel.Asset(out)
    for (stored, matrix), place in zip(asset.instances, scene.instances, strict=True):
        assert stored == place.mesh  # every mesh is drawn, in the order of the file
        assert np.array_equal(matrix, place.transform[:3].astype(np.float32))
    for index, mesh in enumerate(scene.meshes):
        again = asset.mesh(asset.mesh_tables(index).cut(level=0), index)
        assert np.array_equal(triangle_keys(again), triangle_keys(mesh))

    whole = shown(out, level=0)
    assert len(whole.triangles) == len(drawn.triangles)
    assert whole.bounds is not None
    assert np.allclose(whole.bounds, drawn.bounds, rtol=0, atol=1e-5 * size)
    assert np.array_equal(areas_by_material(whole) > 0, areas_by_material(drawn) > 0)
    assert np.allclose(areas_by_material(whole), areas_by_material(drawn), rtol=1e-3)


def areas_by_material(mesh: umbel.Mesh) -> np.ndarray:
    a, b, c = (mesh.positions[mesh.triangles[:, k]].astype(np.float64) for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.bincount(mesh.material_ids, areas, minlength=len(mesh.materials))


@pytest.mark.skipif(not DATA.is_dir(), reason="there is no data folder")
def test_commands_show_all_instances(umbel_command: Umbel, tmp_path: Path) -> None:
    source = DATA / "two_cylinder_engine.glb"
    flat, apart = tmp_path / "flat.umbel", tmp_path / "apart.umbel"
    how = ("--precision", "16bits", "--json")
    one = umbel_command("build", source, "-o", flat, *how).json
    many = umbel_command("build", source, "-o", apart, "--instances", "on", *how).json
    assert (one["meshes"], one["instances"]) == (1, 1)  # it draws less than twice what it stores
    assert (many["meshes"], many["instances"]) == (29, 67)
    assert many["stored_triangles"] < one["stored_triangles"] == many["input_triangles"]
    assert many["file_bytes"] < one["file_bytes"]
    assert many["largest_move"] <= many["grid_step"] * 0.5 * 3**0.5
    for arguments in (["--level", 0], ["--triangles", 30_000], ["--error", 2.0]):
        out = tmp_path / "cut.glb"
        cut = umbel_command("extract", apart, *arguments, "-o", out, "--json").json
        mesh = umbel.load(out)
        assert len(mesh.triangles) == cut["triangles"]
        assert arguments[0] != "--level" or cut["triangles"] == many["input_triangles"]
        assert arguments[0] != "--triangles" or 15_000 < cut["triangles"] <= 30_000
        assert arguments[0] != "--error" or 0 < cut["max_error"] <= 2.0

    pictures = []
    size = ["--width", 48, "--height", 36, "--spp", 32, "--light", "1,1,1", "--exposure", 0]
    view = ["--camera=600,300,600:0,-40,0:40", "--json"]
    for name, more in ((flat, []), (apart, []), (apart, ["--budget", "64MB"])):
        out = tmp_path / f"{len(pictures)}.png"
        said = umbel_command("render", name, "-o", out, *size, *view, *more).json
        assert said["triangles"] > 1000
        pictures.append(pixels_of(out))
    for other in pictures[1:]:
        assert np.abs(other - pictures[0]).mean() < 0.02 * 255


def pixels_of(path: Path) -> np.ndarray:
    from PIL import Image

    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"), np.float64)
