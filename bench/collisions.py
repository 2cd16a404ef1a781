"""Collisions of two meshes side by side: Umbel, FCL (python-fcl) and trimesh's manager, which is on
FCL too.

    python bench/collisions.py [--runs N] [--poses N] [-o DIR] MESH...

One thread, processor time, medians of runs that take turns. Each mesh collides with a copy of
itself in poses around it: turned, and shifted by a third of its diagonal. Two questions: whether
they collide, and which pairs of triangles do. Prints a table, and writes it to
DIR/collisions-cpu.csv. Peers that are not installed are left out: pip install python-fcl trimesh.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

import umbel

Question = Callable[[np.ndarray], Any]


def seconds_of(work: Callable[[], Any]) -> tuple[Any, float]:
    """What a call gives, and its processor time."""
    start = time.process_time()
    result = work()
    return result, time.process_time() - start


def poses_around(mesh: umbel.Mesh, count: int) -> list[np.ndarray]:
    """Turns about random axes, and shifts in random directions."""
    dice = np.random.default_rng(1)
    low, high = mesh.positions.min(0), mesh.positions.max(0)
    middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
    found = []
    for _ in range(count):
        turn, _upper = np.linalg.qr(dice.normal(size=(3, 3)))
        turn *= np.sign(np.linalg.det(turn))
        way = dice.normal(size=3)
        pose = np.eye(4)
        pose[:3, :3] = turn
        pose[:3, 3] = middle - turn @ middle + way / np.linalg.norm(way) * size / 3
        found.append(pose)
    return found


class ByUmbel:
    """Two hierarchies."""

    def __init__(self, mesh: umbel.Mesh) -> None:
        self.bvh = umbel.Bvh(mesh, threads=1)

    def collides(self, pose: np.ndarray) -> bool:
        return self.bvh.collides(self.bvh, pose, threads=1)

    def pairs(self, pose: np.ndarray) -> int:
        return len(self.bvh.collide(self.bvh, pose, threads=1))


class ByFcl:
    """Two of FCL's hierarchies, of oriented boxes and rectangle-swept spheres."""

    def __init__(self, mesh: umbel.Mesh) -> None:
        import fcl

        self.fcl = fcl
        model = fcl.BVHModel()
        model.beginModel(len(mesh.positions), len(mesh.triangles))
        model.addSubModel(mesh.positions.astype(np.float64), mesh.triangles.astype(np.int32))
        model.endModel()
        self.first, self.second = (fcl.CollisionObject(model) for _ in range(2))

    def _ask(self, pose: np.ndarray, most: int, with_contacts: bool) -> Any:
        self.second.setTransform(self.fcl.Transform(pose[:3, :3], pose[:3, 3]))
        request = self.fcl.CollisionRequest(num_max_contacts=most, enable_contact=with_contacts)
        result = self.fcl.CollisionResult()
        self.fcl.collide(self.first, self.second, request, result)
        return result

    def collides(self, pose: np.ndarray) -> bool:
        return bool(self._ask(pose, 1, False).is_collision)

    def pairs(self, pose: np.ndarray) -> int:
        contacts = self._ask(pose, 1 << 24, True).contacts
        return len({(c.b1, c.b2) for c in contacts})


class ByTrimesh:
    """trimesh's manager; it answers whether, and pairs of objects, not of triangles."""

    def __init__(self, mesh: umbel.Mesh) -> None:
        import fcl  # noqa: F401  # trimesh's manager needs it, and raises a ValueError without
        import trimesh

        shape = trimesh.Trimesh(mesh.positions, mesh.triangles, process=False)
        self.shape = shape
        self.manager = trimesh.collision.CollisionManager()
        self.manager.add_object("one", shape)
        self.manager.add_object("other", shape)

    def collides(self, pose: np.ndarray) -> bool:
        self.manager.set_transform("other", pose)
        return bool(self.manager.in_collision_internal())

    def pairs(self, _pose: np.ndarray) -> None:
        return None


PEERS: dict[str, Callable[[umbel.Mesh], Any]] = {
    "Umbel": ByUmbel,
    "FCL": ByFcl,
    "trimesh's manager": ByTrimesh,
}


def measure(path: Path, runs: int, poses: int) -> list[dict[str, Any]]:
    """A row for each peer."""
    mesh = umbel.load(path)
    found = poses_around(mesh, poses)
    rows: list[dict[str, Any]] = []
    made: dict[str, Any] = {}
    for name, make in PEERS.items():
        try:
            made[name], built = seconds_of(lambda make=make: make(mesh))
        except ImportError as error:
            print(f"{name}: {error}")
            continue
        rows.append(
            {"mesh": path.stem, "triangles": len(mesh.triangles), "peer": name, "build": built}
        )
    for question in ("collides", "pairs"):
        times: dict[str, list[float]] = {name: [] for name in made}
        answers: dict[str, list[Any]] = {}
        for _ in range(runs):
            for name, peer in made.items():
                ask: Question = getattr(peer, question)
                answers[name], seconds = seconds_of(lambda ask=ask: [ask(pose) for pose in found])
                times[name].append(seconds / poses)
        for row in rows:
            has_answer = answers[row["peer"]][0] is not None
            row[f"{question}_ms"] = 1e3 * median(times[row["peer"]]) if has_answer else None
            row[question] = sum(answers[row["peer"]]) if has_answer else None
    for row in rows:
        print(*row.values(), sep="\t", flush=True)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("meshes", nargs="+", type=Path, metavar="MESH")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--poses", type=int, default=20)
    parser.add_argument("-o", dest="folder", type=Path, metavar="DIR")
    given = parser.parse_args()
    rows = [row for path in given.meshes for row in measure(path, given.runs, given.poses)]
    if given.folder is not None:
        given.folder.mkdir(parents=True, exist_ok=True)
        with open(given.folder / "collisions-cpu.csv", "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
