"""From mesh files to an asset, unit by unit: any mesh in a memory that the caller sets."""

from __future__ import annotations

import json
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

from umbel import _umbel
from umbel.errors import Error
from umbel.geometry.arrays import thread_count
from umbel.geometry.mesh import Mesh
from umbel.geometry.origin import Rounding
from umbel.geometry.precision_loss import refuse_lost_area, warn_of_rounding
from umbel.geometry.repair import Progress
from umbel.io.blocks import Paths, Source, open_source
from umbel.lod.attribute_precision import exact_but
from umbel.lod.build import _group_limits, _native_config
from umbel.lod.materials import write_materials
from umbel.plain_json import encode
from umbel.scale.executor import Executor, library
from umbel.scale.feed import Feed
from umbel.scale.memory import limit_of
from umbel.scale.source_files import write_recipe
from umbel.scale.staging import Staging
from umbel.scale.storage import (
    as_path,
    check_writable,
    expand,
    fetch_sources,
    is_address,
    put_file,
    scratch,
    sha256_of,
    write_file,
)
from umbel.scale.watched_files import WatchedFiles
from umbel.scale.worker import python_command

#: What an asset says of itself besides what the library knows.
Metadata = dict[str, Any] | Callable[[list[Path]], dict[str, Any]] | None


def build_asset(
    source: Paths | Mesh | Iterable[Any],
    output: str | os.PathLike[str],
    *,
    memory: float | str | None = None,
    work: str | os.PathLike[str] | None = None,
    resume: bool = False,
    unit_triangles: int = 0,
    workers: int = 0,
    executor: Executor | None = None,
    max_triangles: int = 128,
    max_vertices: int = 128,
    group_size: tuple[int, int] = (24, 32),
    attributes: str = "auto",
    mix_materials: bool = False,
    seams: str = "allow",
    creases: str = "allow",
    attribute_bits: Mapping[str, int] | None = None,
    allow_outside: bool = False,
    force: bool = False,
    textures: str = "embed",
    metadata: Metadata = None,
    progress: Progress | None = None,
    threads: int = 0,
    **settings: Any,
) -> dict[str, Any]:
    """Builds an asset of a mesh of any size, in parts of space that fit into memory: units.

    The bytes depend on the source and the settings alone, not on the memory, the number of workers
    and threads, or how often the build was stopped. A mesh that fits into one unit gives what
    `build_lod` gives. Returns a report.

    source: a mesh file, several as one mesh, a `Mesh`, an iterable of blocks, or an
        object that gives any range of its triangles (`triangle_count`, `block(begin, end)`): see
        `umbel.io.blocks.open_source`. Files may be patterns (`tiles/*.ply`), which stand for what
        they match in the order of the names, and source, output and work may be addresses
        (`s3://bucket/city.umbel`) of whatever fsspec knows; this machine then has a copy in its
        folder for temporary files.
    memory: bytes, or a text such as "2GB"; None: three quarters of what is free.
    work: a folder for what is built before it is whole, some 45 bytes a triangle; by default beside
        the output, OUTPUT.work. It is removed at the end, and stays where the build is stopped.
    resume: go on with what an earlier call with the same arguments left in that folder.
    unit_triangles: most triangles of a unit, by default 4 Mi. Smaller units need less memory, and
        leave slightly coarser levels. This changes the result.
    workers: processes that build units side by side; 0: as many as memory and cores allow.
    executor: builds units elsewhere, such as `umbel.scale.Ray()`. The work folder must then be one
        that all machines have, or an address.
    metadata: added to what the asset says of itself; or what gives that for the files that are
        read, as they are on this machine.
    progress: called with (fraction, stage); returning False cancels (umbel.Cancelled).
    settings: others of `build_lod`: min_triangles, the costs, ratio, the weights, keep_area,
        refit_attributes, max_levels, stop_triangles, max_error. Those that need the whole mesh in
        memory are refused.
    The rest is as `build_lod` and `Lod.save` have it.
    """
    if attributes not in ("auto", "none"):
        raise Error(f"attributes must be 'auto' or 'none', not {attributes!r}")
    config: dict[str, Any] = {
        "max_triangles": max_triangles,
        "max_vertices": max_vertices,
        **_group_limits(group_size),
        "attributes": attributes == "auto",
        "mix_materials": mix_materials,
        "seams": seams,
        "creases": creases,
    }
    for name, value in settings.items():
        if name not in _SETTINGS:
            raise Error(f"{name} is no setting of a build in units")
        config[name] = value
    return build_with(
        source,
        output,
        config,
        memory=memory,
        work=work,
        resume=resume,
        unit_triangles=unit_triangles,
        workers=workers,
        executor=executor,
        attribute_bits=attribute_bits,
        allow_outside=allow_outside,
        force=force,
        textures=textures,
        metadata=metadata,
        progress=progress,
        threads=threads,
    )


