"""Meshes that are drawn several times: stored once, drawn where they are."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import umbel
from helpers.gltf_files import json_of, validator_errors
from helpers.pictures import png
from helpers.tiles_schema import tileset_faults
from umbel.export.repeats import Repeats
from umbel.export.source import Source
from umbel.io import Instance, Scene
from umbel.io.textures.images import TextureImage

TO_Z_UP = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
EXTENSION = "EXT_mesh_gpu_instancing"
PICTURE = png([[(255, 0, 0, 255), (0, 255, 0, 255)], [(0, 0, 255, 255), (9, 9, 9, 255)]])


def placed(rng: np.random.Generator, place: np.ndarray, scale: Any) -> np.ndarray:
    """A random rotation at a place."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    if np.linalg.det(turn) < 0:
        turn[:, 0] = -turn[:, 0]
    matrix = np.eye(4)
    matrix[:3, :3] = turn * scale
    matrix[:3, 3] = place
    return matrix


def forest() -> Scene:
    """A ground with trees of two kinds, of different scales along the axes, too."""
    rng = np.random.default_rng(5)
    tree, bush = umbel.shapes.blob(3, seed=1), umbel.shapes.torus(24, 12)
    ground = umbel.shapes.blob(4, seed=2)
    red = umbel.Material(name="red", base_color=(1, 0, 0, 1))
    image = TextureImage(data=PICTURE)
    cloth = umbel.Material(name="cloth", images={"base_color": image}, textures={"base_color": {}})
    for mesh, number in ((tree, 0), (ground, 0), (bush, 1)):
        mesh.material_ids = np.full(len(mesh.triangles), number, np.uint32)
    bush.uvs = bush.positions[:, :2].copy()
    wide = np.diag([30.0, 1, 30, 1])
    instances = [Instance(2, wide)]
    for k in range(100):
        place = np.array([k % 10 * 5.0 - 22, 5, k // 10 * 5.0 - 22]) + rng.uniform(-1, 1, 3)
        scale = rng.uniform(0.5, 2, 3 if k % 4 == 0 else 1)
        instances.append(Instance(k % 2, placed(rng, place, scale)))
    return Scene([tree, bush, ground], [red, cloth], instances)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return forest()


@pytest.fixture(scope="module")
def asset(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("repeats") / "forest.umbel"
    umbel.build_scene(scene, instances="on").save(path)
    return path


@pytest.fixture(scope="module")
def exported(asset: Path) -> tuple[Path, umbel.TilesReport]:
    folder = asset.parent / "tiles"
    return folder, umbel.export_tiles(asset, folder, tile_triangles=12_000)


def uris(folder: Path, leaves: bool) -> list[str]:
    """The contents of an explicit tree, or of its leaves alone."""
    pending, found = [json.loads((folder / "tileset.json").read_text())["root"]], []
    while pending:
        tile = pending.pop()
        pending += tile.get("children", [])
        if "content" in tile and not (leaves and "children" in tile):
            found.append(tile["content"]["uri"])
    return sorted(found)


def leaf_mesh(folder: Path) -> umbel.Mesh:
    """All that the leaves show, with z up."""
    points, triangles, count = [], [], 0
    for uri in uris(folder, leaves=True):
        mesh = umbel.load(folder / uri, allow_outside=True)
        points.append(mesh.world_positions @ TO_Z_UP.T)
        triangles.append(mesh.triangles + np.uint32(count))
        count += len(mesh.positions)
    return umbel.Mesh(np.concatenate(points), np.concatenate(triangles))


def area_and_volume(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = (points[triangles[:, k]].astype(np.float64) for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    return np.array([area, np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6])


def repeated(path: Path) -> list[tuple[int, int]]:
    """The mesh and the number of instances of each node with the extension."""
    root = json_of(path)
    found = []
    for node in root["nodes"]:
        if EXTENSION in node.get("extensions", {}):
            attributes = node["extensions"][EXTENSION]["attributes"]
            counts = {root["accessors"][k]["count"] for k in attributes.values()}
            assert set(attributes) == {"TRANSLATION", "ROTATION", "SCALE"}
            found.append((node["mesh"], *counts))
    assert (EXTENSION in root["extensionsUsed"]) == bool(found)
    assert (EXTENSION in root["extensionsRequired"]) == bool(found)
    return found


def test_tiles_draw_what_the_source_has(
    scene: Scene, exported: tuple[Path, umbel.TilesReport]
) -> None:
    folder, report = exported
    assert tileset_faults(json.loads((folder / "tileset.json").read_text())) == []
    flat = scene.flatten()
    shown, points = leaf_mesh(folder), flat.positions @ TO_Z_UP.T
    ours = area_and_volume(shown.positions, shown.triangles)
    assert np.allclose(ours, area_and_volume(points, flat.triangles), rtol=2e-3)
    away = umbel.Bvh(points, flat.triangles).closest_point(shown.positions).distance
    assert away.max() <= report.largest_move * 1.01 + 1e-5
    back = umbel.Bvh(shown.positions, shown.triangles).closest_point(points).distance
    assert back.max() <= report.largest_move * 1.01 + 1e-5


def test_a_mesh_is_stored_once_in_a_tile(
    asset: Path, exported: tuple[Path, umbel.TilesReport], tmp_path: Path
) -> None:
    folder, report = exported
    counts = [n for uri in uris(folder, leaves=False) for _, n in repeated(folder / uri)]
    assert len(counts) > 4
    assert min(counts) >= 2
    flat = umbel.export_tiles(asset, tmp_path / "t", tile_triangles=12_000, flatten=True)
    assert not any(repeated(tmp_path / "t" / uri) for uri in uris(tmp_path / "t", leaves=False))
    assert report.tiles == flat.tiles
    assert report.bytes < 0.85 * flat.bytes  # most is the ground, and trees that planes cut


def test_boxes_of_tiles_hold_their_instances(exported: tuple[Path, umbel.TilesReport]) -> None:
    folder, _ = exported
    pending = [json.loads((folder / "tileset.json").read_text())["root"]]
    while pending:
        tile = pending.pop()
        pending += tile.get("children", [])
        box = np.array(tile["boundingVolume"]["box"])
        half = np.diag(box[3:].reshape(3, 3))
        mesh = umbel.load(folder / tile["content"]["uri"], allow_outside=True)
        away = np.abs(mesh.world_positions @ TO_Z_UP.T - box[:3]) - half
        assert away.max() <= 1e-6


def test_instances_of_implicit_tiles_lie_in_their_cells(asset: Path, tmp_path: Path) -> None:
    report = umbel.export_tiles(asset, tmp_path / "t", tile_triangles=12_000, implicit_above=0)
    assert report.implicit
    root = json.loads((tmp_path / "t/tileset.json").read_text())["root"]
    box = np.array(root["boundingVolume"]["box"])
    seen = 0
    for path in sorted((tmp_path / "t/tiles").rglob("*.glb")):
        seen += bool(repeated(path))
        side = 2 * box[3] / 2 ** int(path.parent.name)
        low = box[:3] - box[3] + np.array([int(v) for v in path.stem.split("_")]) * side
        points = umbel.load(path, allow_outside=True).world_positions @ TO_Z_UP.T
        assert (points >= low - 1e-6).all()
        assert (points <= low + side + 1e-6).all()
    assert seen > 2


@pytest.mark.parametrize("flatten", [False, True])
def test_planes_cut_no_instance_that_is_smaller_than_cells(flatten: bool, tmp_path: Path) -> None:
    rng = np.random.default_rng(11)
    # Rings: no triangle is at their centres, so cells with those may have no other triangle.
    ring = umbel.shapes.torus(24, 12)
    matrices = [placed(rng, rng.uniform(-30, 30, 3), rng.uniform(0.5, 1)) for _ in range(150)]
    scene = Scene([ring], [], [Instance(0, matrix) for matrix in matrices])
    umbel.build_scene(scene, instances="on").save(tmp_path / "rings.umbel")
    report = umbel.export_tiles(
        tmp_path / "rings.umbel", tmp_path / "t", tile_triangles=6_000, flatten=flatten
    )
    assert report.depth >= 2
    assert not report.implicit
    shown = leaf_mesh(tmp_path / "t")
    flat = scene.flatten()
    assert len(shown.triangles) == len(flat.triangles)
    ours = area_and_volume(shown.positions, shown.triangles)
    assert np.allclose(ours, area_and_volume(flat.positions, flat.triangles), rtol=2e-3)
    bounds = [[q.min(axis=0), q.max(axis=0)] for q in (shown.positions, flat.positions @ TO_Z_UP.T)]
    assert np.allclose(bounds[0], bounds[1], atol=report.largest_move * 1.01)


def test_many_instances_across_cells_are_not_cut_for_implicit_tiles(
    asset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("umbel.export.tiles._MOST_CUT", 0)
    report = umbel.export_tiles(asset, tmp_path / "t", tile_triangles=12_000, implicit_above=0)
    assert not report.implicit
    assert tileset_faults(json.loads((tmp_path / "t/tileset.json").read_text())) == []


def test_materials_are_those_of_the_mesh(exported: tuple[Path, umbel.TilesReport]) -> None:
    folder, _ = exported
    for uri in uris(folder, leaves=False):
        root = json_of(folder / uri)
        for number, _ in repeated(folder / uri):
            primitives = root["meshes"][number]["primitives"]
            names = [root["materials"][p["material"]]["name"] for p in primitives]
            has_uvs = "TEXCOORD_0" in primitives[0]["attributes"]
            assert names == ["cloth" if has_uvs else "red"]


def test_the_same_bytes_for_any_number_of_threads(
    asset: Path, exported: tuple[Path, umbel.TilesReport], tmp_path: Path
) -> None:
    umbel.export_tiles(asset, tmp_path / "t", tile_triangles=12_000, threads=1)
    for path in sorted(p for p in exported[0].rglob("*") if p.is_file()):
        assert (tmp_path / "t" / path.relative_to(exported[0])).read_bytes() == path.read_bytes()


def test_a_glb_draws_each_level_so(scene: Scene, asset: Path, tmp_path: Path) -> None:
    report = umbel.export_glb(asset, tmp_path / "a.glb")
    flat = umbel.export_glb(asset, tmp_path / "b.glb", flatten=True)
    assert report.levels == flat.levels > 2
    assert abs(report.triangles[0] - flat.triangles[0]) < 0.01 * flat.triangles[0]
    # Instances share the finest of their cuts.
    for ours, theirs in zip(report.triangles, flat.triangles, strict=True):
        assert 0.9 * theirs < ours < 2.5 * theirs
    assert report.bytes < 0.5 * flat.bytes
    assert repeated(tmp_path / "a.glb")
    assert not repeated(tmp_path / "b.glb")
    root = json_of(tmp_path / "a.glb")
    assert root["nodes"][0]["extensions"]["MSFT_lod"]["ids"] == list(range(1, report.levels))
    shown, source = umbel.load(tmp_path / "a.glb"), scene.flatten()
    assert len(shown.triangles) == report.triangles[0]
    assert np.allclose(
        area_and_volume(shown.positions, shown.triangles),
        area_and_volume(source.positions, source.triangles),
        rtol=2e-3,
    )
    away = umbel.Bvh(source).closest_point(shown.positions).distance
    assert away.max() <= report.largest_move * 1.01 + 1e-5


def test_what_no_rotation_and_scale_can_say_is_stored_each(tmp_path: Path) -> None:
    blob = umbel.shapes.blob(3, seed=1)
    mirror, shear, flat = np.eye(4), np.eye(4), np.eye(4)
    mirror[0, 0], shear[0, 1], flat[1, 1] = -1, 0.5, 0
    near = np.eye(4)
    near[0, 1] = 1e-5
    kinds = [np.eye(4), np.eye(4), mirror, mirror, shear, shear, flat, flat, near]
    for k, matrix in enumerate(kinds):
        kinds[k] = matrix.copy()
        kinds[k][:3, 3] = [3.0 * k, 0, 0]
    scene = Scene([blob], [], [Instance(0, matrix) for matrix in kinds])
    umbel.build_scene(scene, instances="on").save(tmp_path / "a.umbel")
    source = Source(umbel.Asset(tmp_path / "a.umbel"))
    low, high = source.bounds()
    step = float((high - low).max()) / 2**16
    found = Repeats(source).of(np.arange(len(kinds)), 0.0, low * 0, step)
    assert [one.instances.tolist() for one in found] == [[0, 1]]
    umbel.export_glb(tmp_path / "a.umbel", tmp_path / "a.glb")
    assert repeated(tmp_path / "a.glb")[0][1] == 2
    umbel.export_glb(tmp_path / "a.umbel", tmp_path / "b.glb", flatten=True)
    shown, each = umbel.load(tmp_path / "a.glb"), umbel.load(tmp_path / "b.glb")
    ours = area_and_volume(shown.positions, shown.triangles)
    assert np.allclose(ours, area_and_volume(each.positions, each.triangles), rtol=1e-3)


@pytest.mark.parametrize("turn", ["x", "y", "z", "none"])
def test_half_turns_and_none_are_exact(turn: str, tmp_path: Path) -> None:
    signs = {"x": [1, -1, -1], "y": [-1, 1, -1], "z": [-1, -1, 1], "none": [1, 1, 1]}[turn]
    blob = umbel.shapes.blob(4, seed=1)
    matrix = np.diag([*signs, 1.0])
    matrix[0, 3] = 4
    scene = Scene([blob], [], [Instance(0, matrix), Instance(0, np.eye(4))])
    umbel.build_scene(scene, instances="on").save(tmp_path / "a.umbel")
    report = umbel.export_glb(tmp_path / "a.umbel", tmp_path / "a.glb")
    assert repeated(tmp_path / "a.glb")
    shown = umbel.load(tmp_path / "a.glb")
    away = umbel.Bvh(scene.flatten()).closest_point(shown.positions).distance
    assert away.max() <= report.largest_move


def test_khronos_finds_no_error(asset: Path, exported: tuple[Path, umbel.TilesReport]) -> None:
    umbel.export_glb(asset, asset.parent / "levels.glb")
    files = [asset.parent / "levels.glb", *sorted(exported[0].rglob("*.glb"))]
    assert not validator_errors(*files)


def test_what_is_kept_of_meshes_has_a_limit_and_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    meshes = [umbel.shapes.blob(2, seed=k) for k in range(6)]
    rng = np.random.default_rng(3)
    instances = [Instance(k % 6, placed(rng, rng.uniform(-9, 9, 3), 1.0)) for k in range(18)]
    umbel.build_scene(Scene(meshes, [], instances), instances="on").save(tmp_path / "a.umbel")
    written = []
    for most in (1_000_000, 700, 1):
        monkeypatch.setattr("umbel.export.repeats._MOST_KEPT", most)
        umbel.export_glb(tmp_path / "a.umbel", tmp_path / "a.glb")
        written.append((tmp_path / "a.glb").read_bytes())
        repeats = Repeats(Source(umbel.Asset(tmp_path / "a.umbel")))
        for error in (0.0, 0.1, 0.0):
            repeats.of(np.arange(18), error, np.zeros(3), 1.0)
            sizes = [0 if one is None else len(one.triangles) for one in repeats._kept.values()]
            assert sum(sizes) == repeats._kept_triangles
            assert sizes and (sum(sizes) <= most or len(sizes) == 1)
    assert written[0] == written[1] == written[2]
