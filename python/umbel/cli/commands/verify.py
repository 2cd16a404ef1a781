"""`umbel verify`: checks an asset."""

from __future__ import annotations

import time
from typing import Annotated, Any

import typer

from umbel.cli.failure import naming_file, one_line
from umbel.cli.inputs import bytes_of
from umbel.cli.options import option
from umbel.cli.run import CHECK_FAILED, Json, Threads, ends_cleanly, heard, say, show


@ends_cleanly()
def command(
    path: Annotated[str, typer.Argument(metavar="FILE", help="Asset (.umbel).")],
    cuts: int = option(64, "N", "Random cuts to look at.", min=0, max=1_000_000),
    seed: int = option(1, "N", "Which random cuts.", min=0, max=0xFFFFFFFF),
    memory: str | None = option(
        None,
        "SIZE",
        "Read pages in order, several times, in about so much memory, as in 1GB; of each "
        "random cut, look at one window.",
    ),
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Prove an asset: checksums, limits, monotone errors, and cuts without hole or overlap.

    Half of the cuts are by error, half by camera, from inside and outside. Exit status 3 says
    that something did not hold."""
    from umbel.cli.progress import Bar
    from umbel.io.addresses import is_address
    from umbel.lod.asset import Asset
    from umbel.lod.verify import verify

    began = time.perf_counter()
    with Bar() as bar:
        how: dict[str, Any] = {"seed": seed, "progress": bar, "threads": threads}
        if memory is not None:
            how["memory"] = bytes_of("--memory", memory)
        report = Asset(path).verify(cuts, **how) if is_address(path) else verify(path, cuts, **how)
    result = {"input": path, **report.to_dict(), "seconds": time.perf_counter() - began}
    problem = one_line(report.problems[0] if report.problems else "a check did not hold")
    problem = naming_file(problem, path, [path])
    if not report.ok and as_json:
        result["error"] = problem
    show({**result, "warnings": heard}, as_json, path)
    if not report.ok:
        say(problem)
        raise typer.Exit(CHECK_FAILED)
