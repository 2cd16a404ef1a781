"""Builds on a Ray and a Dask cluster of this machine, with tiles, work and asset on an S3 server:
the bytes are those of one process, also where workers and the driver are killed."""

from __future__ import annotations

import contextlib
import hashlib
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import umbel
from helpers.commands import Umbel
from helpers.s3_server import s3_server
from umbel.scale import Dask, Ray
from umbel.scale.build_asset import build_asset
from umbel.scale.executor import InProcess

UNIT = 4000
PLACES = ("s3://bucket/tiles/*.ply", "s3://bucket/scan.umbel")
WORK = "s3://bucket/work"

DRIVER = f"""
import sys, umbel
from umbel.scale import Ray
umbel.build_asset(*{PLACES!r}, work={WORK!r}, unit_triangles={UNIT}, resume=True,
                  executor=Ray(sys.argv[1]))
"""


@pytest.fixture(scope="module")
def expected(made_of_tiles: bytes) -> str:
    return hashlib.sha256(made_of_tiles).hexdigest()


@pytest.fixture(scope="module")
def bucket(tiles: list[Path]) -> Iterator[Any]:
    # Ray's sockets have names of 107 characters at most, so pytest's folders are too deep.
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setenv("TMPDIR", folder)
        patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        # Addresses of this machine alone, whatever system it has.
        patch.setenv("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")
        patch.setattr("tempfile.tempdir", None)
        with s3_server(patch) as system:
            for tile in tiles:
                system.put_file(str(tile), f"bucket/tiles/{tile.name}")
            yield system


@pytest.fixture(scope="module")
def ray_cluster(bucket: Any) -> Iterator[str]:
    """Two machines with a processor each."""
    pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    node = {
        "num_cpus": 1,
        "memory": 1 << 30,
        "object_store_memory": 80 << 20,
        "node_ip_address": "127.0.0.1",
    }
    cluster = Cluster()
    try:
        cluster.add_node(**node, include_dashboard=False)
        cluster.add_node(**node)
        yield cluster.address
    finally:
        cluster.shutdown()


def check(bucket: Any, expected: str) -> None:
    assert hashlib.sha256(bucket.cat_file("bucket/scan.umbel")).hexdigest() == expected
    assert [name for name in bucket.find("bucket") if "/tiles/" not in name] == [
        "bucket/scan.umbel"
    ]
    bucket.rm_file("bucket/scan.umbel")


def test_ray(bucket: Any, ray_cluster: str, expected: str) -> None:
    report = build_asset(*PLACES, work=WORK, unit_triangles=UNIT, executor=Ray(ray_cluster))
    assert report["sha256"] == expected
    check(bucket, expected)


def test_build_lod(bucket: Any, tiles: list[Path], ray_cluster: str) -> None:
    here = umbel.build_lod(tiles, unit_triangles=UNIT)
    stored = umbel.build_lod(PLACES[0], work=WORK, unit_triangles=UNIT, executor=Ray(ray_cluster))
    assert Path(stored.path).read_bytes() == Path(here.path).read_bytes()
    assert not bucket.find("bucket/work")


def test_ray_through_a_folder(
    tiles: list[Path], ray_cluster: str, expected: str, tmp_path: Path
) -> None:
    output = tmp_path / "a.umbel"
    build_asset(tiles, output, unit_triangles=UNIT, executor=Ray(ray_cluster))
    assert hashlib.sha256(output.read_bytes()).hexdigest() == expected


def test_what_ray_does_not_have_is_said_at_once(ray_cluster: str) -> None:
    for executor, why in (
        (Ray("127.0.0.1:1"), "no Ray cluster at 127.0.0.1:1: Connection refused"),
        (Ray(ray_cluster, resources={"big": 2}), "has 1 processors, 2 big for a unit: add one$"),
        (Ray(ray_cluster, num_gpus=1), "1 GPU"),
        (Ray(ray_cluster, size=3), "size"),
    ):
        try:
            with pytest.raises(umbel.Error, match=why):
                executor.connect()
        finally:
            executor.close()


