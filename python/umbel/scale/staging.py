"""Work folders at addresses: what is there, and what each machine has of it.

The machine that drives a build has a folder that is like the one at the address. A worker fetches
the plan of its tier and the stretches of routed files that its unit needs, and stores what the unit
has left. A unit is done when its `.done` is there, which is stored last.
"""

from __future__ import annotations

import shutil
import tempfile
import time
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from pathlib import Path

from umbel import _umbel
from umbel.errors import Error
from umbel.scale.executor import Input, Result, Task
from umbel.scale.storage import Folder

#: Files that are fetched or stored at once.
_TRANSFERS = 8
_DONE = ".done"


def _plan(tier: int) -> str:
    return f"t{tier}/plan"


def _taken(tier: int) -> str:
    return f"t{tier}/taken"


def _shard(tier: int, shard: int) -> str:
    return f"t{tier}/route/s{shard:06d}.route"


def _unit(tier: int, unit: int, what: str) -> str:
    return f"t{tier}/unit/u{unit:06d}{what}"


def perform_staged(task: Task) -> dict[str, float]:
    """Builds a unit of a work folder at an address. Gives seconds and bytes."""
    began = time.perf_counter()
    remote = Folder(task.work)
    with tempfile.TemporaryDirectory(prefix="umbel-unit-") as name:
        folder = Path(name)
        for below in ("route", "unit"):
            (folder / f"t{task.tier}" / below).mkdir(parents=True)
        for file in (_plan(task.tier), *task.files):
            remote.get(file, folder / file)
        fetched = sum((folder / file).stat().st_size for file in task.files)
        fetched += _fetch_inputs(remote, task, folder)
        ready = time.perf_counter()
        shards = [given.shard for given in task.inputs or ()]
        _umbel.run_unit(folder, task.tier, task.unit, task.threads, shards)
        built = time.perf_counter()
        shutil.rmtree(folder / f"t{task.tier}" / "route")
        stored = 0
        for what in (".parts", ".exits", _DONE):
            path = folder / _unit(task.tier, task.unit, what)
            stored += path.stat().st_size
            remote.put(path, _unit(task.tier, task.unit, what))
    return {
        "fetch_seconds": ready - began,
        "build_seconds": built - ready,
        "store_seconds": time.perf_counter() - built,
        "fetch_bytes": fetched,
        "store_bytes": stored,
    }


def _fetch_inputs(remote: Folder, task: Task, folder: Path) -> int:
    """Routed files with holes: where this unit needs nothing, they have nothing."""
    wanted = [
        (_shard(task.tier, given.shard), begin, end)
        for given in task.inputs or ()
        for begin, end in given.stretches
    ]
    found = iter(remote.stretches(wanted))
    for given in task.inputs or ():
        with open(folder / _shard(task.tier, given.shard), "wb") as file:
            for begin, _ in given.stretches:
                file.seek(begin)
                file.write(next(found))
            file.truncate(given.bytes)
    return sum(end - begin for _, begin, end in wanted)


class Staging:
    """The folder at an address, for the machine that drives the build.

    folder: the one that is like it, on this machine. What the other has already is fetched.
    """

    def __init__(self, url: str, folder: Path) -> None:
        self.url = url
        self._remote = Folder(url)
        self._folder = folder
        self._inputs: dict[int, dict[int, list[Input]]] = {}
        self._transfers = ThreadPoolExecutor(_TRANSFERS, "umbel-transfer")
        self._fetching: dict[Future[None], Result] = {}
        self._mirror()

    def _mirror(self) -> None:
        """What an earlier driver had done, here or elsewhere. Routed files are made again."""
        there = self._remote.files()
        for name in there:
            first = name.split("/")[0]
            if first != "manifest.json" and not (first[:1] == "t" and first[1:].isdigit()):
                raise Error(
                    f"the work folder {self.url} has files that are no build's, such as {name}: "
                    "name one that is empty"
                )
        units = {n.removesuffix(_DONE) for n in there if n.endswith(_DONE)}
        wanted = []
        for name, size in there.items():
            path = self._folder / name
            kind = name.split("/")[1] if "/" in name else ""
            whole = kind != "route" and (kind != "unit" or _stem(name) in units)
            if whole and not (path.exists() and path.stat().st_size == size):
                wanted.append(name)
        # Of a unit, what says that it is done comes last.
        for last in (False, True):
            names = [name for name in wanted if name.endswith(_DONE) == last]
            list(self._transfers.map(lambda n: self._remote.get(n, self._folder / n), names))

    def begin(self) -> None:
        """Stores what says whose build it is."""
        self._remote.put(self._folder / "manifest.json", "manifest.json")

    def inputs(self, tier: int, unit: int) -> tuple[Input, ...]:
        """What a unit needs. With the first of a tier, what all need is stored."""
        if tier not in self._inputs:
            self._inputs = {tier: self._store_tier(tier)}
        return tuple(self._inputs[tier].get(unit, ()))

    def files(self, tier: int) -> tuple[str, ...]:
        """What every unit of the tier needs besides."""
        return (_taken(tier),) if (self._folder / _taken(tier)).exists() else ()

    def _store_tier(self, tier: int) -> dict[int, list[Input]]:
        there = self._remote.files()
        routes = sorted((self._folder / f"t{tier}" / "route").glob("s*.route"))
        inputs: dict[int, list[Input]] = {}
        missing: list[tuple[Path, str]] = []
        for path in routes:
            shard = int(path.stem[1:])
            size, common, slices = _umbel.slice_places(path, tier)
            for unit, begin, end in slices:
                stretches = (*common, (begin, end))
                inputs.setdefault(unit, []).append(Input(shard, size, stretches))
            if there.get(_shard(tier, shard)) != size:
                missing.append((path, _shard(tier, shard)))
        plans = [_plan(tier), "t0/passes", "t0/taken", _taken(tier)]
        missing += [(self._folder / n, n) for n in set(plans) if (self._folder / n).exists()]
        list(self._transfers.map(lambda pair: self._remote.put(*pair), missing))
        return inputs

    def fetch(self, result: Result) -> None:
        """Begins to fetch what a unit has left."""
        self._fetching[self._transfers.submit(self._fetch, result.task)] = result

    def _fetch(self, task: Task) -> None:
        for what in (".parts", ".exits", _DONE):
            name = _unit(task.tier, task.unit, what)
            self._remote.get(name, self._folder / name)

    def is_fetching(self) -> bool:
        """Whether anything is under way."""
        return bool(self._fetching)

    def fetched(self, seconds: float) -> Result | None:
        """A unit that is on this machine now, or nothing after so long."""
        wait(self._fetching, seconds, FIRST_COMPLETED)
        for future, result in self._fetching.items():
            if future.done():
                del self._fetching[future]
                try:
                    future.result()
                except Exception as error:  # every file system has its own
                    said = f"what {result.task.name} left cannot be fetched: {error}"
                    return Result(result.task, said, "io")
                return result
        return None

    def close(self) -> None:
        """Ends what is under way."""
        self._transfers.shutdown(cancel_futures=True)

    def remove(self) -> None:
        """Removes all that the build has stored; the manifest last."""
        names = list(self._remote.files())
        self._remote.remove([name for name in names if name != "manifest.json"])
        self._remote.remove([name for name in names if name == "manifest.json"])


def _stem(name: str) -> str:
    return name.rsplit(".", 1)[0]
