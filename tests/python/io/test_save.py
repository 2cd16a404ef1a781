"""Writing meshes: what is read back is what was written, and failures leave nothing."""

from __future__ import annotations

import errno
import os
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import umbel
from helpers.mesh_files import TETRA_POSITIONS, TETRA_TRIANGLES
from helpers.meshes import full_mesh
from umbel.errors import Error, LoadWarning
from umbel.geometry.mesh import Material, Mesh
from umbel.io import load, save
from umbel.io.blocks import open_source
from umbel.io.side_names import SideNames
from umbel.io.textures.images import TextureImage
from umbel.lod.build import build_lod
from umbel.scale.build_asset import build_asset

EXTENSIONS = [".glb", ".ply", ".obj"]


def same_bits(a: np.ndarray | None, b: np.ndarray | None) -> bool:
    if a is None or b is None:
        return a is b
    return a.shape == b.shape and a.tobytes() == b.tobytes()


@pytest.mark.parametrize("extension", EXTENSIONS)
@pytest.mark.parametrize("materials", [True, False])
def test_every_bit_comes_back(tmp_path: Path, extension: str, materials: bool) -> None:
    mesh = full_mesh(materials=materials)
    path = tmp_path / f"mesh{extension}"
    save(path, mesh)
    back = load(path)
    for key in ("positions", "triangles", "normals", "uvs"):
        assert same_bits(getattr(back, key), getattr(mesh, key)), key
    if extension == ".obj":  # which has no tangents and no alpha
        assert np.allclose(back.colors[:, :3], mesh.colors[:, :3], atol=1e-7)
    else:
        assert same_bits(back.tangents, mesh.tangents)
        assert same_bits(back.colors, mesh.colors)
    assert same_bits(back.material_ids, mesh.material_ids)
    left = sorted(p.name for p in tmp_path.iterdir())
    assert left == sorted(["mesh" + extension] + ["mesh.mtl"] * (materials and extension == ".obj"))