#: The library's sentence about what rounding takes, which knows no files.
_LOST = "lost their area when positions were rounded"
#: Of `build_lod`, those that only change what a unit does by itself.
_SETTINGS = (
    "min_triangles",
    "underfill_cost",
    "vertex_underfill_cost",
    "overlap_cost",
    "group_underfill_cost",
    "group_overlap_cost",
    "ratio",
    "normal_weight",
    "uv_weight",
    "color_weight",
    "tangent_weight",
    "skin_weight",
    "keep_area",
    "refit_attributes",
    "max_levels",
    "stop_triangles",
    "max_error",
)


def build_with(
    source: Paths | Mesh | Iterable[Any],
    output: str | os.PathLike[str],
    config: dict[str, Any],
    *,
    memory: float | str | None = None,
    work: str | os.PathLike[str] | None = None,
    resume: bool = False,
    unit_triangles: int = 0,
    workers: int = 0,
    executor: Executor | None = None,
    attribute_bits: Mapping[str, int] | None = None,
    allow_outside: bool = False,
    force: bool = False,
    textures: str = "embed",
    metadata: Metadata = None,
    progress: Progress | None = None,
    threads: int = 0,
) -> dict[str, Any]:
    """As `build_asset`, by a configuration as the library takes it."""
    began = time.perf_counter()
    if unit_triangles < 0 or 0 < unit_triangles < 1000:
        raise Error(f"unit_triangles must be at least 1000, not {unit_triangles}")
    native = _native_config(config)
    precision = exact_but(attribute_bits)
    place = _place(source, output, work, executor is not None)
    folder_path, made = place.folder, place.output
    target = Path(os.path.realpath(made))
    if target.is_dir():
        raise Error(f"cannot write {made}: it is a folder")
    if not target.parent.is_dir():
        raise Error(f"cannot write {made}: there is no folder {target.parent}")
    # Names of files may be no text.
    input_named = place.named.encode("utf-8", "backslashreplace").decode()
    identity = [("format", "1"), ("library", library()), ("input", input_named)]
    limit = limit_of(memory)
    staging = Staging(place.url, folder_path) if place.url else None
    try:
        folder = _umbel.WorkFolder(folder_path, native, unit_triangles, identity, resume)
    except BaseException:
        if staging:
            staging.close()
        raise
    is_read = False
    try:
        if allow_outside and any(is_address(file) for file in place.files):
            raise Error("allow_outside is of files; an address's folder is never left")
        if executor:
            executor.connect()
        if staging:
            staging.begin()
        _remove_leftovers(made)
        here = fetch_sources(place.files, place.fetched)
        watched = WatchedFiles(progress)
        watched.watch(here)
        opened = open_source(here or source, folder_path / "source", allow_outside=allow_outside)
        if not force:
            refuse_lost_area(opened.rounding, opened.triangles.triangles, f"{place.said}: ")
        watched.watch(Path(file) for file in (opened.recipe or {}).get("files", []))
        is_same = _is_same_input(opened, folder_path / "source_stamp", folder.is_resumed)
        cores = thread_count(threads) or os.cpu_count() or 1
        plan = _umbel.plan_units(
            opened.triangles, native, unit_triangles, limit, cores, opened.vertices or 0
        )
        count = min(workers, plan["workers"]) if workers > 0 else plan["workers"]
        feed = None
        if executor:
            sorts = write_recipe(opened, place.files, folder_path, staging is not None)
            executor.start(max(plan["unit_bytes"], _sorting_bytes(opened)), 1)
            feed = Feed(executor, str(folder_path.absolute()), 1, staging, sorts)
        materials, images = write_materials(
            opened.materials, textures, made.absolute().parent, thread_count(threads)
        )
        files = _stored(images, folder_path / "source")
        # So they take no memory while units are built.
        opened.materials, images = [], []
        said: dict[str, Any] = {
            "generator": f"umbel {_umbel.version()}",
            "name": source.name if isinstance(source, Mesh) else _name(place.files),
            "config": {**config, "unit_triangles": unit_triangles or 4 << 20},
            "source": {"triangles": opened.triangles.triangles, **_described(opened)},
        }
        more = metadata(opened.files) if callable(metadata) else metadata or {}
        for key, value in more.items():
            said[key] = {**said[key], **value} if key == "source" else value
        if opened.coordinates:
            said["coordinates"] = opened.coordinates
        encode(said)  # what is no JSON is refused before anything is built

        def metadata_of(finished: dict[str, Any]) -> str:
            report = {k: v for k, v in finished["report"].items() if k != "seconds"}
            return encode({**said, "report": report})

        is_read = True
        finished = _umbel.build_units(
            folder,
            opened.triangles,
            native,
            unit_triangles,
            made,
            metadata_of,
            materials,
            files,
            precision,
            0,
            _command(max(1, cores // count)),
            count,
            opened.vertices or 0,
            is_same,
            watched,
            thread_count(threads),
            feed,
            force,
            encode(opened.tree) if opened.tree else "",
        )
        _warn_of_rounding(opened, finished, place.said)
        finished["report"]["input_vertices"] = opened.vertices
        del opened
        peaks = [path.read_bytes() for path in folder_path.glob("t*/unit/*.peak")]
        stored = {}
        if place.output_url:
            stored["sha256"] = sha256_of(made)
            put_file(made, place.output_url)
        if staging:
            staging.check()
        folder.remove()
        if staging:
            staging.remove()
        place.remove()
    except Exception as error:
        # Of an input or an argument at fault nothing is worth keeping: once that is mended, it
        # could not be resumed. What a callback raises only stops the build.
        begun = folder.is_resumed or any(folder_path.glob("t0/unit/*.done"))
        is_fault = (
            error.code not in ("io", "cancelled") if isinstance(error, Error) else not is_read
        )
        if is_fault and not begun:
            folder.remove()
            if staging:
                staging.remove()
            place.remove()
        if isinstance(error, Error) and _LOST in str(error) and len(place.files) == 1:
            named = Error(f"{place.files[0]}: {error}")
            named.code = error.code
            raise named from None
        raise
    finally:
        folder.close()
        if executor:
            executor.close()
        if staging:
            staging.close()
    report = {**finished.pop("report"), "seconds": time.perf_counter() - began}
    return {
        **report,
        "levels": finished["levels"],
        "groups": finished["groups"],
        "clusters": finished["clusters"],
        "triangles_all_levels": finished["triangles"],
        "file_bytes": finished["bytes"],
        "workers": count,
        "worker_peak_rss_bytes": max((int(peak) for peak in peaks if peak.isdigit()), default=0),
        "unit_triangles": unit_triangles or 4 << 20,
        **stored,
        **({"units": feed.units, "tasks": feed.measured} if feed else {}),
    }


@dataclass
class _Place:
    """Where a build reads, works and writes. What is at an address has a stand-in here."""

    files: list[str]  #: that are read; none for blocks
    named: str  #: the input, as a build that goes on must have it again
    output: Path
    output_url: str | None
    folder: Path  #: to work in
    url: str | None  #: of the work folder
    root: Path | None  #: of all stand-ins

    @property
    def said(self) -> str:
        """The input, for sentences."""
        return self.files[0] if len(self.files) == 1 else f"{len(self.files) or 'the'} inputs"

    @property
    def fetched(self) -> Path:
        """Where source files go."""
        return (self.root or self.folder) / "files"

    def remove(self) -> None:
        """Removes the stand-ins."""
        if self.root:
            shutil.rmtree(self.root, ignore_errors=True)


def _place(source: Any, output: str | os.PathLike[str], work: Any, is_elsewhere: bool) -> _Place:
    files = [source] if isinstance(source, (str, os.PathLike)) else source
    is_files = isinstance(files, Sequence) and all(
        isinstance(path, (str, os.PathLike)) for path in files
    )
    names = expand(files) if is_files else []
    named = ", ".join(n if is_address(n) else os.path.abspath(n) for n in names) or "blocks"
    output_url = str(output) if is_address(output) else None
    if work is None and output_url and is_elsewhere:
        work = output_url + ".work"
    url = str(work).rstrip("/") if is_address(work) else None
    if url and not is_elsewhere:
        raise Error(f"{url}: a work folder at an address is for a build with an executor")
    for address in (url, output_url):
        if address:
            check_writable(address)
    root = None
    if url or output_url or any(is_address(name) for name in names):
        root = scratch(url or output_url or os.path.abspath(as_path(output)))
    made = root / "asset.umbel" if root and output_url else Path(as_path(output))
    if not made.name:
        raise Error(f"the output {as_path(output)!r} names no file")
    folder = made.with_name(made.name + ".work")
    if root and (url or (output_url and work is None)):
        folder = root / "work"
    elif work is not None:
        folder = Path(as_path(work))
    return _Place(names, named, made, output_url, folder, url, root)


def _command(threads: int) -> list[str]:
    """The program of a worker. Without one, units are built in this process."""
    if not sys.executable:
        return []
    code = "from umbel.scale.worker import main; sys.exit(main(sys.argv[1:]))"
    return python_command(code, str(threads))


def _stored(images: Sequence[bytes], folder: Path) -> list[Path]:
    """A file of each image."""
    paths = [folder / f"image{number}" for number in range(len(images))]
    for path, data in zip(paths, images, strict=True):
        write_file(path, data)
    return paths


def _sorting_bytes(source: Source) -> int:
    """What sorting a stretch of the source takes."""
    return (60 << 20) + 120 * min(int(source.triangles.triangles), 2 << 20)


def _warn_of_rounding(source: Source, finished: dict[str, Any], named: str) -> None:
    """As a build in memory does; what an edge is mostly like, some triangles tell."""
    report = finished["report"]
    lost = source.rounding + Rounding(report["largest_move"], finished["collapsed_triangles"])
    if lost.largest_move == 0:
        return
    some = source.triangles.read(0, min(source.triangles.triangles, 10_000))
    sample = Mesh(some["positions"], some["triangles"], source=named)
    sample.rounding = lost
    warn_of_rounding(sample)


def _name(files: Sequence[str]) -> str:
    """As a mesh of one file has it."""
    if len(files) != 1:
        return ""
    path = PurePath(files[0])
    return PurePath(path.stem).stem if path.suffix.lower() == ".gz" else path.stem


def _described(source: Source) -> dict[str, Any]:
    return {"file": source.files[0].name} if len(source.files) == 1 else {}


def _is_same_input(source: Source, path: Path, is_resumed: bool) -> bool:
    """Whether the files are those that the build was begun with, by their sizes and times, and
    their materials have the same numbers: files share those that are equal, so what is in a library
    or a texture decides. Where they may not be, their triangles are compared."""
    stamp: list[Any] = [len(source.materials), source.material_numbers]
    for file in source.files:
        status = file.stat()
        stamp.append([status.st_size, status.st_mtime_ns])
    # What a .gltf refers to may have changed without it.
    has_all = source.files and not any(f.suffix.lower() == ".gltf" for f in source.files)
    if is_resumed and has_all and path.exists():
        try:
            return bool(json.loads(path.read_text()) == stamp)
        except (OSError, ValueError):
            return False
    if not is_resumed:
        write_file(path, json.dumps(stamp).encode())
    return False


def _remove_leftovers(output: Path) -> None:
    """Half-written files of this output, of processes that are gone."""
    target = Path(os.path.realpath(output))
    begin = "." + os.fsdecode(os.fsencode(target.name)[:200])
    for path in target.parent.iterdir():
        name, *parts = path.name.rsplit(".", 3)
        own = name == begin and len(parts) == 3 and parts[2] == "tmp"
        if own and parts[0].isdigit() and not _is_alive(int(parts[0])):
            path.unlink(missing_ok=True)


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        pass
    return True
