"""`umbel verify`: proves an asset."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from .run import CHECK_FAILED, Json, Threads, ends_cleanly, say, show


@ends_cleanly
def command(
    path: Annotated[Path, typer.Argument(metavar="FILE", help="Asset (.umbel).")],
    cuts: Annotated[
        int, typer.Option(min=0, max=1_000_000, metavar="N", help="Random cuts to look at.")
    ] = 64,
    seed: Annotated[
        int, typer.Option(min=0, max=0xFFFFFFFF, metavar="N", help="Which random cuts.")
    ] = 1,
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Prove an asset: checksums, limits, monotone errors, and cuts without hole or overlap.

    Half of the cuts are by error, half by camera, from inside and outside. Exit status 3 says
    that something did not hold."""
    from ..proof import verify
    from .progress import Bar

    began = time.perf_counter()
    with Bar() as bar:
        report = verify(path, cuts, seed=seed, progress=bar, threads=threads)
    result = report.to_dict() | {"seconds": time.perf_counter() - began}
    show(result, as_json, str(path))
    if not report.ok:
        say(report.problems[0] if report.problems else f"{path}: a check did not hold")
        raise typer.Exit(CHECK_FAILED)