@settings(max_examples=40, deadline=None)
@given(
    bits=st.lists(st.integers(0, 2**32 - 1), min_size=9, max_size=30),
    extension=st.sampled_from(EXTENSIONS),
)
def test_any_float_comes_back_to_the_bit(
    tmp_path_factory: pytest.TempPathFactory, bits: list[int], extension: str
) -> None:
    positions = np.array(bits[: len(bits) // 3 * 3], np.uint32).view(np.float32).reshape(-1, 3)
    path = tmp_path_factory.mktemp("bits") / f"mesh{extension}"
    save(path, (positions, np.array([[0, 1, 2]], np.uint32)))
    mesh = load(path)
    nan = np.isnan(positions)
    assert np.array_equal(np.isnan(mesh.positions), nan)
    if mesh.origin.any():  # digits of points far from zero: nine of them, not the bits
        expected, step = positions.astype(np.float64)[~nan], np.abs(mesh.origin).max() * 1e-7
        back = mesh.world_positions[~nan]
        assert ((back == expected) | (np.abs(back - expected) <= step + 1e-7 * abs(back))).all()
    else:
        assert same_bits(mesh.positions[~nan], positions[~nan])


def test_materials_survive_glb_and_mostly_obj(tmp_path: Path) -> None:
    mesh = full_mesh()
    save(tmp_path / "a.glb", mesh)
    assert load(tmp_path / "a.glb").materials == mesh.materials
    save(tmp_path / "a.obj", mesh)
    back = load(tmp_path / "a.obj").materials
    for key in ("name", "base_color", "emissive", "metallic", "roughness"):
        assert [getattr(m, key) for m in back] == [getattr(m, key) for m in mesh.materials]


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_scattered_materials_keep_their_triangles(tmp_path: Path, extension: str) -> None:
    mesh = full_mesh()
    rng = np.random.default_rng(8)
    mesh.material_ids = rng.integers(0, 3, len(mesh.triangles)).astype(np.uint32)
    save(tmp_path / f"a{extension}", mesh)
    back = load(tmp_path / f"a{extension}")

    def table(m: Mesh) -> list[Any]:
        assert m.material_ids is not None
        names = [x.name for x in m.materials] if extension == ".obj" else range(3)
        return sorted(
            (m.positions[t].tolist(), names[k])
            for t, k in zip(m.triangles, m.material_ids.tolist(), strict=True)
        )

    assert table(back) == table(mesh)


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_small_meshes_and_empty_ones(tmp_path: Path, extension: str) -> None:
    path = tmp_path / f"a{extension}"
    save(path, (np.zeros((0, 3)), np.zeros((0, 3), int)))
    assert load(path).triangles.shape == (0, 3)
    save(path, (TETRA_POSITIONS, TETRA_TRIANGLES[:1]))
    assert np.array_equal(load(path).triangles, TETRA_TRIANGLES[:1])


@pytest.mark.parametrize("count", [65535, 65536])
def test_glb_indices_are_wide_enough(tmp_path: Path, count: int) -> None:
    positions = np.random.default_rng(1).random((count, 3)).astype(np.float32)
    triangles = np.array([[0, 1, count - 1], [count - 1, count - 2, count - 3]], np.uint32)
    save(tmp_path / "a.glb", (positions, triangles))
    assert np.array_equal(load(tmp_path / "a.glb").triangles, triangles)


def test_glb_is_laid_out_as_the_specification_asks(tmp_path: Path) -> None:
    import json

    save(tmp_path / "a.glb", full_mesh())
    data = (tmp_path / "a.glb").read_bytes()
    assert int.from_bytes(data[8:12], "little") == len(data)
    size = int.from_bytes(data[12:16], "little")
    root = json.loads(data[20 : 20 + size])
    assert size % 4 == 0
    assert root["buffers"][0]["byteLength"] == len(data) - 28 - size
    for accessor in root["accessors"]:
        view = root["bufferViews"][accessor["bufferView"]]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        bytes_each = width * {5126: 4, 5125: 4, 5123: 2}[accessor["componentType"]]
        start = view["byteOffset"] + accessor.get("byteOffset", 0)
        assert start % 4 in ((0,) if accessor["componentType"] != 5123 else (0, 2))
        assert accessor.get("byteOffset", 0) + accessor["count"] * bytes_each <= view["byteLength"]
    position = root["accessors"][0]
    mesh = full_mesh()
    assert np.array_equal(np.float32(position["min"]), mesh.positions.min(axis=0))
    assert np.array_equal(np.float32(position["max"]), mesh.positions.max(axis=0))
    assert {m["name"] for m in root["materials"]} == {"stone", "lamp", "leaf"}


def test_other_readers_agree(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    mesh = full_mesh(materials=False)
    mesh.uvs = mesh.tangents = None  # which trimesh cannot take without Pillow
    for extension in EXTENSIONS:
        path = tmp_path / f"a{extension}"
        save(path, mesh)
        loaded = trimesh.load(path, process=False, force="mesh", maintain_order=True)
        assert loaded.faces.shape == mesh.triangles.shape
        assert np.allclose(loaded.vertices[loaded.faces], mesh.positions[mesh.triangles], atol=1e-6)


# --- files beside ------------------------------------------------------------------------------


PNG = b"\x89PNG\r\n\x1a\n"
SEVERAL = [".gltf", ".obj"]


def painted(*images: bytes | Path) -> Mesh:
    """A mesh of a material for each image, in its order."""
    count = len(images)
    materials = []
    for image in images:
        one = TextureImage(path=image) if isinstance(image, Path) else TextureImage(PNG + image)
        materials.append(Material(images={"base_color": one}))
    corners = np.random.default_rng(count).random((3 * count, 3)).astype(np.float32)
    triangles = np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)
    ids = np.arange(count, dtype=np.uint32)
    return Mesh(corners, triangles, uvs=corners[:, :2], material_ids=ids, materials=materials)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def images_of(path: Path) -> list[bytes]:
    mesh = load(path)
    assert mesh.material_ids is not None
    used = [mesh.materials[k] for k in mesh.material_ids]
    return [material.images["base_color"].encoded() for material in used]


@pytest.mark.parametrize("extension", SEVERAL)
@pytest.mark.parametrize("has_older", [False, True])
def test_a_failure_at_any_file_leaves_all_as_they_were(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, extension: str, has_older: bool
) -> None:
    path = tmp_path / f"a{extension}"
    if has_older:
        save(path, painted(b"old"))
    before = contents(tmp_path)
    left = 0

    def full(_: int) -> None:
        nonlocal left
        left -= 1
        if left < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    files = 2 if extension == ".gltf" else 4
    for good in range(files):
        left = good
        with pytest.raises(Error, match=r"cannot write .*: No space left on device"):
            save(path, painted(b"new", b"other"))
        assert contents(tmp_path) == before
    left = files
    save(path, painted(b"new", b"other"))
    assert images_of(path) == [PNG + b"new", PNG + b"other"]


@pytest.mark.parametrize("extension", SEVERAL)
def test_files_of_others_are_not_replaced(tmp_path: Path, extension: str) -> None:
    others = dict.fromkeys(["a.bin", "a.mtl", "a_base_color.png"], b"mine")
    for name, data in others.items():
        (tmp_path / name).write_bytes(data)
    path = tmp_path / f"a{extension}"
    for image in (b"one", b"two", b"three"):
        save(path, painted(image))
        assert images_of(path) == [PNG + image]
        found = contents(tmp_path)
        assert others.items() <= found.items()
        beside = {".gltf": {"a_1.bin"}, ".obj": {"a_1.mtl", "a_base_color_1.png"}}[extension]
        assert found.keys() - others.keys() == {path.name, *beside}


@pytest.mark.parametrize("extension", SEVERAL)
def test_files_beside_are_found_again_where_the_main_one_is_gone(
    tmp_path: Path, extension: str
) -> None:
    path = tmp_path / f"a{extension}"
    save(path, painted(b"one"))
    before = contents(tmp_path)
    path.unlink()
    save(path, painted(b"one"))
    assert contents(tmp_path).keys() == before.keys()
    assert images_of(path) == [PNG + b"one"]


def test_an_image_that_stays_is_not_replaced_by_another(tmp_path: Path) -> None:
    path = tmp_path / "a_base_color.png"
    path.write_bytes(PNG + b"old")
    for _ in range(2):
        save(tmp_path / "a.obj", painted(b"new", path))
        assert images_of(tmp_path / "a.obj") == [PNG + b"new", PNG + b"old"]
        assert sorted(contents(tmp_path)) == [
            "a.mtl", "a.obj", "a_base_color.png", "a_base_color_1.png"
        ]  # fmt: skip


def test_names_of_many_files_of_one_stem_take_time_that_grows_with_their_number(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked_at: list[str] = []

    class Names(set[str]):
        def __contains__(self, name: object) -> bool:
            looked_at.append(str(name))
            return super().__contains__(name)

    names = SideNames(tmp_path / "a.obj", lambda _: set())
    monkeypatch.setattr(names, "_taken", Names())
    given_names = [names.new("a", ".png", [b"%d" % k]) for k in range(100)]
    assert given_names == ["a.png", *(f"a_{k}.png" for k in range(1, 100))]
    assert len(looked_at) == 100


@pytest.mark.parametrize("extension", [".glb", ".umbel"])
@pytest.mark.parametrize(
    ("material", "named"),
    [
        (
            Material("m", base_color=(1, np.nan, 1, 1)),
            "pbrMetallicRoughness.baseColorFactor[1] nan",
        ),
        (Material("m", emissive=(np.inf, 0, 0)), "emissiveFactor[0] nan"),
        (Material("m", alpha_mode="MASK", alpha_cutoff=np.float32(np.inf)), "alphaCutoff inf"),
        (
            Material("m", extensions={"KHR_materials_ior": {"ior": np.nan}}),
            "extensions.KHR_materials_ior.ior nan",
        ),
    ],
)
def test_materials_that_no_reader_would_take_are_refused(
    tmp_path: Path, extension: str, material: Material, named: str
) -> None:
    ids = np.zeros(len(TETRA_TRIANGLES), np.uint32)
    mesh = Mesh(TETRA_POSITIONS, TETRA_TRIANGLES, material_ids=ids, materials=[material])
    with pytest.raises(Error, match=re.escape(f"material 'm' has {named}, which must be finite")):
        if extension == ".umbel":
            build_lod(mesh).save(tmp_path / "a.umbel")
        else:
            save(tmp_path / "a.glb", mesh)
    assert not list(tmp_path.iterdir())


def test_what_gltf_cannot_say_of_a_mesh_is_named(tmp_path: Path) -> None:
    ids = np.full(len(TETRA_TRIANGLES), 1, np.uint32)
    numbered = Mesh(TETRA_POSITIONS, TETRA_TRIANGLES, material_ids=ids, materials=[Material()])
    with pytest.warns(LoadWarning, match="without: numbers of materials that are not there"):
        save(tmp_path / "a.glb", numbered)
    with pytest.warns(LoadWarning, match="without: vertices of meshes without triangles"):
        save(tmp_path / "a.glb", Mesh(TETRA_POSITIONS, TETRA_TRIANGLES[:0]))


def test_colours_that_are_nan_are_said_to_be_lost_in_ply(tmp_path: Path) -> None:
    colors = np.full((4, 4), np.nan, np.float32)
    with pytest.warns(LoadWarning, match="colours between 8-bit steps"):
        save(tmp_path / "a.ply", Mesh(TETRA_POSITIONS, TETRA_TRIANGLES, colors=colors))


def test_colours_of_any_size_are_clamped_in_ply_without_a_word_of_numpy(tmp_path: Path) -> None:
    colors = np.ones((4, 4), np.float32)
    colors[1] = 3e38
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        warnings.simplefilter("ignore", LoadWarning)
        save(tmp_path / "a.ply", Mesh(TETRA_POSITIONS, TETRA_TRIANGLES, colors=colors))
    assert load(tmp_path / "a.ply").colors.max() == 1


@pytest.mark.parametrize("extension", SEVERAL)
def test_files_that_another_program_wrote_are_not_replaced(tmp_path: Path, extension: str) -> None:
    path = tmp_path / f"a{extension}"
    save(path, painted(b"theirs"))
    path.write_bytes(path.read_bytes().replace(b"umbel", b"other"))
    beside = contents(tmp_path)
    del beside[path.name]
    save(path, painted(b"ours"))
    assert images_of(path) == [PNG + b"ours"]
    assert beside.items() <= contents(tmp_path).items()


def test_an_image_that_an_older_file_only_names_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "a_base_color.png"
    path.write_bytes(PNG + b"mine")
    save(tmp_path / "a.obj", painted(path))
    for image in (b"mine", b"other"):  # the first is the same file, by chance
        save(tmp_path / "a.obj", painted(image))
        assert images_of(tmp_path / "a.obj") == [PNG + image]
        assert path.read_bytes() == PNG + b"mine"


def test_an_image_that_stays_is_known_however_the_output_is_named(tmp_path: Path) -> None:
    (tmp_path / "below").mkdir()
    save(tmp_path / "a.obj", painted(b"old"))
    path = tmp_path / "a_base_color.png"
    save(tmp_path / "below" / ".." / "a.obj", painted(b"new", path))
    assert images_of(tmp_path / "a.obj") == [PNG + b"new", PNG + b"old"]
    assert path.read_bytes() == PNG + b"old"


def test_an_image_that_is_gone_is_a_warning_and_no_map(tmp_path: Path) -> None:
    with pytest.warns(LoadWarning, match=r"a\.obj: .*gone\.png: No such file"):
        save(tmp_path / "a.obj", painted(tmp_path / "gone.png"))
    assert b"map_" not in (tmp_path / "a.mtl").read_bytes()


@pytest.mark.parametrize("name", ["C:\\mats\\", "\\", "#", "a # b", "a\u3000b", "\ud800", "\u0085"])
def test_any_name_of_a_material_is_one_of_obj(tmp_path: Path, name: str) -> None:
    mesh = painted(b"one", b"two", b"three")
    for k, material in enumerate(mesh.materials):
        material.name, material.images = name, {}
        material.roughness = k / 4
    with pytest.warns(LoadWarning, match="OBJ has no place for: some names of materials: ") as said:
        save(tmp_path / "a.obj", mesh)
    assert f"{name!r} (" in str(said[0].message)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        back = load(tmp_path / "a.obj")
    assert [m.roughness for m in back.materials] == [0, 0.25, 0.5]
    assert len({m.name for m in back.materials}) == len(back.triangles) == 3


@pytest.mark.parametrize("extension", SEVERAL)
def test_files_whose_name_is_no_text_have_files_beside_them(tmp_path: Path, extension: str) -> None:
    path = tmp_path / os.fsdecode(b"mesh\xff" + extension.encode())
    for image in (b"one", b"two"):
        save(path, painted(image))
        assert images_of(path) == [PNG + image]
    assert len(contents(tmp_path)) == (2 if extension == ".gltf" else 3)


# --- failures ---------------------------------------------------------------------------------


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_a_folder_that_is_not_there_is_named(tmp_path: Path, extension: str) -> None:
    path = tmp_path / "gone" / f"a{extension}"
    with pytest.raises(Error, match=r"cannot write .*gone.*: No such file"):
        save(path, (TETRA_POSITIONS, TETRA_TRIANGLES))


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_a_full_disk_leaves_the_old_file_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, extension: str
) -> None:
    path = tmp_path / f"a{extension}"
    path.write_bytes(b"old")

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(Error, match=r"cannot write .*: No space left on device"):
        save(path, (TETRA_POSITIONS, TETRA_TRIANGLES))
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_a_disk_that_is_really_full() -> None:
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full")
    with pytest.raises(Error, match="cannot write"):
        save(Path("/dev/full/a.ply"), (TETRA_POSITIONS, TETRA_TRIANGLES))


def test_interruption_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(_: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save(tmp_path / "a.ply", (TETRA_POSITIONS, TETRA_TRIANGLES))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["a.stl", "a.fbx", "a", "a.umbel"])
def test_unknown_extensions_are_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(Error, match="cannot write"):
        save(tmp_path / name, (TETRA_POSITIONS, TETRA_TRIANGLES))
    with pytest.raises(Error, match=r"cannot read|No such file"):
        load(tmp_path / name)


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    with pytest.raises(Error, match=r"gone\.ply: No such file"):
        load(tmp_path / "gone.ply")
    (tmp_path / "empty.obj").write_bytes(b"")
    with pytest.raises(Error, match=r"empty\.obj is empty"):
        load(tmp_path / "empty.obj")
    with pytest.raises(Error, match="is a folder"):
        load(tmp_path)
    (tmp_path / "a.xyz").write_bytes(b"1 2 3")
    with pytest.raises(Error, match=r"cannot read '\.xyz' files"):
        load(tmp_path / "a.xyz")
    (tmp_path / "a.ply.gz").write_bytes(b"\x1f\x8b\x08 not really")
    with pytest.raises(Error, match="not a whole gzip"):
        load(tmp_path / "a.ply.gz")


@pytest.mark.parametrize("extension", [".glb", ".gltf", ".ply", ".obj", ".stl"])
def test_names_that_are_no_text_are_written_and_read(tmp_path: Path, extension: str) -> None:
    path = tmp_path / os.fsdecode(b"mesh \xff" + extension.encode())
    if extension == ".stl":
        path.write_text("solid\nendsolid\n")
    else:
        save(path, Mesh(TETRA_POSITIONS, TETRA_TRIANGLES))
    count = 0 if extension == ".stl" else 4
    assert len(load(path).triangles) == count
    assert open_source(path, tmp_path / "work").triangles.triangles == count
    build_asset(path, tmp_path / "mesh.umbel", unit_triangles=1000)


def test_a_name_that_is_too_long_is_an_error_of_ours(tmp_path: Path) -> None:
    name = str(tmp_path / ("a" * 300))
    mesh = umbel.shapes.blob(1, seed=1)
    build_lod(mesh).save(tmp_path / "a.umbel")
    for call in (
        lambda: save(f"{name}.ply", mesh),
        lambda: umbel.save_picture(f"{name}.png", np.zeros((2, 2, 3), np.float32)),
        lambda: umbel.export_tiles(tmp_path / "a.umbel", name),
        lambda: umbel.export_viewer(tmp_path / "a.umbel", name),
    ):
        with pytest.raises(Error, match=r"cannot write .*aaa.*: File name too long"):
            call()


def test_a_copyright_that_is_no_text_is_written(tmp_path: Path) -> None:
    mesh = umbel.shapes.blob(1, seed=1)
    mesh.tree = {"asset": {"copyright": "a\ud800b"}}
    for extension in (".obj", ".ply", ".glb"):
        save(tmp_path / f"a{extension}", mesh)
        assert b"a?b" in (tmp_path / f"a{extension}").read_bytes()
