"""What OBJ and PLY cannot hold is said once, and what they can hold is written."""

from __future__ import annotations

import io
import warnings
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import umbel
from helpers.meshes import linear
from umbel.io.scene import Instance, Scene
from umbel.io.textures.images import TextureImage
from umbel.io.textures.packed import Made, packed


def png(array: np.ndarray) -> bytes:
    out = io.BytesIO()
    Image.fromarray(array).save(out, "PNG")
    return out.getvalue()


def image(seed: int = 0, channels: int = 3, **more: object) -> TextureImage:
    texels = np.random.default_rng(seed).integers(0, 256, (8, 4, channels), dtype=np.uint8)
    return TextureImage(png(texels), **more)


def square(material: umbel.Material) -> umbel.Mesh:
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    uvs = np.array([[0, 0.75], [1, 0.75], [1, 0], [0, 0]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    ids = np.zeros(2, np.uint32)
    return umbel.Mesh(corners, faces, uvs=uvs, material_ids=ids, materials=[material])


def rich() -> umbel.Mesh:
    mesh = square(
        umbel.Material(
            "paint",
            alpha_mode="BLEND",
            images={
                "base_color": image(1, 4, gltf={"image": {"name": "bark / old"}}),
                "metallic_roughness": image(2),
                "normal": image(3, wrap_u="clamp", wrap_v="clamp"),
                "emissive": image(1, 4),
                "occlusion": image(4),
            },
            textures={
                "normal": {"scale": 0.5},
                "emissive": {
                    "extensions": {
                        "KHR_texture_transform": {"offset": [0.25, 0.5], "scale": [2, 3]}
                    }
                },
            },
            extensions={
                "KHR_materials_clearcoat": {"clearcoatFactor": 0.5},
                "KHR_materials_ior": {"ior": 1.25},
                "KHR_materials_sheen": {},
            },
        )
    )
    mesh.uv_sets = [mesh.uvs]
    mesh.tree = {
        "asset": {"copyright": "me,\nmyself"},
        "nodes": [{"name": "house", "instances": [0, 1]}],
        "cameras": [{}],
    }
    return mesh


def test_obj_has_its_images_beside_it(tmp_path: Path) -> None:
    mesh = rich()
    with pytest.warns(umbel.LoadWarning, match="OBJ has no place for") as said:
        umbel.save(tmp_path / "a.obj", mesh)
    assert len(said) == 1
    sentence = str(said[0].message)
    for part in (
        "second set of UVs", "scene's nodes", "cameras", "KHR_materials_sheen", "occlusion textures"
    ):  # fmt: skip
        assert part in sentence
    assert "clearcoat" not in sentence and "ior" not in sentence
    lines = (tmp_path / "a.mtl").read_text().splitlines()
    assert "map_Kd a_bark_old.png" in lines and "map_d a_bark_old.png" in lines
    assert "map_Pr a_roughness.png" in lines and "map_Pm a_metallic.png" in lines
    assert "norm -bm 0.5 -clamp on a_normal.png" in lines
    assert "map_Ke -o 0.25 -2.5 0 -s 2 3 1 a_bark_old.png" in lines  # 1 - 3 - 0.5
    assert "Pc 0.5" in lines and "Ni 1.25" in lines
    (material,) = mesh.materials
    assert (tmp_path / "a_bark_old.png").read_bytes() == material.images["base_color"].data
    rough = np.asarray(Image.open(tmp_path / "a_roughness.png"))
    assert np.array_equal(rough, material.images["metallic_roughness"].texels()[..., 1])
    assert "# copyright: me, myself" in (tmp_path / "a.obj").read_text()
    back = umbel.load(tmp_path / "a.obj")
    assert np.allclose(back.uvs[:, 1], 1 - mesh.uvs[:, 1])  # OBJ counts from the bottom
    assert back.materials[0].images["base_color"].bottom_up


def test_obj_of_an_obj_is_the_same(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "wood.png").write_bytes(image(7).encoded())
    (tmp_path / "in" / "a.mtl").write_text("newmtl wood\nmap_Kd wood.png\n")
    (tmp_path / "in" / "a.obj").write_text(
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0.25\nvt 1 0\nvt 0 1\nusemtl wood\n"
        "f 1/1 2/2 3/3\n"
    )
    mesh = umbel.load(tmp_path / "in" / "a.obj")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        umbel.save(tmp_path / "b.obj", mesh)
        umbel.save(tmp_path / "in" / "c.obj", mesh)
    for path, name in ((tmp_path / "b.obj", "b_wood.png"), (tmp_path / "in/c.obj", "wood.png")):
        back = umbel.load(path)
        assert np.array_equal(back.uvs, mesh.uvs)
        found = back.materials[0].images["base_color"]
        assert found.path.name == name and found.encoded() == image(7).encoded()


@pytest.mark.parametrize("options", ["", "-o 0.5 0.25 0 -s 2 3 1 "])
def test_obj_of_an_obj_is_the_same_through_an_asset_and_gltf(tmp_path: Path, options: str) -> None:
    (tmp_path / "wood.png").write_bytes(image(7).encoded())
    (tmp_path / "a.mtl").write_text(f"newmtl wood\nmap_Kd {options}wood.png\n")
    (tmp_path / "a.obj").write_text(
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0.1\nvt 1 0.2\nvt 0 0.3\nusemtl wood\n"
        "f 1/1 2/2 3/3\n"
    )
    mesh = umbel.load(tmp_path / "a.obj")
    umbel.build_lod(mesh).save(tmp_path / "a.umbel")
    umbel.save(tmp_path / "a.glb", mesh)
    asset = umbel.Asset(tmp_path / "a.umbel")
    extracted = asset.scene_mesh(asset.scene_cuts(level=0))
    for again in (mesh, extracted, umbel.load(tmp_path / "a.glb")):
        umbel.save(tmp_path / "b.obj", again)
        assert np.array_equal(np.sort(umbel.load(tmp_path / "b.obj").uvs, 0), np.sort(mesh.uvs, 0))
        [line] = [x for x in (tmp_path / "b.mtl").read_text().splitlines() if "map_Kd" in x]
        assert line.startswith(f"map_Kd {options}")
        assert line.count("-") == options.count("-")


def test_obj_has_no_opacity_of_what_is_opaque(tmp_path: Path) -> None:
    for mode, opacity in (("OPAQUE", 1.0), ("BLEND", 0.25)):
        material = umbel.Material("m", base_color=(1, 1, 1, 0.25), alpha_mode=mode)
        umbel.save(tmp_path / "a.obj", square(material))
        [read] = umbel.load(tmp_path / "a.obj").materials
        assert (read.base_color[3], read.alpha_mode) == (opacity, mode)


@pytest.mark.parametrize("materials", [[], [umbel.Material("first")]])
def test_obj_has_numbers_of_materials_that_are_not_there(
    tmp_path: Path, materials: list[umbel.Material]
) -> None:
    mesh = square(umbel.Material())
    mesh.materials, mesh.material_ids = materials, np.array([0, 7], np.uint32)
    umbel.save(tmp_path / "a.obj", mesh)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # no library has the material
        read = umbel.load(tmp_path / "a.obj")
    names = [read.materials[k].name for k in read.material_ids]
    assert names == [materials[0].name if materials else "material_0", "material_7"]


def test_obj_says_that_colours_are_too_bright(tmp_path: Path) -> None:
    mesh = square(umbel.Material())
    mesh.colors = np.array([[6, 4, 1, 1], [0.5, 0, 1, 1], [1, 1, 1, 1], [0, 0, 0, 1]], np.float32)
    with pytest.warns(umbel.LoadWarning, match="no place for: colours so bright"):
        umbel.save(tmp_path / "a.obj", mesh)
    read = umbel.load(tmp_path / "a.obj").colors
    assert read is not None
    mesh.colors[0, 0] = linear(2)
    np.testing.assert_allclose(read, mesh.colors, rtol=1e-5)


def test_obj_says_that_it_has_no_samplers_and_no_backs(tmp_path: Path) -> None:
    mesh = square(umbel.Material(double_sided=True, images={"base_color": image(1, nearest=True)}))
    says = "which materials are double-sided; how textures are filtered or mirrored"
    with pytest.warns(umbel.LoadWarning, match=says):
        umbel.save(tmp_path / "a.obj", mesh)
    mesh = square(umbel.Material(images={"base_color": image(1, wrap_u="mirror")}))
    with pytest.warns(umbel.LoadWarning, match="place for: how textures are filtered or mirrored"):
        umbel.save(tmp_path / "a.obj", mesh)


@pytest.mark.parametrize("name", ["part #1", "a  b", " lead", "-o 1", "#x", "end\\", "x#y z"])
def test_obj_files_of_any_name_find_their_materials(tmp_path: Path, name: str) -> None:
    (tmp_path / f"{name}.png").write_bytes(image(2).encoded())
    for given in (image(1), TextureImage(path=tmp_path / f"{name}.png")):
        mesh = square(umbel.Material(name="#1", images={"base_color": given}))
        umbel.save(tmp_path / f"{name}.obj", mesh)
        [material] = umbel.load(tmp_path / f"{name}.obj").materials
        assert material.images["base_color"].encoded() == given.encoded()


def test_ply_says_what_it_leaves_out(tmp_path: Path) -> None:
    with pytest.warns(umbel.LoadWarning, match="the material; textures; .*cameras") as said:
        umbel.save(tmp_path / "a.ply", rich())
    assert len(said) == 1
    assert b"comment copyright: me, myself\n" in (tmp_path / "a.ply").read_bytes()


def test_ply_says_that_colours_are_rounded(tmp_path: Path) -> None:
    mesh = umbel.shapes.blob(2)
    mesh.colors = np.full((len(mesh.positions), 4), linear(51 / 255), np.float32)
    mesh.colors[:, 3] = 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        umbel.save(tmp_path / "a.ply", mesh)
    mesh.colors[0, 0] = 0.5
    with pytest.warns(umbel.LoadWarning, match="colours between 8-bit steps"):
        umbel.save(tmp_path / "a.ply", mesh)


@pytest.mark.parametrize("extension", [".obj", ".ply", ".glb"])
def test_plain_meshes_lose_nothing(tmp_path: Path, extension: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        umbel.save(tmp_path / f"a{extension}", umbel.shapes.blob(2))
        umbel.save(tmp_path / f"b{extension}", square(umbel.Material()))


def written(folder: Path, mesh: umbel.Mesh) -> dict[str, umbel.Material]:
    """The mesh's material as glTF and an asset have it."""
    umbel.save(folder / "out.glb", mesh)
    umbel.build_lod(mesh).save(folder / "out.umbel")
    (one,), (other,) = (
        umbel.load(folder / "out.glb").materials,
        umbel.Asset(folder / "out.umbel").materials,
    )
    return {"glb": one, "umbel": other}


def test_maps_of_obj_become_textures_of_gltf(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    planes = {n: rng.integers(0, 256, (8, 8), dtype=np.uint8) for n in ("rough", "metal")}
    planes["mask"] = np.repeat(np.repeat(rng.integers(0, 2, (4, 4)) * 255, 2, 0), 2, 1)
    for name, plane in planes.items():
        (tmp_path / f"{name}.png").write_bytes(png(plane.astype(np.uint8)))
    color = rng.integers(0, 256, (8, 8, 3), dtype=np.uint8)
    (tmp_path / "color.png").write_bytes(png(color))
    (tmp_path / "a.mtl").write_text(
        "newmtl leaf\nNs 100\nmap_Kd color.png\nmap_d mask.png\nmap_Pr rough.png\n"
        "map_Pm metal.png\n"
    )
    (tmp_path / "a.obj").write_text(
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl leaf\n"
        "f 1/1 2/2 3/3\n"
    )
    for where, material in written(tmp_path, umbel.load(tmp_path / "a.obj")).items():
        assert material.alpha_mode == "MASK", where
        assert (material.roughness, material.metallic) == (1.0, 1.0)
        base = material.images["base_color"].texels()
        assert np.array_equal(base[..., :3], color)
        assert np.array_equal(base[..., 3], planes["mask"])
        both = material.images["metallic_roughness"].texels()
        assert np.array_equal(both[..., 1], planes["rough"])
        assert np.array_equal(both[..., 2], planes["metal"])


def test_maps_of_obj_that_lie_otherwise_than_those_of_their_image_are_named(tmp_path: Path) -> None:
    planes = {n: np.full((8, 8), k, np.uint8) for k, n in enumerate(("rough", "metal", "mask"))}
    for name, plane in planes.items():
        (tmp_path / f"{name}.png").write_bytes(png(plane))
    (tmp_path / "color.png").write_bytes(png(np.full((8, 8, 3), 9, np.uint8)))
    (tmp_path / "a.mtl").write_text(
        "newmtl leaf\nPm 0.25\nmap_Kd color.png\nmap_d -s 2 2 mask.png\nmap_Pr rough.png\n"
        "map_Pm -clamp on metal.png\n"
        "newmtl flat\nmap_Kd color.png\nmap_d -s 1 1 mask.png\n"
    )
    (tmp_path / "a.obj").write_text(
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl leaf\n"
        "f 1/1 2/2 3/3\nusemtl flat\nf 1/1 3/3 2/2\n"
    )
    with pytest.warns(umbel.LoadWarning) as caught:
        umbel.save(tmp_path / "out.glb", umbel.load(tmp_path / "a.obj"))
    [warning] = caught
    assert str(warning.message).endswith(
        "without: the alpha texture of 'leaf', which lies otherwise than the base_color one; "
        "the metallic texture of 'leaf', which lies otherwise than the roughness one"
    )
    leaf, flat = umbel.load(tmp_path / "out.glb").materials
    assert (leaf.alpha_mode, leaf.metallic, leaf.roughness) == ("OPAQUE", 0.25, 1.0)
    assert leaf.images["base_color"].data == png(np.full((8, 8, 3), 9, np.uint8))
    assert np.array_equal(leaf.images["metallic_roughness"].texels()[..., 1], planes["rough"])
    assert np.array_equal(flat.images["base_color"].texels()[..., 3], planes["mask"])


def test_materials_of_the_same_maps_have_an_image_that_is_made_once(tmp_path: Path) -> None:
    for name in ("color", "mask", "rough"):
        (tmp_path / f"{name}.png").write_bytes(png(np.full((4, 4), 9, np.uint8)))
    maps = "map_Kd color.png\nmap_d mask.png\nmap_Pr rough.png\n"
    (tmp_path / "a.mtl").write_text(f"newmtl a\n{maps}newmtl b\nPm 1\n{maps}")
    (tmp_path / "a.obj").write_text(
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n"
        "usemtl b\nf 1/1 3/1 2/1\n"
    )
    made: Made = {}
    a, b = (packed(one, made)[0] for one in umbel.load(tmp_path / "a.obj").materials)
    assert (a.metallic, b.metallic, a.alpha_mode, b.alpha_mode) == (0, 1, "MASK", "MASK")
    for slot in ("base_color", "metallic_roughness"):
        assert a.images[slot] is b.images[slot]


def test_an_image_that_many_materials_miss_is_named_once(tmp_path: Path) -> None:
    gone = TextureImage(path=tmp_path / "gone.png")
    images = {"alpha": gone, "roughness": gone}
    mesh = square(umbel.Material("a", images=images))
    mesh.materials.append(umbel.Material("b", images=images))
    with pytest.warns(umbel.LoadWarning, match=r"without: cannot read [^;]*gone\.png[^;]*$"):
        umbel.save(tmp_path / "a.glb", mesh)


def test_channels_of_an_image_that_many_materials_show_are_written_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    texels = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    images = {"metallic_roughness": TextureImage(png(texels))}
    factors = [(1.0, 1.0), (1.0, 1.0), (1.0, 0.5)]
    materials = [
        umbel.Material(f"m{k}", metallic=metal, roughness=rough, images=images)
        for k, (metal, rough) in enumerate(factors)
    ]
    mesh = umbel.shapes.grid(3, 1)
    mesh.uvs = mesh.positions[:, :2].copy()
    mesh.materials, mesh.material_ids = materials, np.arange(6, dtype=np.uint32) % 3
    decoded: list[TextureImage] = []
    whole = TextureImage.texels

    def counted(self: TextureImage) -> np.ndarray:
        decoded.append(self)
        return whole(self)

    monkeypatch.setattr(TextureImage, "texels", counted)
    umbel.save(tmp_path / "a.obj", mesh)
    assert len(decoded) == 2  # for m0 and m2
    assert len(list(tmp_path.glob("*.png"))) == 3
    again = {m.name: m.images for m in umbel.load(tmp_path / "a.obj").materials}
    rough, metal = texels[..., 1], texels[..., 2]
    assert np.array_equal(whole(again["m1"]["roughness"])[..., 0], rough)
    assert np.array_equal(whole(again["m2"]["roughness"])[..., 0], np.rint(rough * 0.5))
    assert np.array_equal(whole(again["m2"]["metallic"])[..., 0], metal)


def test_a_mask_in_the_base_color_keeps_its_bytes(tmp_path: Path) -> None:
    texels = np.random.default_rng(4).integers(0, 256, (8, 8, 4), dtype=np.uint8)
    (tmp_path / "leaf.png").write_bytes(png(texels))
    (tmp_path / "a.mtl").write_text("newmtl leaf\nmap_Kd leaf.png\nmap_d leaf.png\n")
    (tmp_path / "a.obj").write_text(
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl leaf\n"
        "f 1/1 2/2 3/3\n"
    )
    for where, material in written(tmp_path, umbel.load(tmp_path / "a.obj")).items():
        assert material.alpha_mode == "BLEND", where  # half-transparent all over
        assert material.images["base_color"].data == png(texels)


def test_that_no_format_has_a_reference_system_is_said(tmp_path: Path) -> None:
    mesh = umbel.shapes.blob(2, seed=1)
    mesh.coordinates = {"crs": 'PROJCS["WGS 84 / UTM zone 32N"]'}
    umbel.build_lod(mesh).save(tmp_path / "a.umbel")
    asset = umbel.Asset(tmp_path / "a.umbel")
    extracted = asset.scene_mesh(asset.scene_cuts(level=0))
    scene = asset.scene_of(asset.scene_cuts(level=0))
    said = "the reference system of its coordinates, which a .prj file said"
    for write in (
        lambda: umbel.save(tmp_path / "a.ply", extracted),
        lambda: umbel.save(tmp_path / "a.obj", extracted),
        lambda: umbel.save(tmp_path / "a.glb", scene),
        lambda: umbel.export_glb(asset, tmp_path / "a.glb"),
        lambda: umbel.export_tiles(asset, tmp_path / "a"),
    ):
        with pytest.warns(umbel.LoadWarning, match=said) as caught:
            write()
        assert len(caught) == 1
    (tmp_path / "a.prj").write_text(mesh.coordinates["crs"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        umbel.save(tmp_path / "a.ply", extracted)  # which then stands beside what is said


@pytest.mark.parametrize("extension", [".obj", ".ply"])
def test_names_and_extras_of_several_meshes_are_lost_with_a_word(
    tmp_path: Path, extension: str
) -> None:
    meshes = [square(umbel.Material()) for _ in range(2)]
    meshes[0].name, meshes[1].extras = "left", {"side": 2}
    instances = [Instance(0), Instance(1)]
    scene = Scene(meshes, meshes[0].materials, instances, "pair")
    with pytest.warns(umbel.LoadWarning, match="extras; names of the scene and its meshes"):
        umbel.save(tmp_path / f"a{extension}", scene)
    meshes[0].name, meshes[1].extras = "", None
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        umbel.save(tmp_path / f"a{extension}", scene)
    assert not any("extras" in str(one.message) for one in caught)
    assert not any("names" in str(one.message) for one in caught)
