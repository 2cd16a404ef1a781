"""A process that builds files for `umbel build`, one after the other. It reads jobs as lines of
JSON and answers each with one; what else is printed goes to standard error."""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path
from typing import IO, Any

from umbel.cli import Stopped, _stop
from umbel.cli.building.build_file import Limits, Options, build_file, build_units, in_units
from umbel.cli.failure import one_line
from umbel.cli.run import hear, heard, listen, sentence_of


def main() -> None:
    """Works until there are no more jobs."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that gives the jobs ends this one
    signal.signal(signal.SIGTERM, _stop)
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    listen(_keep_warning)
    try:
        _work(sys.stdin, answers)
    except (Stopped, BrokenPipeError):
        os._exit(0)  # files that were begun are gone already


def _work(jobs: IO[str], answers: IO[str]) -> None:
    for line in jobs:
        heard.clear()
        answers.write(json.dumps(_answer(json.loads(line))) + "\n")
        answers.flush()


def _answer(job: dict[str, Any]) -> dict[str, Any]:
    from umbel.plain_json import plain

    source, output = job["input"], job["output"]
    options, limits = Options.of(job["options"]), Limits(resume=True)
    common: dict[str, Any] = {
        "skip_unchanged": job["skip_unchanged"],
        "progress": lambda fraction, stage: None,  # where a signal gets through
        "threads": job["threads"],
    }
    try:
        if in_units([source], Path(output), options, limits):
            done = build_units([source], output, options, limits, **common)
        else:
            done = build_file(source, Path(output), options, **common)
    except Exception as error:
        done = {"input": source, "output": output, "status": "failed"}
        done["error"] = one_line(sentence_of(error, job["flags"], source, [source, output]))
    answer: dict[str, Any] = plain({**done, "warnings": list(heard)})
    return answer


def _keep_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    hear(message)
