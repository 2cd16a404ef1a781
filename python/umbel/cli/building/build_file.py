"""One file built: what `umbel build` does with each of its inputs. What builds is imported only
when there is something to build, so that a run over files that are up to date is quick."""

from __future__ import annotations

import hashlib
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from umbel.cli.failure import Failure
from umbel.cli.outputs import check_space
from umbel.cli.run import FAULT, fail
from umbel.io.addresses import fetched, is_address, load_fetched, name_of
from umbel.io.references import source_digest
from umbel.lod.metadata import stored

if TYPE_CHECKING:
    from umbel.io.scene import Scene
    from umbel.lod.scene_lod import SceneLod
    from umbel.scale.executor import Executor

Progress = Callable[[float, str], "bool | None"]

_LEAST_BYTES = 2
"""Of an asset, for each triangle: no mesh takes less."""


#: Flags of the penalties of clusters and groups.
COST_FLAGS = {
    "underfill_cost": "--underfill",
    "vertex_underfill_cost": "--vertex-underfill",
    "overlap_cost": "--overlap",
    "group_underfill_cost": "--group-underfill",
    "group_overlap_cost": "--group-overlap",
}

#: Flags that say how an asset is saved.
_SAVED = ("normal_bits", "tangent_bits", "color_bits", "uv_bits")

_ONLY_IN_MEMORY = ("precision", "drop_invalid", "measured_error", "lock_borders")


@dataclass(frozen=True)
class Options:
    """The flags of a build that decide what the asset is."""

    max_triangles: int = 128
    max_vertices: int = 128
    group_size: tuple[int, int] = (24, 32)
    attributes: str = "auto"
    seams: str = "allow"
    creases: str = "allow"
    instances: str = "auto"
    mix_materials: bool = False
    precision: str | None = None
    normal_bits: int | None = None
    tangent_bits: int | None = None
    color_bits: int | None = None
    uv_bits: int | None = None
    min_triangles: int = 0
    underfill_cost: float = 0.3
    vertex_underfill_cost: float = 0.5
    overlap_cost: float = 0.0
    group_underfill_cost: float = 0.5
    group_overlap_cost: float = 0.0
    lock_borders: bool = False
    drop_invalid: bool = False
    measured_error: bool = False
    allow_outside: bool = False
    force: bool = False
    #: Given or decided by what fits into memory; None: not in units.
    unit_triangles: int | None = None

    def check(self) -> None:
        """Refuses, before any file is read, what would fail with every one."""
        from umbel.geometry.repair import parse_precision
        from umbel.lod.attribute_precision import check_attribute_bits

        if not 4 <= self.max_triangles <= 256:
            fail(f"--max-triangles must be from 4 to 256, not {self.max_triangles}")
        if not 6 <= self.max_vertices <= 256:
            fail(f"--max-vertices must be from 6 to 256, not {self.max_vertices}")
        low, high = self.group_size
        if not 2 <= low <= high <= 1024:
            fail(f"--group-size must be MIN:MAX with 2 <= MIN <= MAX <= 1024, not {low}:{high}")
        if self.precision is not None:
            parse_precision(self.precision)
        check_attribute_bits(self.attribute_bits())
        if not 0 <= self.min_triangles <= self.max_triangles:
            fail(
                f"--min-triangles must be from 0 to {self.max_triangles}, not {self.min_triangles}"
            )
        for name, flag in COST_FLAGS.items():
            if not 0 <= getattr(self, name) <= 1:
                fail(f"{flag} must be from 0 to 1, not {getattr(self, name)}")

    def attribute_bits(self) -> dict[str, int]:
        """As `Lod.save` takes them."""
        names = ("normal", "tangent", "color", "uv")
        given = {name: getattr(self, f"{name}_bits") for name in names}
        return {name: bits for name, bits in given.items() if bits is not None}

    def plain(self) -> dict[str, Any]:
        """As an asset's metadata store it."""
        said = {**asdict(self), "group_size": list(self.group_size)}
        if self.unit_triangles is None:
            del said["unit_triangles"]
        return said

    def settings(self) -> dict[str, Any]:
        """Those for `build_lod`."""
        other = ("instances", "allow_outside", "unit_triangles", *_SAVED)
        return {k: v for k, v in asdict(self).items() if k not in other}

    def not_in_units(self) -> str | None:
        """A flag that only a build in memory knows; None where units have all that is asked for."""
        usual = Options()
        for name in _ONLY_IN_MEMORY:
            if getattr(self, name) != getattr(usual, name):
                return f"--{name.replace('_', '-')}"
        return "--instances on" if self.instances == "on" else None

    @staticmethod
    def of(plain: dict[str, Any]) -> Options:
        """From what `plain` gives."""
        return Options(**{**plain, "group_size": tuple(plain["group_size"])})


@dataclass(frozen=True)
class Limits:
    """The flags of a build that say what it may take, and do not change the asset."""

    memory: str | None = None
    work: str | None = None
    resume: bool = False


