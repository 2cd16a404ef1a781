"""Ugly, cut and odd inputs in small units beside a build in memory: the same triangles, attributes
and materials, or a sentence from both; nothing gets lost without a warning."""

from __future__ import annotations

import gzip
import json
import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import umbel
from helpers.commands import DATA
from umbel.geometry.arrays import extras_of
from umbel.io import Instance, Scene
from umbel.scale.build_asset import build_asset

UNIT = 1000
UGLY = sorted(DATA.glob("nasty_synth_*.ply")) if DATA.is_dir() else []


@pytest.fixture(autouse=True)
def units_in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hundreds of units, each in a process of its own, would take minutes."""
    monkeypatch.setattr("umbel.scale.build_asset._command", lambda _: [])


def outcome(build: Any, output: Path) -> tuple[dict[str, Any] | str, list[str]]:
    """What an asset has, or the error; and the warnings."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            build()
        except umbel.Error as error:
            return str(error), []
    asset = umbel.Asset(output)
    assert umbel.verify(output, cuts=8).ok
    info = asset.info
    names = ("source_digest", "source_triangles", "normals", "tangents", "uvs", "colors")
    found = {name: info[name] for name in names}
    found |= {"origin": asset.origin.tolist(), "name": info["metadata"]["name"]}
    found |= {"materials": len(asset.materials), "coordinates": asset.coordinates}
    found["used"] = sorted(set(asset.tables.clusters["material"].tolist()))
    return found, [str(one.message) for one in said]


def compare(source: Path, tmp_path: Path) -> tuple[Any, list[str]]:
    """Both ways; returns what they have in common, and the warnings of units."""
    a, b = tmp_path / "a.umbel", tmp_path / "b.umbel"
    whole, heard = outcome(lambda: umbel.build_lod(source).save(a), a)
    units, heard_of_units = outcome(lambda: build_asset(source, b, unit_triangles=UNIT), b)
    if isinstance(whole, str):
        assert isinstance(units, str)
        assert source.name in units
    else:
        assert units == whole
        assert sum("become one" in one for one in heard) == sum(
            "become one" in one for one in heard_of_units
        )
    assert not (tmp_path / "b.umbel.work").exists()
    return units, heard_of_units


@pytest.mark.parametrize("path", UGLY, ids=lambda path: path.stem)
def test_ugly_meshes(path: Path, tmp_path: Path) -> None:
    compare(path, tmp_path)


def colorful() -> umbel.Mesh:
    mesh = umbel.shapes.blob(4)
    n = len(mesh.positions)
    return umbel.Mesh(
        mesh.positions,
        mesh.triangles,
        normals=mesh.positions / np.linalg.norm(mesh.positions, axis=1, keepdims=True),
        uvs=mesh.positions[:, :2],
        colors=np.tile(np.float32([0.25, 0.5, 1, 1]), (n, 1)),
    )


def write_stl(path: Path, mesh: umbel.Mesh) -> None:
    corners = mesh.world_positions[mesh.triangles].astype("<f4")
    record = np.zeros(len(corners), [("n", "<f4", 3), ("p", "<f4", (3, 3)), ("a", "<u2")])
    record["p"] = corners
    path.write_bytes(bytes(80) + struct.pack("<I", len(corners)) + record.tobytes())


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    """One mesh in every format."""
    mesh = colorful()
    paths = [tmp_path / f"mesh{suffix}" for suffix in (".ply", ".obj", ".glb", ".gltf")]
    for path in paths:
        umbel.save(path, mesh)
    write_stl(tmp_path / "mesh.stl", mesh)
    (tmp_path / "packed.ply.gz").write_bytes(gzip.compress(paths[0].read_bytes()))
    return [*paths, tmp_path / "mesh.stl", tmp_path / "packed.ply.gz"]


def test_formats(files: list[Path], tmp_path: Path) -> None:
    for path in files:
        found, said = compare(path, tmp_path)
        assert found["source_triangles"] == 5120
        assert not said


@pytest.mark.parametrize("share", [0, 0.01, 0.2, 0.5, 0.9, 0.999])
def test_cut_files(files: list[Path], tmp_path: Path, share: float) -> None:
    for path in files:
        data = path.read_bytes()
        path.write_bytes(data[: int(len(data) * share)])
        compare(path, tmp_path)


