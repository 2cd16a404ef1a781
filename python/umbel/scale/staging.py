"""Work folders at addresses: what is there, and what each machine has of it.

The machine that drives a build has a folder that stands for the one at the address. A worker
fetches what its task needs, such as the stretches of sorted files that are its unit's, and stores
what it has made. The driver fetches what says that this is there, and at last the chunks of the
asset. A unit is done when its `.done` is there, a file is sorted when its `.places` is there: these
are stored last.
"""

from __future__ import annotations

import tempfile
import time
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import replace
from pathlib import Path

from umbel import _umbel
from umbel.errors import Error
from umbel.scale.address_lock import NAME as LOCK
from umbel.scale.address_lock import AddressLock
from umbel.scale.executor import SOURCE, Input, Result, Task, run
from umbel.scale.source_files import fetch_stretch
from umbel.scale.storage import Folder

#: Files that are fetched or stored at once.
_TRANSFERS = 8
_DONE = ".done"
_PLACES = ".places"
_CHUNKS = ".chunks"


def _plan(tier: int) -> str:
    return f"t{tier}/plan"


def _taken(tier: int) -> str:
    return f"t{tier}/taken"


def _encode_plan(plan: int) -> str:
    return f"t0/encode-{plan:016x}"


def _shard(tier: int, shard: int) -> str:
    return f"t{tier}/route/s{shard:06d}.route"


def _unit(tier: int, unit: int, what: str) -> str:
    return f"t{tier}/unit/u{unit:06d}{what}"


#: What a task leaves that the driver needs; in the order in which it is stored, the rest first.
_KEPT = {"build": (".groups", ".left", _DONE), "sort": (_PLACES,), "encode": (_CHUNKS,)}


def _made(task: Task) -> list[str]:
    """Names of what a task makes, the last of which says that it is done."""
    if task.kind == "sort":
        route = _shard(task.tier, task.unit)
        return [route, _stem(route) + _PLACES]
    if task.kind == "encode":
        return [_unit(task.tier, task.unit, f".{task.plan:016x}{_CHUNKS}")]
    whats = (".parts", ".exits", *_KEPT["build"])
    return [_unit(task.tier, task.unit, what) for what in whats]


def _is_own(name: str) -> bool:
    """Whether a build makes files of this name."""
    first, *below = name.split("/")
    is_tier = first[:1] == "t" and first[1:].isdigit()
    return is_tier if below else first == "manifest.json"


def _kept(task: Task) -> list[str]:
    return [name for name in _made(task) if name.endswith(_KEPT[task.kind])]


def perform_staged(task: Task) -> dict[str, float]:
    """Does a task of a work folder at an address. Gives seconds and bytes."""
    began = time.perf_counter()
    remote = Folder(task.work)
    with tempfile.TemporaryDirectory(prefix="umbel-unit-") as name:
        folder = Path(name)
        for tier in {0, max(0, task.tier - 1), task.tier}:
            for below in ("route", "unit"):
                (folder / f"t{tier}" / below).mkdir(parents=True)
        source, shards = None, None
        if task.kind == "build":
            fetched = _fetch_all(remote, folder, [_plan(task.tier)])
            fetched += _fetch_inputs(remote, task, folder)
            shards = [given.shard for given in task.inputs or ()]
        elif task.kind == "encode":
            needed = [_unit(task.tier, task.unit, what) for what in (".groups", ".parts")]
            fetched = _fetch_all(remote, folder, [_encode_plan(task.plan), *needed])
        elif task.tier > 0:
            exits = _unit(task.tier - 1, task.unit, ".exits")
            fetched = _fetch_all(remote, folder, [_plan(task.tier), exits])
        else:
            fetched = _fetch_all(remote, folder, [_plan(task.tier), SOURCE])
            source, bytes_read = fetch_stretch(folder, task.unit)
            fetched += bytes_read
        ready = time.perf_counter()
        later: list[int] = []  # what only some units need
        run(
            task,
            folder,
            shards,
            source,
            lambda: later.append(_fetch_all(remote, folder, list(task.files))),
        )
        built = time.perf_counter()
        stored = 0
        for made in _made(task):
            stored += (folder / made).stat().st_size
            remote.put(folder / made, made)
    return {
        "fetch_seconds": ready - began,
        "build_seconds": built - ready,
        "store_seconds": time.perf_counter() - built,
        "fetch_bytes": fetched + sum(later),
        "store_bytes": stored,
    }


def _fetch_all(remote: Folder, folder: Path, names: list[str]) -> int:
    for name in names:
        remote.get(name, folder / name)
    return sum((folder / name).stat().st_size for name in names)


