"""From mesh files to an asset, unit by unit: any mesh in a memory that the caller sets."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import umbel
from umbel import _umbel
from umbel.errors import Error
from umbel.geometry.arrays import thread_count
from umbel.geometry.repair import Progress
from umbel.io.blocks import Paths, Source, open_source
from umbel.lod.build import _group_limits, _native_config
from umbel.lod.materials import write_materials
from umbel.plain_json import encode
from umbel.scale.memory import as_bytes, free_bytes

#: Of an input file, what a build in memory takes a byte, at least.
_IN_MEMORY = 8


def is_too_large(source: str | os.PathLike[str], memory: float | str | None = None) -> bool:
    """Whether a build of a file in memory would take more than `memory`, by default three quarters
    of what is free: a guess, from the file's size."""
    try:
        size = Path(source).stat().st_size
    except OSError:
        return False
    # Most files are small, whatever is free.
    return size * _IN_MEMORY > (64 << 20) and size * _IN_MEMORY > _limit(memory)


def _limit(memory: float | str | None) -> int:
    return free_bytes() * 3 // 4 if memory is None else as_bytes(memory)


def build_asset(
    source: Paths | Iterable[Any],
    output: str | os.PathLike[str],
    *,
    memory: float | str | None = None,
    work: str | os.PathLike[str] | None = None,
    resume: bool = False,
    unit_triangles: int = 0,
    workers: int = 0,
    max_triangles: int = 128,
    max_vertices: int = 128,
    group_size: tuple[int, int] = (24, 32),
    attributes: str = "auto",
    mix_materials: bool = False,
    seams: str = "allow",
    creases: str = "allow",
    textures: str = "embed",
    metadata: dict[str, Any] | None = None,
    progress: Progress | None = None,
    threads: int = 0,
) -> dict[str, Any]:
    """Builds an asset of a mesh of any size, in parts of space that fit into memory: units.

    The bytes depend on the source and the settings alone, not on the memory, the number of workers
    and threads, or how often the build was stopped. A mesh that fits into one unit gives what
    `build_lod` gives. Returns a report.

    source: a mesh file, several as one mesh, or an iterable of blocks: see
        `umbel.io.blocks.open_source`.
    memory: bytes, or a text such as "2GB"; None: three quarters of what is free.
    work: a folder for what is built before it is whole, some 60 bytes a triangle; by default beside
        the output, OUTPUT.work. It is removed at the end, and stays where the build is stopped.
    resume: go on with what an earlier call with the same arguments left in that folder.
    unit_triangles: most triangles of a unit, by default 4 Mi. Smaller units need less memory, and
        leave slightly coarser levels. This changes the result.
    workers: processes that build units side by side; 0: as many as memory and cores allow.
    metadata: added to what the asset says of itself.
    progress: called with (fraction, stage); returning False cancels (umbel.Cancelled).
    The rest is as `build_lod` and `Lod.save` have it.
    """
    began = time.perf_counter()
    if attributes not in ("auto", "none"):
        raise Error(f"attributes must be 'auto' or 'none', not {attributes!r}")
    if unit_triangles < 0 or 0 < unit_triangles < 1000:
        raise Error(f"unit_triangles must be at least 1000, not {unit_triangles}")
    config: dict[str, Any] = {
        "max_triangles": max_triangles,
        "max_vertices": max_vertices,
        **_group_limits(group_size),
        "attributes": attributes == "auto",
        "mix_materials": mix_materials,
        "seams": seams,
        "creases": creases,
    }
    native = _native_config(config)
    output = Path(os.fspath(output))
    folder_path = (
        Path(os.fspath(work)) if work is not None else output.with_name(output.name + ".work")
    )
    identity = [("format", "1"), ("library", _library()), ("input", _names(source))]
    limit = _limit(memory)
    folder = _umbel.WorkFolder(folder_path, native, unit_triangles, identity, resume)
    try:
        _remove_leftovers(output)
        opened = open_source(source, folder_path / "source")
        is_same = _is_same_input(opened, folder_path / "source_stamp", folder.is_resumed)
        cores = thread_count(threads) or os.cpu_count() or 1
        plan = _umbel.plan_units(opened.triangles, native, unit_triangles, limit, cores)
        count = min(workers, plan["workers"]) if workers > 0 else plan["workers"]
        materials, files = write_materials(
            opened.materials, textures, output.absolute().parent, thread_count(threads)
        )
        said = {
            "generator": f"umbel {_umbel.version()}",
            "name": "",
            "config": {**config, "unit_triangles": unit_triangles or 4 << 20},
            "source": {"triangles": opened.triangles.triangles, **_described(opened)},
            **(metadata or {}),
        }
        if opened.coordinates:
            said["coordinates"] = opened.coordinates

        def metadata_of(finished: dict[str, Any]) -> str:
            report = {k: v for k, v in finished["report"].items() if k != "seconds"}
            return encode({**said, "report": report})

        finished = _umbel.build_units(
            folder,
            opened.triangles,
            native,
            unit_triangles,
            output,
            metadata_of,
            materials,
            files,
            True,
            0,
            _command(max(1, cores // count)),
            count,
            0,
            is_same,
            progress,
            thread_count(threads),
        )
        del opened
        folder.remove()
    except Error as error:
        # Of an input or an argument at fault nothing is worth keeping: once that is mended, it
        # could not be resumed.
        begun = folder.is_resumed or any(folder_path.glob("t0/unit/*.done"))
        if not begun and error.code not in ("io", "cancelled"):
            folder.remove()
        raise
    finally:
        folder.close()
    report = {**finished.pop("report"), "seconds": time.perf_counter() - began}
    return {
        **report,
        "levels": finished["levels"],
        "groups": finished["groups"],
        "clusters": finished["clusters"],
        "triangles_all_levels": finished["triangles"],
        "file_bytes": finished["bytes"],
        "workers": count,
        "unit_triangles": unit_triangles or 4 << 20,
    }


def _command(threads: int) -> list[str]:
    """The program of a worker. Without one, units are built in this process."""
    if not sys.executable:
        return []
    root = str(Path(umbel.__file__).resolve().parent.parent)
    code = (
        f"import sys; sys.path.insert(0, {root!r}); from umbel.scale.worker import main; "
        "sys.exit(main(sys.argv[1:]))"
    )
    return [sys.executable, "-c", code, str(threads)]


def _library() -> str:
    """Which build of the library this is: arrays in work files are as it has them in memory."""
    status = os.stat(_umbel.__file__)
    return f"{_umbel.version()} {status.st_size} {status.st_mtime_ns}"


def _names(source: Any) -> str:
    if isinstance(source, (str, os.PathLike)):
        source = [source]
    if isinstance(source, (list, tuple)) and all(isinstance(p, (str, os.PathLike)) for p in source):
        return ", ".join(os.path.abspath(os.fspath(path)) for path in source)
    return "blocks"


def _described(source: Source) -> dict[str, Any]:
    return {"file": source.files[0].name} if len(source.files) == 1 else {}


def _is_same_input(source: Source, path: Path, is_resumed: bool) -> bool:
    """Whether the files are those that the build was begun with, by their sizes and times. Where
    they may not be, their triangles are compared."""
    stamp: list[list[int]] = []
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
        path.write_text(json.dumps(stamp))
    return False


def _remove_leftovers(output: Path) -> None:
    """Half-written files of this output, of processes that are gone."""
    for path in output.absolute().parent.iterdir():
        name, *parts = path.name.rsplit(".", 3)
        own = name == f".{output.name}" and len(parts) == 3 and parts[2] == "tmp"
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
