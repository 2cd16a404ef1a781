"""`build_lod` of meshes that do not fit into memory: what it gives is an asset on disk."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
import weakref
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from umbel.errors import Error
from umbel.geometry.mesh import Mesh
from umbel.geometry.repair import Progress
from umbel.io.files import replacing
from umbel.lod.asset import Asset
from umbel.replacing import behind_links, beside
from umbel.scale.build_asset import build_with
from umbel.scale.storage import as_path, is_address, make_folder


class StoredLod(Asset):
    """What `build_lod` gives with `memory`, `work`, `unit_triangles` or `executor`: an open asset,
    with what is known of the build. Its file is a temporary one: it goes with this object, as a
    `Lod` does, and `save` keeps it."""

    def __init__(self, path: Path, report: dict[str, Any]) -> None:
        super().__init__(path)
        self.report = report
        """What was built: see `Lod.report` and `build_asset`."""
        self._end = weakref.finalize(self, shutil.rmtree, path.parent, ignore_errors=True)

    @property
    def config(self) -> dict[str, Any]:
        """The settings that it was built with."""
        return dict(self.info["metadata"]["config"])

    @property
    def source(self) -> dict[str, Any]:
        """What it was built from."""
        return dict(self.info["metadata"]["source"])

    def save(self, path: str | os.PathLike[str]) -> int:
        """Writes the asset beside `path` and renames it, so that a file of that name is always
        whole. Returns its bytes. On the disk of the work folder nothing is copied."""
        target = behind_links(Path(path))
        if not _linked(Path(self.path), target):
            with replacing(target) as out, open(self.path, "rb") as file:
                shutil.copyfileobj(file, out, 1 << 22)
        return target.stat().st_size


def _linked(path: Path, target: Path) -> bool:
    """The file under another name as well; False on another disk, or one without links."""
    link = beside(target)
    try:
        os.link(path, link)
    except OSError:
        return False
    try:
        link.replace(target)
    except OSError as error:
        raise Error(f"cannot write {target}: {error.strerror or error}") from None
    finally:
        link.unlink(missing_ok=True)
    return True


def build_stored(
    mesh: Any,
    config: dict[str, Any],
    refused: Mapping[str, bool],
    limits: Mapping[str, Any],
    work: str | os.PathLike[str] | None,
    progress: Progress | None,
    threads: int,
) -> StoredLod:
    """As `build_lod` in units. `config`: what the library takes; `refused`: arguments that need the
    whole mesh in memory, and whether they are given; `limits`: the rest for `build_with`."""
    given = [name for name in ("measured_error", "lock_borders") if config[name]]
    given += [name for name, is_given in refused.items() if is_given]
    if given:
        raise Error(f"{given[0]} needs the whole mesh in memory: it is not possible in units")
    if work is None and limits["resume"]:
        raise Error("resume needs the work folder of the build that was stopped")
    # What is made at an address is read here.
    local = None if work is None or is_address(work) else Path(as_path(work))
    if local:
        make_folder(local)
    try:
        folder = Path(tempfile.mkdtemp(prefix="umbel-", dir=local))
    except OSError as error:
        raise Error(f"cannot make a temporary folder: {error}") from None
    try:
        report = build_with(
            _source(mesh),
            folder / "lod.umbel",
            config,
            work=work if is_address(work) else (local or folder) / "units",
            progress=progress,
            threads=threads,
            **limits,
        )
        return StoredLod(folder / "lod.umbel", report)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        if local:
            with contextlib.suppress(OSError):
                local.rmdir()
        raise


def _source(mesh: Any) -> Any:
    """Paths and blocks as they are; what is one mesh in memory as such."""
    if isinstance(mesh, (str, os.PathLike)):
        return mesh
    is_pair = isinstance(mesh, tuple) and len(mesh) == 2 and hasattr(mesh[0], "shape")
    is_one = is_pair or isinstance(mesh, Mesh) or hasattr(mesh, "faces")
    return Mesh.from_any(mesh) if is_one or hasattr(mesh, "instances") else mesh