def _fetch_inputs(remote: Folder, task: Task, folder: Path) -> int:
    """Sorted files with holes: where this unit needs nothing, they have nothing."""
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
        self._stored: set[str] = set()
        self._transfers = ThreadPoolExecutor(_TRANSFERS, "umbel-transfer")
        self._fetching: dict[Future[None], Result] = {}
        self._refuse_others()
        self._lock = AddressLock(self._remote)
        try:
            self._mirror()
        except BaseException:
            self.close()
            raise

    def _refuse_others(self) -> None:
        """A folder of somebody else's stays as it is."""
        there = self._remote.files()
        # The manifest is stored first and removed last.
        begun = "manifest.json" in there
        for name in there:
            if not (name == LOCK or (begun and _is_own(name))):
                raise Error(
                    f"the work folder {self.url} has files that are no build's, such as {name}: "
                    "name one that is empty"
                )

    def check(self) -> None:
        """Throws if another build has taken the folder."""
        self._lock.check()

    def _mirror(self) -> None:
        """What an earlier driver had done, here or elsewhere."""
        there = self._remote.files()
        there.pop(LOCK, None)
        # What is not there is not done, whatever is said here.
        for ending in (_DONE, _PLACES, _CHUNKS):
            for path in self._folder.glob(f"t*/*/*{ending}"):
                if path.relative_to(self._folder).as_posix() not in there:
                    path.unlink()
        units = {n.removesuffix(_DONE) for n in there if n.endswith(_DONE)}
        wanted = []
        for name, size in there.items():
            path = self._folder / name
            kind = name.split("/")[1] if name.count("/") > 1 else ""
            if kind == "unit":
                is_wanted = name.endswith(_CHUNKS) or (
                    name.endswith(_KEPT["build"]) and _stem(name) in units
                )
            else:
                is_wanted = kind != "route" or name.endswith(_PLACES)
            if is_wanted and not (path.exists() and path.stat().st_size == size):
                wanted.append(name)
        # Of a unit, what says that it is done comes last.
        for last in (False, True):
            names = [name for name in wanted if name.endswith(_DONE) == last]
            list(self._transfers.map(lambda n: self._remote.get(n, self._folder / n), names))

    def begin(self) -> None:
        """Stores what says whose build it is."""
        self._remote.put(self._folder / "manifest.json", "manifest.json")

    def prepared(self, task: Task) -> Task:
        """The task, with the names of what it needs. That itself is at the address then."""
        if task.kind == "encode":
            self._store_once([_encode_plan(task.plan)])
            return replace(task, inputs=())
        taken = _taken(task.tier)
        self._store_once([_plan(task.tier), "t0/passes", "t0/taken", taken, SOURCE])
        if task.kind == "sort":
            return replace(task, inputs=())
        if task.tier not in self._inputs:
            self._inputs = {task.tier: self._store_tier(task.tier)}
        files = (taken,) if taken in self._stored else ()
        return replace(task, inputs=tuple(self._inputs[task.tier].get(task.unit, ())), files=files)

    def _store_once(self, names: list[str]) -> None:
        for name in names:
            if name not in self._stored and (self._folder / name).exists():
                self._remote.put(self._folder / name, name)
                self._stored.add(name)

    def _store_tier(self, tier: int) -> dict[int, list[Input]]:
        """Sorted files of this machine. Gives where each unit has what."""
        there = self._remote.files()
        below = self._folder / f"t{tier}" / "route"
        inputs: dict[int, list[Input]] = {}
        missing: list[tuple[Path, str]] = []
        for name in sorted({path.stem for path in below.iterdir() if path.name[:1] == "s"}):
            shard, own = int(name[1:]), below / f"{name}.route"
            elsewhere = own.with_suffix(_PLACES)
            if own.exists():
                size, common, slices = _umbel.slice_places(own, tier)
                if there.get(_shard(tier, shard)) != size:
                    missing.append((own, _shard(tier, shard)))
            else:
                size, common, slices = _umbel.read_places(elsewhere)
            for unit, begin, end in slices:
                stretches = (*common, (begin, end))
                inputs.setdefault(unit, []).append(Input(shard, size, stretches))
        list(self._transfers.map(lambda pair: self._remote.put(*pair), missing))
        return inputs

    def fetch(self, result: Result) -> None:
        """Begins to fetch what a task has left for the driver."""
        self._fetching[self._transfers.submit(self._fetch, result)] = result

    def _fetch(self, result: Result) -> None:
        kept = 0
        for name in _kept(result.task):
            self._remote.get(name, self._folder / name)
            kept += (self._folder / name).stat().st_size
        result.measured["kept_bytes"] = kept

    def is_fetching(self) -> bool:
        """Whether anything is under way."""
        return bool(self._fetching)

    def fetched(self, seconds: float) -> Result | None:
        """A task whose files are on this machine now, or nothing after so long."""
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
        """Ends what is under way, and lets other builds in."""
        self._transfers.shutdown(cancel_futures=True)
        self._lock.release()

    def remove(self) -> None:
        """Removes all that the build has stored; the manifest last. The output may be here, too."""
        names = [name for name in self._remote.files() if _is_own(name)]
        self._remote.remove([name for name in names if name != "manifest.json"])
        self._remote.remove([name for name in names if name == "manifest.json"])


def _stem(name: str) -> str:
    return name.rsplit(".", 1)[0]
