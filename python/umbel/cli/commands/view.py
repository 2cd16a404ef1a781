"""`umbel view`: the web viewer."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from umbel.cli import Stopped
from umbel.cli.options import option, switch
from umbel.cli.outputs import check_folder
from umbel.cli.run import Json, Threads, ends_cleanly, fail, heard, say, show, warn_no_effect


@ends_cleanly()
def command(
    path: Annotated[str, typer.Argument(metavar="FILE", help="Asset (.umbel).")],
    port: int = option(0, "N", "Port to serve on; 0: any free one.", min=0, max=65535),
    no_browser: bool = switch("--no-browser", "Serve only; do not open the browser."),
    export: Path | None = option(
        None, "DIR", "Write a folder for a static host instead of serving."
    ),
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Show an asset in the browser, until Ctrl-C; or write the page and it to a folder.

    The page and the asset are served to this machine only."""
    from umbel.viewer.view import export_viewer, serving_command, view

    if "://" in path:
        fail(f"{path}: the viewer shows files on this machine; download the asset first")
    if export is not None:
        for flag, is_given in (("--port", port != 0), ("--no-browser", no_browser)):
            if is_given:
                warn_no_effect(flag, "with --export nothing is served")
        check_folder(export.absolute().parent, f"{export}: ")
        index = export_viewer(path, export)
        result: dict[str, Any] = {"input": path, "output": str(export), "folder": str(export)}
        result |= {"index": str(index), "serve": serving_command(export)}
        show({**result, "warnings": heard}, as_json, path)
        return
    try:
        shown = view(path, port=port)
    except OSError as error:
        fail(f"{path}: port {port} cannot be used: {error.strerror}")
    try:
        show({"input": path, "url": shown.url}, as_json, path)
        sys.stdout.flush()
        if not no_browser and not shown.open():
            say("there is no browser here: open the address above in one")
        shown.wait()
    except Stopped as stopped:  # how serving ends
        raise typer.Exit(stopped.status) from None
