"""3D Tiles: what is in the tiles, how they fit, and what the tree says of them."""

from __future__ import annotations

import errno
import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
import pytest

import umbel
from helpers.pictures import png
from umbel.io import Instance, Scene
from umbel.io.textures.images import TextureImage

TO_Z_UP = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
PICTURE = png([[(255, 0, 0, 255), (0, 255, 0, 255)], [(0, 0, 255, 255), (9, 9, 9, 255)]])


@dataclass
class Tile:
    uri: str
    error: float
    depth: int
    low: np.ndarray
    high: np.ndarray
    children: list[Tile]
    mesh: umbel.Mesh | None
    points: np.ndarray  # in the tileset's coordinates, z up


def listed(folder: Path) -> tuple[dict[str, Any], list[Tile]]:
    """tileset.json, and all tiles of an explicit tree."""
    root = json.loads((folder / "tileset.json").read_text())

    def read(entry: dict[str, Any], depth: int) -> Iterator[Tile]:
        box = np.array(entry["boundingVolume"]["box"])
        half = np.diag(box[3:].reshape(3, 3))
        uri = entry.get("content", {}).get("uri", "")
        mesh = umbel.load(folder / uri) if uri else None
        points = np.zeros((0, 3)) if mesh is None else mesh.world_positions @ TO_Z_UP.T
        children = [list(read(child, depth + 1)) for child in entry.get("children", [])]
        own = Tile(uri, entry["geometricError"], depth, box[:3] - half, box[:3] + half,
                   [c[0] for c in children], mesh, points)  # fmt: skip
        yield own
        for several in children:
            yield from several

    return root, list(read(root["root"], 0))