def test_scenes_of_several_meshes(tmp_path: Path) -> None:
    red, blue = (umbel.Material(name=name) for name in ("red", "blue"))
    meshes = [umbel.shapes.blob(3), umbel.shapes.torus(24, 16), umbel.shapes.blob(2)]
    for k, mesh in enumerate(meshes[:2]):
        mesh.material_ids = np.full(len(mesh.triangles), k, np.uint32)
    mirrored = np.diag([-2.0, 1, 1, 1])
    mirrored[:3, 3] = [5, 6, 7]
    far = np.eye(4)
    far[0, 3] = 3e6
    places = [(0, np.eye(4)), (1, mirrored), (2, far), (0, far @ mirrored)]
    scene = Scene(meshes, [red, blue], [Instance(mesh, place) for mesh, place in places])
    umbel.save(tmp_path / "scene.glb", scene)
    found, said = compare(tmp_path / "scene.glb", tmp_path)
    assert found["materials"] == 3  # the third has none of its own, and gets the default
    assert any("4 nodes become one" in one for one in said)


def test_what_assets_cannot_hold_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "rich.gltf"
    umbel.save(path, colorful())
    root = json.loads(path.read_text())
    attributes = root["meshes"][0]["primitives"][0]["attributes"]
    attributes |= {"COLOR_1": attributes["COLOR_0"], "_HEAT": attributes["POSITION"]}
    samplers = [{"input": 0, "output": attributes["POSITION"]}]
    channels = [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]
    root["animations"] = [{"samplers": samplers, "channels": channels}]
    root["scenes"].append({"nodes": []})
    path.write_text(json.dumps(root | {"bogus": 1}))
    with pytest.warns(umbel.LoadWarning) as heard:
        umbel.load(path)
    (sentence,) = [str(one.message) for one in heard]
    assert "left out: the attributes COLOR_1, _HEAT; an animation; another scene; bogus" in sentence
    # Such a file need not fit into memory.
    monkeypatch.setattr("umbel.io.blocks.load_scene", None)
    found, said = compare(path, tmp_path)
    assert said == [sentence]
    assert found["colors"]


def attribute_sets(mesh: umbel.Mesh) -> dict[str, Any]:
    """What the corners of all triangles have, whatever their order."""
    _, extras = extras_of(mesh)
    columns = [mesh.positions, mesh.uvs, mesh.colors]
    columns += [None if extras is None else extras.reshape(len(mesh.positions), -1)]
    rows = np.concatenate([c for c in columns if c is not None], axis=1)[mesh.triangles.reshape(-1)]
    return {
        "corners": rows[np.lexsort(rows.T)].tobytes(),
        "uv_sets": len(mesh.uv_sets),
        "influences": 0 if mesh.joints is None else mesh.joints.shape[1],
    }