def in_units(sources: Sequence[str], output: Path, options: Options, limits: Limits) -> bool:
    """Whether files are built unit by unit: it is asked for, was begun that way, or they would not
    fit into memory. Several are one mesh."""
    from umbel.scale.memory import as_bytes

    if limits.memory is not None:
        as_bytes(limits.memory)
    source = sources[0]
    wanted = options.unit_triangles is not None or len(sources) > 1
    begun = limits.resume and _work_of(output, limits).is_dir()
    large = wanted or begun or (not is_address(source) and _is_too_large(source, limits))
    if not large:
        return False
    flag = options.not_in_units()
    if flag is None and not is_address(source):
        return True
    if flag is None:
        fail(f"{source}: units are built of files, not of addresses; fetch it first")
    if len(sources) > 1:
        fail(f"several files as one mesh are built unit by unit, where {flag} is not possible")
    if wanted:
        fail(f"{source}: --unit-triangles builds unit by unit, where {flag} is not possible")
    if begun:
        fail(f"{source}: this build was begun unit by unit, where {flag} is not possible")
    if limits.memory is not None:
        fail(f"{source} does not fit into that memory, and {flag} is not possible unit by unit")
    return False


def _is_too_large(source: str, limits: Limits) -> bool:
    try:
        # Most are small, and need nothing imported.
        has_all = not source.lower().endswith(".gltf")
        if has_all and Path(source).stat().st_size < 1 << 20:
            return False
    except OSError:
        return False
    from umbel.scale.memory import is_too_large

    return is_too_large(source, limits.memory)


def _work_of(output: Path, limits: Limits) -> Path:
    return Path(limits.work) if limits.work else output.with_name(output.name + ".work")


def build_units(
    sources: Sequence[str],
    output: str,
    options: Options,
    limits: Limits,
    *,
    executor: Executor | None = None,
    skip_unchanged: bool = False,
    progress: Progress | None = None,
    threads: int = 0,
) -> dict[str, Any]:
    """As `build_file`, of one file or of several as one mesh, unit by unit; on other machines where
    there is an executor. Output and sources may then be addresses, and sources patterns."""
    from umbel.cli.measure import sha256_of
    from umbel.cli.run import say
    from umbel.scale.build_asset import build_asset
    from umbel.scale.memory import peak_rss_bytes
    from umbel.scale.storage import as_path, expand

    files = list(dict.fromkeys(expand(sources)))  # patterns may name one twice
    named = sources[0] if len(sources) == 1 else list(sources)
    if skip_unchanged and not any(is_address(file) for file in (*files, output)):
        origin = _origin(files, [Path(file) for file in files], options)
        if _is_current(Path(as_path(output)), origin):
            return {"input": named, "output": output, "status": "unchanged"}
    work = None if is_address(output) else _work_of(Path(as_path(output)), limits)
    try:
        with _nothing_is_dropped():
            built = build_asset(
                files,
                output,
                memory=limits.memory,
                work=limits.work if executor else work,
                resume=limits.resume,
                executor=executor,
                metadata=lambda here: {"source": _origin(files, here, options)},
                progress=progress,
                threads=threads,
                **_for_units(options),
            )
    except BaseException:
        if work is not None and (work / "manifest.json").exists():
            say(f"what is done stays in {work}; the same command with --resume goes on with it")
        raise
    workers = built["workers"] * built.pop("worker_peak_rss_bytes")
    return {
        "input": named,
        "output": output,
        **_described(built, options),
        "peak_rss_bytes": peak_rss_bytes() + workers,
        "sha256": built.get("sha256") or sha256_of(Path(as_path(output))),
    }


def _origin(files: Sequence[str], here: Sequence[Path], options: Options) -> dict[str, Any]:
    """What an asset says of what it was built of. `here`: the files, or their copies."""
    names = [file.rsplit("/", 1)[-1] if is_address(file) else Path(file).name for file in files]
    digests = [_digest(path, options.allow_outside) for path in here]
    digest = digests[0]
    if len(files) > 1:
        known = [one for one in digests if one is not None]
        lines = "\n".join(known).encode()
        digest = hashlib.sha256(lines).hexdigest() if len(known) == len(files) else None
    return {
        **({"file": names[0]} if len(files) == 1 else {"files": names}),
        "sha256": digest,
        "options": options.plain(),
    }


@contextmanager
def _nothing_is_dropped() -> Iterator[None]:
    """A build in units has no flag that leaves invalid triangles out, so none is suggested."""
    from umbel.errors import Error

    try:
        yield
    except Error as error:
        if error.code != "invalid_mesh":
            raise
        raise Failure(str(error), FAULT) from error


def _for_units(options: Options) -> dict[str, Any]:
    usual = Options()
    chosen = {key: getattr(options, key) for key in _IN_UNITS}
    # Said in the asset only where they are asked for.
    for key in ("min_triangles", *COST_FLAGS):
        if getattr(options, key) != getattr(usual, key):
            chosen[key] = getattr(options, key)
    bits = options.attribute_bits()
    chosen |= {"force": options.force, "allow_outside": options.allow_outside}
    return {**chosen, "attribute_bits": bits, "unit_triangles": options.unit_triangles or 0}