def area(points: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = (points[triangles[:, k]].astype(np.float64) for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def files_of(folder: Path) -> dict[str, bytes]:
    return {
        str(f.relative_to(folder)): f.read_bytes() for f in sorted(folder.rglob("*")) if f.is_file()
    }


@pytest.fixture(scope="module")
def blob() -> umbel.Mesh:
    return umbel.shapes.blob(6, seed=3)


@pytest.fixture(scope="module")
def asset(blob: umbel.Mesh, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("tiles") / "blob.umbel"
    umbel.build_lod(blob, measured_error=True).save(path)
    return path


@pytest.fixture(scope="module")
def exported(asset: Path) -> tuple[Path, umbel.TilesReport]:
    folder = asset.parent / "tiles"
    return folder, umbel.export_tiles(asset, folder, tile_triangles=1500)


def test_leaves_are_the_source_once(
    blob: umbel.Mesh, exported: tuple[Path, umbel.TilesReport]
) -> None:
    folder, report = exported
    root, tiles = listed(folder)
    assert root["asset"]["version"] == "1.1"
    assert root["root"]["refine"] == "REPLACE"
    assert "transform" not in root["root"]
    leaves = [tile for tile in tiles if not tile.children]
    assert len(leaves) > 20
    assert {tile.error for tile in leaves} == {0.0}
    found = sum(area(t.points, t.mesh.triangles) for t in leaves if t.mesh)
    assert np.isclose(found, area(blob.positions, blob.triangles), rtol=1e-3)
    source = umbel.Bvh(blob.positions @ TO_Z_UP.T, blob.triangles)
    for tile in leaves:
        away = source.closest_point(tile.points.astype(np.float32)).distance
        assert away.max() <= report.largest_move * 1.01 + 1e-6
    assert report.tiles == sum(tile.mesh is not None for tile in tiles)
    assert report.files == len(files_of(folder))
    assert report.bytes == sum(map(len, files_of(folder).values()))


def test_errors_fall_and_boxes_hold_what_is_below(
    blob: umbel.Mesh, exported: tuple[Path, umbel.TilesReport]
) -> None:
    _, tiles = listed(exported[0])
    source = umbel.Bvh(blob.positions @ TO_Z_UP.T, blob.triangles)
    for tile in tiles:
        for child in tile.children:
            assert child.error < tile.error
            assert (child.low >= tile.low - 1e-9).all()
            assert (child.high <= tile.high + 1e-9).all()
        assert (tile.points >= tile.low - 1e-9).all()
        assert (tile.points <= tile.high + 1e-9).all()
        away = source.closest_point(tile.points.astype(np.float32)).distance
        # Errors are sampled distances.
        assert away.max(initial=0) <= 1.2 * tile.error + exported[1].largest_move + 1e-6
    assert exported[1].errors == sorted({t.error for t in tiles if t.children}, reverse=True)


def border(tile: Tile, axis: int, value: float) -> set[tuple[tuple[float, ...], ...]]:
    """The directed edges of a tile that lie in a plane and have one triangle."""
    t = tile.mesh.triangles
    edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    points = tile.points
    inside = (points[edges][:, :, axis] == value).all(axis=1)
    named = {tuple(tuple(points[v]) for v in edge) for edge in edges[inside]}
    return {(a, b) for a, b in named if (b, a) not in named}


def test_tiles_of_one_error_and_depth_fit_to_the_bit(
    exported: tuple[Path, umbel.TilesReport],
) -> None:
    _, tiles = listed(exported[0])
    pairs = compared = 0
    for a in tiles:
        for b in tiles:
            if a is b or a.mesh is None or b.mesh is None:
                continue
            if (a.depth, a.error) != (b.depth, b.error):
                continue
            for axis in range(3):
                value = a.points[:, axis].max()
                if value != b.points[:, axis].min():
                    continue
                # Cells have equal sides, so neighbours are those that overlap across the axis.
                others = [k for k in range(3) if k != axis]
                places = [cell_of(a), cell_of(b)]
                if any(places[0][k] != places[1][k] for k in others):
                    continue
                own, other = border(a, axis, value), border(b, axis, value)
                pairs += 1
                compared += len(own)
                assert own == {(q, p) for p, q in other}
    assert pairs > 20
    assert compared > 500


def cell_of(tile: Tile) -> list[int]:
    return [int(v) for v in Path(tile.uri).stem.split("_")]


def test_the_same_bytes_for_any_number_of_threads(
    asset: Path, exported: tuple[Path, umbel.TilesReport], tmp_path: Path
) -> None:
    umbel.export_tiles(asset, tmp_path / "t", tile_triangles=1500, threads=1)
    assert files_of(tmp_path / "t") == files_of(exported[0])


def test_nothing_is_loaded_whole(
    asset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: Any) -> Any:
        raise AssertionError("reads the tables of the whole asset")

    monkeypatch.setattr(umbel.Asset, "mesh_tables", refuse)
    umbel.export_tiles(asset, tmp_path / "t", tile_triangles=1500)


def bits(data: bytes, entry: dict[str, Any], views: list[Any], count: int) -> np.ndarray:
    if "constant" in entry:
        return np.full(count, bool(entry["constant"]))
    view = views[entry["bitstream"]]
    part = np.frombuffer(data, np.uint8, view["byteLength"], view["byteOffset"])
    found = np.unpackbits(part, bitorder="little")[:count].astype(bool)
    assert found.sum() == entry["availableCount"]
    return found


def test_implicit_tiling_names_the_tiles_that_are_there(
    asset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("umbel.export.tileset.SUBTREE_LEVELS", 3)
    folder = tmp_path / "t"
    report = umbel.export_tiles(asset, folder, tile_triangles=40, implicit_above=100)
    assert report.implicit
    root = json.loads((folder / "tileset.json").read_text())["root"]
    tiling = root["implicitTiling"]
    levels = tiling["subtreeLevels"]
    assert tiling["availableLevels"] > levels  # several subtrees
    box = np.array(root["boundingVolume"]["box"])
    side, corner = 2 * box[3], box[:3] - box[3]
    contents, pending, seen = set(), [(0, 0, 0, 0)], 0
    while pending:
        depth, x, y, z = pending.pop()
        data = (folder / f"subtrees/{depth}/{x}_{y}_{z}.subtree").read_bytes()
        seen += 1
        magic, version, size, binary = struct.unpack_from("<4sIQQ", data)
        assert (magic, version, 24 + size + binary) == (b"subt", 1, len(data))
        text = json.loads(data[24 : 24 + size])
        body, views = data[24 + size :], text.get("bufferViews", [])
        count = (8**levels - 1) // 7
        tiles = bits(body, text["tileAvailability"], views, count)
        stored = bits(body, text["contentAvailability"][0], views, count)
        assert tiles[0]
        assert (tiles | ~stored).all()
        below = bits(body, text["childSubtreeAvailability"], views, 8**levels)
        for level in range(levels + 1):
            first = (8**level - 1) // 7
            flags = below if level == levels else stored[first : first + 8**level]
            for morton in np.flatnonzero(flags):
                own = [sum((morton >> 3 * b + k & 1) << b for b in range(level)) for k in range(3)]
                place = (
                    depth + level,
                    *(p * 2**level + v for p, v in zip((x, y, z), own, strict=True)),
                )
                if level == levels:
                    pending.append(place)
                else:
                    contents.add("tiles/{}/{}_{}_{}.glb".format(*place))
    assert seen > 1
    assert contents == {n for n in files_of(folder) if n.endswith(".glb")}
    assert len(contents) == report.tiles
    for name in sorted(contents)[:: len(contents) // 40]:
        depth = int(name.split("/")[1])
        low = corner + np.array([int(v) for v in Path(name).stem.split("_")]) * side / 2**depth
        points = umbel.load(folder / name).world_positions @ TO_Z_UP.T
        assert (points >= low - 1e-9).all()
        assert (points <= low + side / 2**depth + 1e-9).all()
    # Implied errors halve, and are none below what the levels say.
    halves = [root["geometricError"] / 2**d for d in range(len(report.errors))]
    assert report.errors == halves


def test_skirts_hang_within_their_cells(
    asset: Path, exported: tuple[Path, umbel.TilesReport], tmp_path: Path
) -> None:
    report = umbel.export_tiles(asset, tmp_path / "t", tile_triangles=1500, skirts=True)
    assert report.tiles == exported[1].tiles
    assert report.triangles > exported[1].triangles
    _, plain = listed(exported[0])
    _, skirted = listed(tmp_path / "t")
    by_name = {tile.uri: tile for tile in plain}
    for tile in skirted:
        before = by_name[tile.uri]
        if tile.mesh is None or tile.depth == 0:
            continue
        more = len(tile.mesh.triangles) - len(before.mesh.triangles)
        edges = sum(
            len(border(before, axis, value))
            for axis in range(3)
            for value in (before.points[:, axis].min(), before.points[:, axis].max())
        )
        # Two triangles an edge; edges shorter than a step of the grid are in the strip alone.
        assert more <= 3 * edges + 32
        assert (more > 0) == (edges > 0)


def test_the_origin_is_the_transform_of_the_root(tmp_path: Path) -> None:
    blob = umbel.shapes.blob(4, seed=1)
    far = np.array([4_000_000.25, 500_000.5, 4_900_000.75])
    moved = umbel.Mesh(blob.positions.astype(np.float64) + far, blob.triangles)
    umbel.build_lod(moved).save(tmp_path / "far.umbel")
    for up, turn in (("z", np.eye(3)), ("y", TO_Z_UP)):
        folder = tmp_path / up
        umbel.export_tiles(tmp_path / "far.umbel", folder, up=up)
        root, tiles = listed(folder)
        matrix = np.array(root["root"]["transform"]).reshape(4, 4).T
        assert np.abs(tiles[0].points).max() < 100
        world = tiles[0].points + matrix[:3, 3]
        middle = (world.min(axis=0) + world.max(axis=0)) / 2
        ours = moved.world_positions @ turn.T
        assert np.abs(middle - (ours.min(axis=0) + ours.max(axis=0)) / 2).max() < 1e-3


def test_materials_and_textures_are_kept_and_images_shared(tmp_path: Path) -> None:
    blob = umbel.shapes.blob(5, seed=2)
    image = TextureImage(data=PICTURE)
    red = umbel.Material(name="red", base_color=(1, 0, 0, 1))
    cloth = umbel.Material(name="cloth", images={"base_color": image}, textures={"base_color": {}})
    blob.materials = [red, cloth]
    blob.material_ids = (blob.positions[blob.triangles[:, 0], 0] > 0).astype(np.uint32)
    blob.uvs = (blob.positions[:, :2] * 3).astype(np.float32)
    umbel.build_lod(blob).save(tmp_path / "a.umbel")
    report = umbel.export_tiles(tmp_path / "a.umbel", tmp_path / "t", tile_triangles=500)
    images = [n for n in files_of(tmp_path / "t") if n.startswith("textures/")]
    assert images == ["textures/0.png"]
    assert (tmp_path / "t/textures/0.png").read_bytes() == PICTURE
    seen = set()
    for path in sorted((tmp_path / "t").rglob("*.glb")):
        with_parent = umbel.load(path, allow_outside=True)
        for k in np.unique(with_parent.material_ids):
            material = with_parent.materials[k]
            seen.add((material.name, bool(material.images)))
            own = with_parent.triangles[with_parent.material_ids == k]
            middles = with_parent.positions[own].mean(axis=1)
            wrong = middles[:, 0] < -0.1 if material.name == "cloth" else middles[:, 0] > 0.1
            assert not wrong.any() or report.errors  # coarse levels may mix by their error
        assert np.abs(with_parent.uvs - with_parent.positions[:, :2] * 3).max() < 0.5
    assert seen == {("red", False), ("cloth", True)}


def test_files_of_images_are_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.png").write_bytes(PICTURE)
    images = {"base_color": TextureImage(path=tmp_path / "a.png")}
    images["occlusion"] = images["emissive"] = images["base_color"]
    mesh = umbel.shapes.terrain(40, 40, seed=1)
    mesh.uvs = mesh.positions[:, :2].copy()
    mesh.materials = [umbel.Material(name="a", images=images)]
    mesh.material_ids = np.zeros(len(mesh.triangles), np.uint32)
    umbel.build_lod(mesh).save(tmp_path / "a.umbel", textures="external")
    read: list[Path] = []

    def counted(path: Path) -> bytes:
        read.append(path)
        return path.read_bytes()

    monkeypatch.setattr("umbel.io.textures.images.read_bytes", counted)
    report = umbel.export_tiles(tmp_path / "a.umbel", tmp_path / "t", tile_triangles=300)
    assert report.tiles > 4
    assert len(read) == 1
    assert (tmp_path / "t/textures/0.png").read_bytes() == PICTURE


def test_files_of_images_that_cannot_be_decoded_are_named(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"no image")
    images = {"base_color": TextureImage(path=tmp_path / "a.png")}
    mesh = umbel.shapes.grid(4, 4)
    mesh.uvs = mesh.positions[:, :2].copy()
    mesh.materials = [umbel.Material(name="a", images=images)]
    mesh.material_ids = np.zeros(len(mesh.triangles), np.uint32)
    umbel.build_lod(mesh).save(tmp_path / "a.umbel", textures="external")
    with pytest.warns(umbel.LoadWarning, match=r"not all textures.*a\.png cannot be decoded"):
        umbel.export_tiles(tmp_path / "a.umbel", tmp_path / "t")


def test_instances_are_drawn_where_they_are(tmp_path: Path) -> None:
    blob, torus = umbel.shapes.blob(4, seed=1), umbel.shapes.torus(24, 12)
    mirror = np.diag([-2.0, 1, 1, 1])
    mirror[0, 3] = 7
    scene = Scene([blob, torus], [], [Instance(0), Instance(0, mirror), Instance(1, np.eye(4))])
    umbel.build_scene(scene, instances="on").save(tmp_path / "a.umbel")
    umbel.export_tiles(tmp_path / "a.umbel", tmp_path / "t", tile_triangles=700)
    flat = scene.flatten()
    _, tiles = listed(tmp_path / "t")
    leaves = [t for t in tiles if not t.children and t.mesh is not None]
    assert len(leaves) > 4
    total = sum(area(t.points, t.mesh.triangles) for t in leaves)
    assert np.isclose(total, area(flat.positions, flat.triangles), rtol=1e-3)
    volume = sum(signed_volume(t.points, t.mesh.triangles) for t in leaves)
    assert np.isclose(volume, signed_volume(flat.positions @ TO_Z_UP.T, flat.triangles), rtol=1e-2)


def signed_volume(points: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = (points[triangles[:, k]].astype(np.float64) for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


@pytest.mark.filterwarnings("error")
def test_instances_of_empty_meshes_are_left_out(tmp_path: Path) -> None:
    empty = umbel.Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    lods = [umbel.build_lod(umbel.shapes.blob(3, seed=1)), umbel.build_lod(empty)]
    umbel.save_asset(tmp_path / "a.umbel", lods, [(0, np.eye(4)), (1, np.eye(4))])
    report = umbel.export_tiles(tmp_path / "a.umbel", tmp_path / "tiles")
    assert report.triangles == 1280


def test_what_fails_leaves_nothing(
    asset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(umbel.Cancelled):
        umbel.export_tiles(asset, tmp_path / "t", progress=lambda f, _: f < np.float64(0.4))
    assert not list(tmp_path.iterdir())
    real, count = Path.open, 0

    def full(path: Path, mode: str = "r", *more: Any, **named: Any) -> IO[Any]:
        nonlocal count
        count += mode == "xb"
        if count > 5:
            raise OSError(errno.ENOSPC, "No space left on device")
        return real(path, mode, *more, **named)

    monkeypatch.setattr(Path, "open", full)
    with pytest.raises(umbel.Error, match=r"cannot write .*t: No space left"):
        umbel.export_tiles(asset, tmp_path / "t", tile_triangles=1500)
    monkeypatch.undo()
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_exported_is_refused(asset: Path, tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "file").touch()
    with pytest.raises(umbel.Error, match="not an empty folder"):
        umbel.export_tiles(asset, tmp_path / "full")
    with pytest.raises(umbel.Error, match="no folder"):
        umbel.export_tiles(asset, tmp_path / "no" / "t")
    with pytest.raises(umbel.Error, match="at least 1"):
        umbel.export_tiles(asset, tmp_path / "t", tile_triangles=0)
    with pytest.raises(umbel.Error, match="'y' or 'z'"):
        umbel.export_tiles(asset, tmp_path / "t", up="x")
    empty = umbel.Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    umbel.build_lod(empty).save(tmp_path / "empty.umbel")
    with pytest.raises(umbel.Error, match="no triangles"):
        umbel.export_tiles(tmp_path / "empty.umbel", tmp_path / "t")
    assert not (tmp_path / "t").exists()