def compare_sets(source: Path, tmp_path: Path) -> tuple[umbel.Asset, list[str]]:
    """`compare`, and every set of attributes of the finest level, and the nodes."""
    _, said = compare(source, tmp_path)
    whole, units = umbel.Asset(tmp_path / "a.umbel"), umbel.Asset(tmp_path / "b.umbel")
    finest = [attribute_sets(asset.mesh(asset.cut(level=0))) for asset in (whole, units)]
    assert finest[0] == finest[1]
    top = units.mesh(units.cut(triangles=units.info["source_triangles"] // 8))
    assert attribute_sets(top)["influences"] == finest[0]["influences"]
    assert units.scene == whole.scene
    return units, said


@pytest.mark.skipif(not (DATA / "CesiumMan.glb").is_file(), reason="needs the meshes")
@pytest.mark.parametrize("name", ["CesiumMan.glb", "Fox.glb"])
def test_skinned_meshes(name: str, tmp_path: Path) -> None:
    units, _ = compare_sets(DATA / name, tmp_path)
    mesh = units.mesh(units.cut(level=0))
    assert mesh.joints is not None
    assert mesh.joints.max() > 8
    assert units.scene["skins"][0]["joints"]


def test_further_uvs_and_colors(tmp_path: Path) -> None:
    mesh = colorful()
    mesh.colors = np.clip(np.abs(mesh.positions[:, [0, 1, 2, 0]]), 0, 1).astype(np.float32)
    mesh.uv_sets = [mesh.positions[:, 1:] * 4, mesh.positions[:, ::2].copy()]
    umbel.save(tmp_path / "sets.glb", mesh)
    units, said = compare_sets(tmp_path / "sets.glb", tmp_path)
    assert len(units.mesh(units.cut(level=0)).uv_sets) == 2
    assert not said


def test_a_mesh_in_memory_keeps_joints(tmp_path: Path) -> None:
    mesh = colorful()
    n = len(mesh.positions)
    mesh.joints = np.arange(8 * n, dtype=np.uint32).reshape(n, 8) % 50
    mesh.weights = np.full((n, 8), 0.125, np.float32)
    lod = umbel.build_lod(mesh, unit_triangles=UNIT)
    finest = attribute_sets(lod.mesh(lod.cut(level=0)))
    assert finest == attribute_sets(mesh)


def area(mesh: umbel.Mesh) -> float:
    a, b, c = (mesh.positions[mesh.triangles[:, k]].astype(np.float64) for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def test_leaves_keep_their_area(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    at = rng.uniform(0, 100, (6000, 1, 3))
    corners = at + rng.uniform(-0.5, 0.5, (6000, 3, 3))
    mesh = umbel.Mesh(
        corners.reshape(-1, 3).astype(np.float32), np.arange(18000, dtype=np.uint32).reshape(-1, 3)
    )
    umbel.save(tmp_path / "leaves.ply", mesh)
    _, said = compare(tmp_path / "leaves.ply", tmp_path)
    assert not said
    build_asset(tmp_path / "leaves.ply", tmp_path / "c.umbel", unit_triangles=UNIT, keep_area=False)
    kept = {}
    for name in "abc":
        asset = umbel.Asset(tmp_path / f"{name}.umbel")
        kept[name] = area(asset.mesh(asset.cut(triangles=400))) / area(mesh)
    # In memory, in units, and in units without it.
    assert kept["b"] > 0.75 * kept["a"]
    assert kept["b"] > 2 * kept["c"]


def test_memory_for_leaves_and_soup(tmp_path: Path) -> None:
    """Vertices count, not only triangles."""
    write_stl(tmp_path / "soup.stl", umbel.shapes.blob(5))
    umbel.save(tmp_path / "mesh.ply", umbel.shapes.blob(5))
    from umbel import _umbel
    from umbel.io.blocks import open_source

    taken = []
    for name in ("mesh.ply", "soup.stl"):
        source = open_source(tmp_path / name, tmp_path / "work")
        plan = _umbel.plan_units(
            source.triangles, _umbel.LodConfig(), 0, 1 << 40, 1, source.vertices
        )
        taken.append(plan["unit_bytes"])
    assert taken[0] < taken[1]


def blobs_apart(path: Path, distance: float, size: float = 1) -> None:
    """Two balls in doubles, with so much between them."""
    ball = umbel.shapes.blob(3)
    positions = size * ball.positions.astype(np.float64)
    apart = np.concatenate([positions, positions + distance])
    triangles = np.concatenate([ball.triangles, ball.triangles + len(ball.positions)])
    record = np.zeros(len(triangles), [("n", "u1"), ("v", "<i4", 3)])
    record["n"], record["v"] = 3, triangles
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(apart)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path.write_bytes(header.encode() + apart.astype("<f8").tobytes() + record.tobytes())


def test_rounding_is_warned_of(tmp_path: Path) -> None:
    blobs_apart(tmp_path / "near.ply", 1000)
    assert not any("rounded" in one for one in compare(tmp_path / "near.ply", tmp_path)[1])
    blobs_apart(tmp_path / "far.ply", 300_000)
    assert any("rounded to 32-bit" in one for one in compare(tmp_path / "far.ply", tmp_path)[1])


def pack(path: Path) -> Path:
    """Packed files are read as a whole."""
    packed = path.with_suffix(".ply.gz")
    packed.write_bytes(gzip.compress(path.read_bytes()))
    return packed


def test_rounding_of_what_is_read_as_a_whole(tmp_path: Path) -> None:
    blobs_apart(tmp_path / "far.ply", 300_000)
    said = compare(pack(tmp_path / "far.ply"), tmp_path)[1]
    assert sum("rounded to 32-bit" in one for one in said) == 1
    blobs_apart(tmp_path / "dust.ply", 1e5, size=1e-3)
    found, _ = compare(pack(tmp_path / "dust.ply"), tmp_path)
    assert "triangles lost their area when positions were rounded" in found
    packed = tmp_path / "dust.ply.gz"
    with pytest.warns(umbel.LoadWarning, match="took the area of"):
        build_asset(packed, tmp_path / "b.umbel", unit_triangles=UNIT, force=True)


def test_what_rounding_destroys_is_refused_without_force(tmp_path: Path) -> None:
    path = tmp_path / "dust.ply"
    blobs_apart(path, 1e5, size=1e-3)
    said, _ = compare(path, tmp_path)
    assert "triangles lost their area when positions were rounded" in said
    with pytest.warns(umbel.LoadWarning, match="took the area of"):
        report = build_asset(path, tmp_path / "b.umbel", unit_triangles=UNIT, force=True)
    assert report["input_triangles"] == 2560
    assert report["largest_move"] > 0
