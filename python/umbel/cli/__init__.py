"""The command line: `umbel build`, `info`, `verify`, `extract`, `cluster`.

Exit status: 0 done, 1 the input or an argument is at fault, 2 usage, 3 a check did not hold.
"""

from __future__ import annotations

import typer

from . import build, cluster, extract, info, verify
from .run import handle_signals

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
        from .. import __version__

        typer.echo(f"umbel {__version__}")
        raise typer.Exit


@app.callback()
def _umbel(
    version: bool = typer.Option(
        False, "--version", callback=_print_version, is_eager=True, help="Say the version and exit."
    ),
) -> None:
    pass


for _module in (build, info, verify, extract, cluster):
    app.command(_module.__name__.rpartition(".")[2])(_module.command)


def main() -> None:
    """The entry point of the command `umbel`."""
    handle_signals()
    app(prog_name="umbel")
