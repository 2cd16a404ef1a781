"""Which files `umbel build` builds, and where each asset goes."""

from __future__ import annotations

import glob
import itertools
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from umbel.cli.run import fail
from umbel.io.addresses import is_address, name_of
from umbel.io.patterns import matches

SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl")


@dataclass(frozen=True)
class Job:
    """An input, and the asset that it becomes."""

    source: str
    output: Path


def is_many(inputs: Sequence[str], output: str) -> bool:
    """Whether the output is a folder: there are several inputs, a folder of them or a pattern, or
    it is one already."""
    ends_as_folder = output.endswith(("/", os.sep))
    return len(inputs) > 1 or _is_group(inputs[0]) or ends_as_folder or os.path.isdir(output)


def plan(inputs: Sequence[str], folder: Path, may_miss: bool = False) -> list[Job]:
    """The jobs, in the order of the inputs. The assets lie in the folder as their meshes do below
    the innermost folder that holds all of them. `may_miss`: a file that is not there is a job,
    too; building it says so."""
    if folder.suffix.lower() == ".umbel" and not folder.is_dir():
        if len(inputs) == 1 and not _is_group(inputs[0]):
            fail(
                f"{folder}{os.sep}: ends as a folder does; without its last character it is a file"
            )
        fail(
            f"{folder}: with several inputs the output is a folder; with --memory or "
            "--unit-triangles they become one asset"
        )
    found = [(text, *_matches(text, may_miss)) for text in inputs]
    bases = [base for _, base, _ in found if base is not None]
    root = os.path.commonpath(bases) if bases else ""
    jobs: dict[str, Job] = {}
    by_output: dict[Path, str] = {}
    for _, _, sources in found:
        for source in sources:
            key = source if is_address(source) else os.path.abspath(source)
            if key in jobs:
                continue
            output = folder / _relative(source, root)
            if output in by_output:
                fail(
                    f"{by_output[output]} and {source} would both become {output}; rename one, or "
                    "build them into different folders",
                    source=source,
                )
            by_output[output] = source
            jobs[key] = Job(source, output)
    return list(jobs.values())


def files_of(inputs: Sequence[str]) -> list[str]:
    """The files that become one mesh, each once: those of folders and patterns by name."""
    found: dict[str, str] = {}
    for text in inputs:
        for source in _matches(text, may_miss=True)[1]:
            found.setdefault(source if is_address(source) else os.path.abspath(source), source)
    return list(found.values())


def _is_group(text: str) -> bool:
    return not is_address(text) and (os.path.isdir(text) or _is_pattern(text))


def _is_pattern(text: str) -> bool:
    return glob.has_magic(text) and not os.path.exists(text)


def _matches(text: str, may_miss: bool) -> tuple[str | None, list[str]]:
    """The folder below which an input's files lie, and the files."""
    if is_address(text):
        return None, [text]
    if os.path.isdir(text):
        base, below = text, os.path.join(glob.escape(text), "**", "*")
    elif _is_pattern(text):
        base, below = _fixed_part(text), text
    elif os.path.exists(text) or may_miss:
        return os.path.abspath(os.path.dirname(text)), [text]
    else:
        fail(f"cannot read {text}: no such file", source=text)
    files = [name for name in matches(below) if _is_mesh(name)]
    if not files:
        fail(f"{text}: no file of this pattern is a mesh ({', '.join(SUFFIXES)})", source=text)
    return os.path.abspath(base), files


def _fixed_part(pattern: str) -> str:
    """The folders of a pattern before the first that is itself a pattern."""
    fixed = itertools.takewhile(lambda part: not glob.has_magic(part), Path(pattern).parts)
    return os.path.join(os.curdir, *fixed)


def _is_mesh(name: str) -> bool:
    """A link to what is not there counts: reading it says so."""
    is_file = os.path.isfile(name) or (os.path.islink(name) and not os.path.exists(name))
    return is_file and _plain_name(name).lower().endswith(SUFFIXES)


def _plain_name(name: str) -> str:
    return name[:-3] if name.lower().endswith(".gz") else name


def _relative(source: str, root: str) -> str:
    name = name_of(source) if is_address(source) else os.path.relpath(source, root)
    return os.path.splitext(_plain_name(name))[0] + ".umbel"
