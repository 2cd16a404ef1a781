"""`umbel build` of many files: in processes side by side, with a line for each and a summary."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import typer

from umbel.cli.building.build_file import Options
from umbel.cli.building.jobs import Job, plan
from umbel.cli.building.pool import work_off
from umbel.cli.outputs import made_folder
from umbel.cli.progress import Bar
from umbel.cli.run import FAULT, say
from umbel.cli.summary import counted, megabytes, print_rows

_LISTED = 20  # failures that the summary names, and warnings that are said


def build_many(
    inputs: Sequence[str],
    output: str,
    options: Options,
    *,
    jobs: int,
    skip_unchanged: bool,
    keep_going: bool,
    as_json: bool,
    threads: int,
    flags: Mapping[str, str],
) -> None:
    """Builds the inputs below a folder. Ends with status 1 if any could not be built."""
    began = time.perf_counter()
    planned = plan(inputs, Path(output), may_miss=keep_going)
    made_folder(Path(output))
    cores = os.cpu_count() or 1
    common = {
        "options": options.plain(),
        "skip_unchanged": skip_unchanged,
        "threads": threads or max(1, cores // min(jobs, len(planned))),
        "flags": dict(flags),
    }
    done = _Done(len(planned))
    with Bar() as bar:
        for job, answer in work_off(_asked(planned, common), min(jobs, len(planned))):
            answer = {"input": job["input"], "output": job["output"], **_own(answer)}
            done.add(answer)
            _report(answer, as_json, bar)
            done.warn(answer, bar)
            bar(done.count / done.total, f"{done.count:,} of {done.total:,} files")
            if answer["status"] == "failed" and not keep_going:
                break
    done.show(output, time.perf_counter() - began, as_json)
    if done.failed:
        raise typer.Exit(FAULT)


def _asked(planned: Sequence[Job], common: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The jobs as workers take them. Folders are made when their first file's turn comes."""
    made: set[Path] = set()
    for job in planned:
        folder = job.output.parent
        if folder not in made:
            made_folder(folder)
            made.add(folder)
        yield {"input": job.source, "output": str(job.output), **common}


def _own(answer: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in answer.items() if key not in ("input", "output")}


def _report(answer: dict[str, Any], as_json: bool, bar: Bar) -> None:
    """A file's line: its object with --json, else only what is wrong with it."""
    if as_json:
        from umbel.plain_json import plain

        print(json.dumps(plain(answer), allow_nan=False), flush=True)
    if answer["status"] == "failed":
        bar.say(answer["error"])


class _Done:
    """What has become of the files so far."""

    def __init__(self, total: int) -> None:
        self.total, self.count = total, 0
        self.built = self.unchanged = self.triangles = self.bytes = 0
        self.warnings = 0
        self.failed: list[str] = []

    def add(self, answer: dict[str, Any]) -> None:
        self.count += 1
        if answer["status"] == "failed":
            self.failed.append(answer["input"])
        elif answer["status"] == "unchanged":
            self.unchanged += 1
        else:
            self.built += 1
            self.triangles += answer["stored_triangles"]
            self.bytes += answer["file_bytes"]

    def warn(self, answer: dict[str, Any], bar: Bar) -> None:
        """Says the warnings of a file, unless there have been many."""
        for warning in answer.get("warnings", ()):
            self.warnings += 1
            if self.warnings <= _LISTED:
                named = warning if answer["input"] in warning else f"{answer['input']}: {warning}"
                bar.say(f"warning: {named}")

    def show(self, output: str, seconds: float, as_json: bool) -> None:
        """The summary: on standard output, or with --json on standard error."""
        size = f"{counted(self.triangles, 'triangle')}, {megabytes(self.bytes)}"
        left = self.total - self.count
        rows = {"built": f"{counted(self.built, 'file')}, {size}"}
        if self.unchanged:
            rows["unchanged"] = counted(self.unchanged, "file")
        if self.failed:
            rows["failed"] = f"{counted(len(self.failed), 'file')}: {self._names()}"
        if self.warnings > _LISTED:
            rows["warnings"] = f"{self.warnings:,}; the first {_LISTED} are above, --json has all"
        if left:
            rows["not finished"] = counted(left, "file")
        rows["in"] = f"{seconds:.1f} s"
        if as_json:
            text = ", ".join(f"{name} {value}" for name, value in rows.items())
            say(f"{output}: {text}")
        else:
            sys.stderr.flush()
            print_rows(output, rows)

    def _names(self) -> str:
        names = ", ".join(self.failed[:_LISTED])
        more = len(self.failed) - _LISTED
        return names + (f", and {more:,} more" if more > 0 else "")