def test_an_address_that_takes_nothing_is_said_at_once(bucket: Any) -> None:
    for output, work, named in (
        ("s3://nowhere/a.umbel", WORK, "s3://nowhere/a.umbel"),
        (PLACES[1], "s3://nowhere/work", "s3://nowhere/work"),
    ):
        with pytest.raises(umbel.Error, match=f"cannot write {named}"):
            build_asset(PLACES[0], output, work=work, executor=InProcess())
    assert all("/tiles/" in name for name in bucket.find("bucket"))


def tasks_done(bucket: Any) -> int:
    """Tasks of any kind whose files are stored; the driver may be removing them."""
    with contextlib.suppress(FileNotFoundError):
        ends = (".done", ".places", ".chunks")
        return sum(name.endswith(ends) for name in bucket.find("bucket/work"))
    return 0


def ray_workers() -> list[int]:
    """Processes of this user that are at a task."""
    found = []
    for path in Path("/proc").iterdir():
        try:
            if path.name.isdigit() and (path / "cmdline").read_bytes().startswith(b"ray::perform"):
                found.append(int(path.name))
        except OSError:
            continue
    return found


def test_workers_and_driver_killed(bucket: Any, ray_cluster: str, expected: str) -> None:
    chance = random.Random(0)
    workers_killed = 0
    for start in range(3):
        driver = subprocess.Popen([sys.executable, "-c", DRIVER, ray_cluster])
        # The last is left alone.
        most = chance.randint(1, 30) * (start + 1) if start < 2 else 1 << 30
        end = time.monotonic() + (60 if start < 2 else 600)
        try:
            while driver.poll() is None and time.monotonic() < end:
                time.sleep(chance.uniform(0.05, 0.3))
                if tasks_done(bucket) >= most:
                    break
                workers = ray_workers()
                if workers and workers_killed < 2 * (start + 1):
                    os.kill(chance.choice(workers), signal.SIGKILL)
                    workers_killed += 1
        finally:
            driver.kill()
        assert driver.wait() in (0, -signal.SIGKILL)
        if driver.returncode == 0:
            break
    assert workers_killed + start > 0
    check(bucket, expected)


def test_command(
    bucket: Any, tiles: list[Path], ray_cluster: str, umbel_command: Umbel, tmp_path: Path
) -> None:
    outputs = [tmp_path / "a.umbel", "s3://bucket/scan.umbel"]
    sums = []
    for output, source in zip(outputs, (tiles[0].parent / "*.ply", PLACES[0]), strict=True):
        done = umbel_command(
            "build", source, "-o", output, "--ray", ray_cluster, "--unit-triangles", UNIT, "--json"
        )
        assert done.status == 0, done.err
        sums.append(done.json["sha256"])
    bucket.rm_file("bucket/scan.umbel")
    assert sums[0] == sums[1] == hashlib.sha256(outputs[0].read_bytes()).hexdigest()


def test_command_with_one_file(
    tiles: list[Path], ray_cluster: str, umbel_command: Umbel, tmp_path: Path
) -> None:
    sums = []
    for flags in ([], ["--ray", ray_cluster]):
        output = tmp_path / f"{len(flags)}.umbel"
        arguments = ["build", tiles[0], "-o", output, "--unit-triangles", UNIT, "--json", *flags]
        done = umbel_command(*arguments)
        assert done.status == 0, done.err
        sums.append(done.json["sha256"])
    assert sums[0] == sums[1]


def test_dask(bucket: Any, expected: str, tiles: list[Path], tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
    ) as cluster:
        executor = Dask(cluster.scheduler_address)
        report = build_asset(*PLACES, work=WORK, unit_triangles=UNIT, executor=executor)
        # An executor may serve another build.
        build_asset(tiles, tmp_path / "a.umbel", unit_triangles=UNIT, executor=executor)
    assert report["sha256"] == expected
    assert hashlib.sha256((tmp_path / "a.umbel").read_bytes()).hexdigest() == expected
    check(bucket, expected)
