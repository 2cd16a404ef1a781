"""How machines other than the driver read the source: a stretch of it, from its files."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from umbel import _umbel
from umbel.errors import Error
from umbel.io.blocks import Source
from umbel.io.blocks.layout import again
from umbel.scale.executor import SOURCE
from umbel.scale.storage import fetch_file, is_address, write_file

#: Triangles of a stretch that is sorted at once (src/scale/route.hpp).
_STRETCH = 2 << 20
#: A machine fetches whole files, so larger ones are sorted by the driver.
_LARGEST = 1 << 30


def write_recipe(source: Source, names: Sequence[str], folder: Path, is_staged: bool) -> bool:
    """Writes how to open the source into a work folder. False: only the driver can.

    names: of the files as they were given, perhaps addresses, in the order of `source.files`.
    is_staged: the work folder is at an address, so paths mean nothing on other machines.
    """
    recipe = source.recipe
    if recipe is None:
        return False
    files = list(recipe["files"])
    sizes = [Path(file).stat().st_size for file in files]
    if is_staged:
        given = {str(path.absolute()): name for path, name in zip(source.files, names, strict=True)}
        files = [given.get(file, file) for file in files]
        if not all(is_address(file) for file in files) or max(sizes, default=0) > _LARGEST:
            return False
    write_file(folder / SOURCE, json.dumps({**recipe, "files": files, "sizes": sizes}).encode())
    return True


def fetch_stretch(folder: Path, number: int) -> tuple[Any, int]:
    """A source that has one stretch of its triangles: files without any of them are empty. Gives it
    and the bytes that were fetched."""
    recipe = json.loads((folder / SOURCE).read_text())
    below = folder / "files"
    below.mkdir()
    paths = [below / f"{number:06d}" for number in range(len(recipe["files"]))]
    for path, size in zip(paths, recipe["sizes"], strict=True):
        with open(path, "wb") as file:
            file.truncate(size)
    source = _umbel.TableSource(again({**recipe, "files": paths}))
    begin = min(number * _STRETCH, source.triangles)
    fetched = 0
    for needed in source.files(begin, min(begin + _STRETCH, source.triangles)):
        name, size = recipe["files"][needed], recipe["sizes"][needed]
        fetch_file(name, paths[needed])
        if paths[needed].stat().st_size != size:
            raise Error(f"{name} has changed since the build began")
        fetched += size
    return source, fetched