def _described(built: dict[str, Any], options: Options) -> dict[str, Any]:
    """What is said of a build in units."""
    triangles = built["input_triangles"]
    all_levels = built["triangles_all_levels"]
    return {
        "status": "built",
        "stored_triangles": triangles,
        **built,
        "mean_fill": all_levels / max(1, built["clusters"] * (options.max_triangles or 256)),
        "max_cluster_vertices": None,
        "dropped_triangles": 0,
        "meshes": 1,
        "instances": 1,
        "bytes_per_input_triangle": built["file_bytes"] / triangles if triangles else 0.0,
        "triangles_per_second": _rate(built, built["seconds"]),
    }


#: Flags that decide what the asset is, of those that units have.
_IN_UNITS = (
    "max_triangles",
    "max_vertices",
    "group_size",
    "attributes",
    "mix_materials",
    "seams",
    "creases",
)


def build_file(
    source: str,
    output: Path,
    options: Options,
    *,
    skip_unchanged: bool = False,
    progress: Progress | None = None,
    threads: int = 0,
) -> dict[str, Any]:
    """Reads a file, builds its levels of detail and writes the asset, unless that is up to date.
    Returns what the command prints with --json."""
    if is_address(source) and options.allow_outside:
        fail(f"{source}: --allow-outside is for files; an address's folder is never left")
    began = time.perf_counter()
    with _on_this_machine(source) as path:
        origin = {
            "file": name_of(source) if is_address(source) else path.name,
            "sha256": _digest(path, options.allow_outside),
            "options": options.plain(),
        }
        if skip_unchanged and _is_current(output, origin):
            return {"input": source, "output": str(output), "status": "unchanged"}
        scene = _loaded(path, source, options.allow_outside)

    from umbel.lod.arrange import arrange
    from umbel.lod.build_scene import build_arranged

    scene = arrange(scene, options.instances)
    read_seconds = time.perf_counter() - began
    check_space(output, _LEAST_BYTES * sum(len(mesh.triangles) for mesh in scene.meshes))
    began = time.perf_counter()
    lod = build_arranged(scene, **options.settings(), progress=progress, threads=threads)
    seconds = time.perf_counter() - began
    lod.source.update(origin)
    if options.drop_invalid and lod.report["dropped_triangles"]:
        left_out = lod.report["dropped_triangles"]
        warnings.warn(f"{source}: {left_out:,} invalid triangles left out", stacklevel=2)
    began = time.perf_counter()
    file_bytes = lod.save(
        output, attribute_bits=options.attribute_bits(), progress=progress, threads=threads
    )
    return {
        "input": source,
        "output": str(output),
        "status": "built",
        **_measured(lod, output, file_bytes, options.max_triangles),
        "seconds": seconds,
        "read_seconds": read_seconds,
        "write_seconds": time.perf_counter() - began,
        "triangles_per_second": _rate(lod.report, seconds),
    }


@contextmanager
def _on_this_machine(source: str) -> Iterator[Path]:
    if not is_address(source):
        yield Path(source)
        return
    with fetched(source) as path:
        yield path


def _digest(path: Path, allow_outside: bool) -> str | None:
    """None for a pipe, which can be read only once, and for what cannot be read: reading it as a
    mesh says why."""
    try:
        if not path.is_file():
            return None
        return source_digest(path, allow_outside)
    except (OSError, ValueError):
        return None


def _loaded(path: Path, source: str, allow_outside: bool) -> Scene:
    from umbel.io import load_scene

    if is_address(source):
        return load_fetched(path, source)
    return load_scene(path, allow_outside=allow_outside)


def _is_current(output: Path, origin: dict[str, Any]) -> bool:
    """Whether the asset is whole, and of the same file, by the same flags and version."""
    found = stored(output)
    if found is None or origin["sha256"] is None:
        return False
    from umbel import __version__
    from umbel.plain_json import plain

    source = found.get("source", {})
    same = all(source.get(key) == value for key, value in plain(origin).items())
    return same and found.get("generator") == f"umbel {__version__}" and is_whole(output)


def is_whole(asset: Path) -> bool:
    """Whether every checksum of an asset holds."""
    from umbel import _umbel
    from umbel.errors import Error

    try:
        return _umbel.Asset(asset).is_whole()
    except Error:
        return False


def _rate(report: dict[str, Any], seconds: float) -> float:
    count = report.get("stored_triangles", report["input_triangles"])
    return float(count / seconds) if seconds > 0 else 0.0


def _measured(lod: SceneLod, output: Path, file_bytes: int, max_triangles: int) -> dict[str, Any]:
    from umbel.cli.measure import sha256_of, table_counts
    from umbel.scale.memory import peak_rss_bytes

    report = {key: value for key, value in lod.report.items() if key != "seconds"}
    triangles = report["input_triangles"]
    return {
        "stored_triangles": triangles,
        **report,
        **table_counts([one.tables for one in lod.lods], max_triangles),
        "meshes": len(lod.lods),
        "instances": max(len(lod.instances), 1),
        "file_bytes": file_bytes,
        "bytes_per_input_triangle": file_bytes / triangles if triangles else 0.0,
        "peak_rss_bytes": peak_rss_bytes(),
        "sha256": sha256_of(output),
    }
