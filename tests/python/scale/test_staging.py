"""Work folders, sources and outputs at addresses: what is there, and what is fetched of it."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import umbel
from umbel.scale.build_asset import build_asset
from umbel.scale.executor import InProcess, Result, Task
from umbel.scale.storage import scratch
from umbel.testing import giant

fsspec = pytest.importorskip("fsspec")

UNIT = 4000
TILES = "memory://bucket/tiles/*.ply"
OUTPUT = "memory://bucket/scan.umbel"
WORK = "memory://bucket/job"


@pytest.fixture
def bucket(tiles: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.setattr("umbel.scale.address_lock._SETTLE", 0.01)
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    system = fsspec.filesystem("memory")
    for tile in tiles:
        system.pipe(f"/bucket/tiles/{tile.name}", tile.read_bytes())
    yield system
    system.rm("/bucket", recursive=True)


def names(bucket: Any) -> list[str]:
    return sorted(path for path in bucket.find("/bucket") if "/tiles/" not in path)


class Stops(InProcess):
    """Is ended after so many tasks."""

    def __init__(self, after: int) -> None:
        super().__init__()
        self.left = after
        self.done: list[tuple[str, int, int]] = []

    def wait(self, seconds: float) -> Result | None:
        if self.left == 0:
            raise KeyboardInterrupt
        result = super().wait(seconds)
        if result:
            assert not result.error, result.error
            self.left -= 1
            self.done.append((result.task.kind, result.task.tier, result.task.unit))
            # What is large stays at the address.
            for what in ("parts", "exits", "route"):
                assert not list(scratch(WORK).glob(f"**/*.{what}"))
        return result


def build(executor: Any, **options: Any) -> dict[str, Any]:
    return build_asset(TILES, OUTPUT, work=WORK, unit_triangles=UNIT, executor=executor, **options)


def test_everything_at_addresses(bucket: Any, made_of_tiles: bytes, tmp_path: Path) -> None:
    report = build(InProcess())
    assert names(bucket) == ["/bucket/scan.umbel"]
    assert bucket.cat("/bucket/scan.umbel") == made_of_tiles
    assert not list((tmp_path / "temporary").iterdir())
    first = [unit for unit in report["units"] if unit["tier"] == 0]
    # Of routed files each unit fetches its own part.
    routed = sum(unit["fetch_bytes"] for unit in first)
    assert routed < 40 * report["input_triangles"]


@pytest.mark.parametrize("elsewhere", [False, True])
@pytest.mark.parametrize("after", [1, 9, 40])
def test_driver_starts_again(
    bucket: Any, made_of_tiles: bytes, tmp_path: Path, after: int, elsewhere: bool
) -> None:
    first, second = Stops(after), Stops(-1)
    with pytest.raises(KeyboardInterrupt):
        build(first)
    assert "/bucket/job/manifest.json" in names(bucket)
    if elsewhere:
        shutil.rmtree(tmp_path / "temporary")
        (tmp_path / "temporary").mkdir()
    with pytest.raises(umbel.Error, match="not finished: go on with resume"):
        build(Stops(-1))
    build(second, resume=True)
    assert bucket.cat("/bucket/scan.umbel") == made_of_tiles
    assert names(bucket) == ["/bucket/scan.umbel"]
    # What was stored is not built again; of the last, nobody may have heard.
    assert not set(first.done) & set(second.done)


@pytest.mark.parametrize("after", [-1, 5])
def test_leaves_at_addresses(bucket: Any, tmp_path: Path, after: int) -> None:
    """Those that are enlarged need to know where others are, a driver that starts again too."""
    mesh = giant.foliage(12_000)
    giant.write(mesh, tmp_path / "leaves.ply")
    build_asset(tmp_path / "leaves.ply", tmp_path / "a.umbel", unit_triangles=UNIT, workers=1)
    bucket.pipe("/bucket/leaves.ply", (tmp_path / "leaves.ply").read_bytes())
    options: dict[str, Any] = {"work": WORK, "unit_triangles": UNIT}
    if after > 0:
        with pytest.raises(KeyboardInterrupt):
            build_asset("memory://bucket/leaves.ply", OUTPUT, executor=Stops(after), **options)
        assert any(name.endswith("t0/taken") for name in names(bucket))
        shutil.rmtree(tmp_path / "temporary")
        (tmp_path / "temporary").mkdir()
    last = Stops(-1)
    report = build_asset(
        "memory://bucket/leaves.ply", OUTPUT, executor=last, resume=after > 0, **options
    )
    assert report["groups_by_reason"]["sloppy"]["area lost"] > 0
    assert bucket.cat("/bucket/scan.umbel") == (tmp_path / "a.umbel").read_bytes()


def test_damaged_input_of_a_unit_is_noticed(bucket: Any) -> None:
    class Damages(InProcess):
        def submit(self, task: Task) -> None:
            if task.kind != "build":
                return super().submit(task)
            assert task.inputs
            path = f"/bucket/job/t0/route/s{task.inputs[0].shard:06d}.route"
            data = bytearray(bucket.cat(path))
            begin, end = task.inputs[0].stretches[-1]
            data[(begin + end) // 2] ^= 1
            bucket.pipe(path, bytes(data))
            super().submit(task)

    with pytest.raises(umbel.Error, match="is damaged"):
        build(Damages())
    assert "/bucket/scan.umbel" not in names(bucket)


def test_all_but_writing_is_done_by_tasks(bucket: Any) -> None:
    report = build(InProcess())
    kinds = {(done["kind"], done["tier"] > 0) for done in report["tasks"]}
    both = {(kind, later) for kind in ("build", "sort", "encode") for later in (False, True)}
    assert kinds == both
    encoded = [done for done in report["tasks"] if done["kind"] == "encode"]
    assert len(encoded) == len(report["units"])
    # What the driver fetches last is the asset, in other pieces.
    stored = sum(done["store_bytes"] for done in encoded)
    assert 0.8 * report["file_bytes"] < stored < 1.2 * report["file_bytes"]


def test_other_precision_after_a_stop(bucket: Any, tmp_path: Path) -> None:
    """Chunks that were encoded for other settings are not taken."""
    some = Stops(-1)
    build(some)
    bucket.rm("/bucket/scan.umbel")
    first = Stops(len(some.done) - 3)
    with pytest.raises(KeyboardInterrupt):
        build(first)
    assert first.done[-1][0] == "encode"
    build(Stops(-1), resume=True, attribute_bits={"uv": 20}, threads=1)
    again = bucket.cat("/bucket/scan.umbel")
    build(InProcess(), attribute_bits={"uv": 20})
    assert bucket.cat("/bucket/scan.umbel") == again


def test_source_of_this_machine_is_sorted_here(
    bucket: Any, tiles: list[Path], made_of_tiles: bytes
) -> None:
    report = build_asset(tiles, OUTPUT, work=WORK, unit_triangles=UNIT, executor=InProcess())
    assert bucket.cat("/bucket/scan.umbel") == made_of_tiles
    assert not any(t["kind"] == "sort" and t["tier"] == 0 for t in report["tasks"])


def test_attributes_that_are_not_wanted(bucket: Any, tmp_path: Path) -> None:
    mesh = next(iter(giant.terrain(12_000, seed=5, seams=True).blocks()))
    whole = umbel.Mesh(mesh.positions, mesh.triangles, uvs=mesh.uvs)
    umbel.save(tmp_path / "a.glb", whole)
    bucket.put_file(str(tmp_path / "a.glb"), "/bucket/a.glb")
    for attributes in ("auto", "none"):
        given = {"unit_triangles": UNIT, "attributes": attributes}
        build_asset(tmp_path / "a.glb", tmp_path / "a.umbel", **given)
        report = build_asset(
            "memory://bucket/a.glb", OUTPUT, work=WORK, executor=InProcess(), **given
        )
        assert any(t["kind"] == "sort" and t["tier"] == 0 for t in report["tasks"])
        assert bucket.cat("/bucket/scan.umbel") == (tmp_path / "a.umbel").read_bytes()


@pytest.mark.parametrize("own", ["notes.txt", "t1/mesh.ply"])
def test_folders_of_others_are_left_alone(bucket: Any, own: str) -> None:
    bucket.pipe(f"/bucket/job/{own}", b"mine")
    with pytest.raises(umbel.Error, match=f"no build's, such as {own}"):
        build(InProcess())
    assert names(bucket) == [f"/bucket/job/{own}"]


def test_the_output_may_be_in_the_work_folder(bucket: Any, made_of_tiles: bytes) -> None:
    output = f"{WORK}/scan.umbel"
    build_asset(TILES, output, work=WORK, unit_triangles=UNIT, executor=InProcess())
    assert bucket.cat("/bucket/job/scan.umbel") == made_of_tiles
    assert not any(name.startswith("/bucket/job/t0") for name in names(bucket))


def test_addresses_without_an_executor(bucket: Any, made_of_tiles: bytes) -> None:
    build_asset(TILES, OUTPUT, unit_triangles=UNIT, workers=1)
    assert bucket.cat("/bucket/scan.umbel") == made_of_tiles
    with pytest.raises(umbel.Error, match="for a build with an executor"):
        build_asset(TILES, OUTPUT, work=WORK, unit_triangles=UNIT)


def test_folder_of_somebody_else_is_refused(bucket: Any, tmp_path: Path) -> None:
    (tmp_path / "theirs").mkdir()
    stand_in = scratch(WORK)
    stand_in.rmdir()
    stand_in.symlink_to(tmp_path / "theirs")
    with pytest.raises(umbel.Error, match="set TMPDIR"):
        build(InProcess())
    assert not list((tmp_path / "theirs").iterdir())
