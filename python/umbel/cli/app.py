"""The commands, put together."""

from __future__ import annotations

import typer

from umbel.cli.commands import (
    bench,
    build,
    bvh,
    cluster,
    export,
    extract,
    info,
    kdtree,
    render,
    verify,
    view,
)

app = typer.Typer(
    name="umbel",
    help="Triangle meshes as clusters and continuous levels of detail.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from umbel import __version__

        typer.echo(f"umbel {__version__}")
        raise typer.Exit


@app.callback()
def _umbel(
    version: bool = typer.Option(
        False, "--version", callback=_print_version, is_eager=True, help="Say the version and exit."
    ),
) -> None:
    pass


for _module in (build, info, verify, extract, export, render, cluster, bvh, kdtree, view):
    app.command(_module.__name__.rpartition(".")[2])(_module.command)
app.add_typer(bench.app, name="bench")
