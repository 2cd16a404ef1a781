"""What was built, in a few lines for people: the end of `umbel build` and of `make demo`."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from typing import Any


def counted(count: int, noun: str) -> str:
    """A number of things."""
    if count != 1:
        noun = {"mesh": "meshes", "vertex": "vertices"}.get(noun, f"{noun}s")
    return f"{count:,} {noun}"


def megabytes(count: float) -> str:
    """A number of bytes for people."""
    if count < 1e3:
        return counted(int(count), "byte")
    if count < 1e5:
        return f"{count / 1e3:,.1f} kB"
    return f"{count / 1e6:,.1f} MB"


def build_rows(built: Mapping[str, Any]) -> dict[str, str]:
    """The lines about one asset, from the JSON object of `umbel build`."""
    size = _size_of(built["input"])
    rows = {
        "input": counted(built["input_triangles"], "triangle")
        + (f", {counted(built['input_vertices'], 'vertex')}" if built["input_vertices"] else "")
        + (f", {megabytes(size)}" if size is not None else ""),
        "asset": f"{megabytes(built['file_bytes'])}, "
        f"{built['bytes_per_input_triangle']:.1f} bytes a triangle",
        "levels": f"{built['levels']:,}",
        "groups": f"{built['groups']:,}",
        "clusters": f"{built['clusters']:,}, {built['mean_fill']:.1%} full",
        "coarsest": f"{counted(built['root_triangles'], 'triangle')} in "
        + counted(built["root_groups"], "group"),
    }
    if built["instances"] > 1:
        rows["scene"] = f"{counted(built['meshes'], 'mesh')} in {built['instances']:,} instances"
    if built.get("grid_step"):
        rows["positions"] = (
            f"on a grid of {built['grid_step']:.3g}, moved by up to {built['largest_move']:.3g}"
        )
    if built["degenerate_triangles"]:
        rows["without area"] = counted(built["degenerate_triangles"], "triangle") + " of the input"
    if built["dropped_triangles"]:
        rows["left out"] = counted(built["dropped_triangles"], "invalid triangle")
    return rows | {
        "built in": f"{built['seconds']:.2f} s, {built['triangles_per_second'] / 1e6:.2f} million "
        "triangles/s",
        "peak memory": megabytes(built["peak_rss_bytes"]),
    }


def print_rows(title: str, rows: Mapping[str, str]) -> None:
    """The lines on standard output: a table on a terminal, plain ones elsewhere."""
    from umbel.plain_json import plain

    if not sys.stdout.isatty():
        print(plain(title))
        width = max(len(name) for name in rows)
        for name, value in rows.items():
            print(f"  {name:{width}}  {value}")
        return
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=escape(plain(title)), show_header=False, box=SIMPLE, title_justify="left")
    table.add_column(style="bold", no_wrap=True)
    table.add_column(justify="right", overflow="fold")
    for name, value in rows.items():
        table.add_row(escape(name), escape(value))
    Console().print(table)


def _size_of(paths: str | Sequence[str]) -> int | None:
    """Of one input or all; None where some are not files, such as patterns, addresses and pipes."""
    named = [paths] if isinstance(paths, str) else paths
    try:
        return sum(map(os.path.getsize, named)) if all(map(os.path.isfile, named)) else None
    except (OSError, ValueError):
        return None
