"""An asset as 3D Tiles 1.1: a folder of glTF tiles for other viewers."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from umbel.errors import Cancelled, Error, warn_lost
from umbel.export.glb import glb_bytes, grid_node
from umbel.export.packed import PackedArrays, Quantized, quantized
from umbel.export.piece import Doubles
from umbel.export.plan import Plan, Tile, make_plan
from umbel.export.repeats import Repeat, Repeats
from umbel.export.skirts import with_skirts
from umbel.export.source import Y_TO_Z, Source, copyright_of, material_list
from umbel.export.tileset import implicit_error, subtrees, tileset
from umbel.geometry.arrays import thread_count, whole
from umbel.geometry.repair import Progress, stops
from umbel.io.gltf.material_table import FEWER, MaterialTable
from umbel.io.textures.images import TextureImage
from umbel.io.textures.packed import Made, packed
from umbel.lod.asset import Asset
from umbel.replacing import folder_to_make

TILE_TRIANGLES = 32_768
IMPLICIT_ABOVE = 10_000
STEPS = 2**15
"""Positions of a tile are on a grid of so many steps along its cell; a power of two, so that cells
side by side round points between them equally, and float arithmetic gives both the same."""

_MOST_CUT = 2**24
"""Of the source's triangles: what of instances may lie across borders of cells and be cut."""


@dataclass(frozen=True)
class TilesReport:
    """What was written."""

    files: int
    bytes: int
    tiles: int  #: with content
    depth: int  #: of the tree: 0 is the root alone
    triangles: int  #: of all tiles
    implicit: bool
    errors: list[float]  #: of tiles that have children, by depth, as the levels say
    #: the most that tiles of different errors side by side can be apart, across the surface
    largest_gap: float
    largest_move: float  #: of a vertex, as positions are rounded to the grid of a tile


def export_tiles(
    source: Asset | str | os.PathLike[str],
    folder: str | os.PathLike[str],
    *,
    tile_triangles: int = TILE_TRIANGLES,
    implicit_above: int = IMPLICIT_ABOVE,
    skirts: bool = False,
    flatten: bool = False,
    up: str | None = None,
    progress: Progress | None = None,
    threads: int = 0,
) -> TilesReport:
    """Writes an asset as 3D Tiles 1.1 (docs/export.md) to a folder that is empty or not there yet.
    It takes its name when all is written. Reads what a tile needs, tile by tile.

    tile_triangles: most of the source's triangles in a cell that is not split.
    implicit_above: with more tiles the tree is written as implicit tiling, unless many instances
        lie across the borders of its cells: their tiles have larger boxes.
    skirts: hang strips from tiles' borders that cover gaps beside tiles of another error.
    flatten: store each instance, for viewers without EXT_mesh_gpu_instancing.
    up: "y" or "z", the asset's axis to the zenith; None: what is known of its source.
    progress: called with (fraction, stage); returning False cancels (umbel.Cancelled).
    """
    most = whole("tile_triangles", tile_triangles)
    if most < 1:
        raise Error("tile_triangles must be at least 1")
    above = whole("implicit_above", implicit_above)
    asset = source if isinstance(source, Asset) else Asset(source)
    target = Path(folder)
    try:
        place = folder_to_make(target)
        with tempfile.TemporaryDirectory(dir=place.parent, prefix=".umbel-") as made:
            whole_folder = Path(made) / "tiles"
            whole_folder.mkdir()
            writer = _Writer(Source(asset, up), whole_folder, skirts, flatten)
            report = writer.write(most, above, thread_count(threads), progress)
            _flush(whole_folder)
            if place.exists():
                place.rmdir()
            whole_folder.rename(place)
    except OSError as error:
        raise Error(f"cannot write {target}: {error.strerror or error}") from None
    lost = [*writer.source.losses(target), *writer.lost]
    if lost:
        warn_lost(f"{target} was written without", lost, most=8)
    return report


def _flush(folder: Path) -> None:
    """Waits until all is on disk: at the end, since a wait for each file takes longer than it."""
    for path in folder.rglob("*"):
        if path.is_file():
            with path.open("rb+") as file:
                os.fsync(file.fileno())


class _Writer:
    def __init__(self, source: Source, folder: Path, skirts: bool, flatten: bool) -> None:
        self.source, self.folder, self.skirts = source, folder, skirts
        self.repeats = None if flatten else Repeats(source)
        #: Of all instances, those that no plane cuts in any tile.
        self.whole = np.zeros(len(source.boxes), bool)
        self.asset = copyright_of(source.asset)
        self.files = self.bytes = 0
        self.images: dict[bytes, str] = {}
        self.lost: set[str] = set()  # that only tiles tell
        self.materials = self._shared_materials()

    def write(
        self, most: int, implicit_above: int, threads: int, progress: Progress | None
    ) -> TilesReport:
        report = progress or (lambda *_: None)
        if stops(report(0.0, "choosing tiles")):
            raise Cancelled("cancelled")
        plan = make_plan(self.source, most)
        tiles = self._whole_instances(plan, implicit_above)
        for done, (tile, chunks) in enumerate(self._contents(plan, tiles, threads)):
            if chunks:
                self._file(f"tiles/{tile.name}.glb", chunks)
            if stops(report(done / len(tiles), "writing tiles")):
                raise Cancelled("cancelled")
        plan.prune()
        if plan.root.box is None and not plan.root.children:
            raise Error(f"{self.source.asset.path}: all triangles are degenerate")
        tiles = list(plan.tiles())
        implicit = not self.whole.any() and len(tiles) > implicit_above
        if implicit:
            for name, data in subtrees(plan).items():
                self._file(name, [data])
        self._file("tileset.json", [tileset(plan, self.source.origin, implicit)])
        return self._report(plan, tiles, implicit)

    def _whole_instances(self, plan: Plan, implicit_above: int) -> list[Tile]:
        """Decides which instances no plane cuts, and returns all tiles. Cells of implicit tiles are
        the tiles' boxes, so there nothing may stick out of them."""
        boxes = self.source.boxes
        self.whole = plan.keep_whole(boxes)
        tiles = list(plan.tiles())
        if len(tiles) > implicit_above:
            out = self.whole.copy()
            for tile in tiles:
                if not tile.children:
                    low, high = plan.grid.cell(tile)
                    own = boxes[tile.whole]
                    inside = ((own[:, :3] >= low) & (own[:, 3:] <= high)).all(axis=1)
                    out[tile.whole[inside]] = False
            if self.source.triangles[out].sum() <= _MOST_CUT:
                plan.keep_inside(boxes)
                self.whole[:] = False
        return tiles

    def _report(self, plan: Plan, tiles: list[Tile], implicit: bool) -> TilesReport:
        moves = [self._step(plan, tile) for tile in tiles if tile.box is not None]
        move = max(moves) * 3**0.5 / 2
        # The root has no neighbour; tiles of the same error fit.
        inner = sorted({tile.error for tile in tiles if tile.depth > 0}, reverse=True)
        return TilesReport(
            files=self.files,
            bytes=self.bytes,
            tiles=len(moves),
            depth=max(tile.depth for tile in tiles),
            triangles=sum(tile.triangles for tile in tiles),
            implicit=implicit,
            errors=[implicit_error(plan) / 2**d for d in range(len(plan.errors))]
            if implicit
            else plan.errors,
            largest_gap=sum(inner[:2]) + 2 * move if len(inner) > 1 else 0.0,
            largest_move=move,
        )

    @staticmethod
    def _step(plan: Plan, tile: Tile) -> float:
        return plan.grid.side / float(2**tile.depth * STEPS)

    def _contents(
        self, plan: Plan, tiles: list[Tile], threads: int
    ) -> Iterator[tuple[Tile, list[bytes]]]:
        """The files of all tiles in their order, made by several threads, a few ahead."""
        count = threads or os.cpu_count() or 1
        waiting: list[tuple[Tile, Future[list[bytes]]]] = []
        with ThreadPoolExecutor(count) as pool:
            try:
                for tile in tiles:
                    waiting.append((tile, pool.submit(self._content, plan, tile)))
                    if len(waiting) > 2 * count:
                        first, future = waiting.pop(0)
                        yield first, future.result()
                for tile, future in waiting:
                    yield tile, future.result()
            finally:
                pool.shutdown(wait=True, cancel_futures=True)

    def _content(self, plan: Plan, tile: Tile) -> list[bytes]:
        """The file of a tile, in chunks; none if nothing is in its cell."""
        low, high = plan.grid.cell(tile)
        # In glTF's axes the cell's least corner is another.
        corner = np.minimum(low @ Y_TO_Z, high @ Y_TO_Z)
        step = self._step(plan, tile)
        repeats: list[Repeat] = []
        if self.repeats is not None:
            repeats = self.repeats.of(tile.whole, tile.error, corner, step)
        grids = self._grids(plan, tile, corner, step, repeats)
        boxes = [repeat.box for repeat in repeats]
        for surface, origin in grids:
            points = surface.rows["POSITION"].astype(np.float64) * step + origin
            box = np.stack([points.min(axis=0), points.max(axis=0)]) @ Y_TO_Z.T
            boxes.append(np.sort(box, axis=0))
            tile.triangles += len(surface.triangles)
        if not boxes:
            return []
        corners = np.stack(boxes)
        tile.box = np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])
        tile.triangles += sum(repeat.triangles for repeat in repeats)
        return self._chunks(tile.name, corner, step, grids, repeats)

    def _grids(
        self, plan: Plan, tile: Tile, corner: Doubles, step: float, repeats: list[Repeat]
    ) -> list[tuple[Quantized, Doubles]]:
        """All of a tile but what is drawn several times, each with the corner of its grid: what its
        planes cut, and instances that stick out of the cell."""
        low, high = plan.grid.cell(tile)
        without = self.whole.copy()
        without[tile.whole] = True
        rest = tile.whole
        for repeat in repeats:
            rest = np.setdiff1d(rest, repeat.instances)
        boxes = self.source.boxes[rest]
        inside = ((boxes[:, :3] >= low) & (boxes[:, 3:] <= high)).all(axis=1)
        without[rest[inside]] = False
        made = []
        piece = self.source.cut(tile.error, low, high, without)
        if piece is not None:
            for axis, value, above in plan.grid.cuts(tile):
                piece = piece.half(axis, value, above)
            if self.skirts and tile.depth > 0:
                parent = plan.errors[tile.depth - 1]
                piece = with_skirts(piece, low, high, parent + tile.error)
            made.append((quantized(piece.turned(Y_TO_Z.T), corner, step), corner))
        # 16 bits reach half a cell beyond either side.
        outer = corner - STEPS // 2 * step
        piece = self.source.whole(tile.error, rest[~inside])
        if piece is not None:
            made.append((quantized(piece.turned(Y_TO_Z.T), outer, step), outer))
        return [(surface, origin) for surface, origin in made if surface is not None]

    def _chunks(
        self,
        name: str,
        corner: Doubles,
        step: float,
        grids: list[tuple[Quantized, Doubles]],
        repeats: list[Repeat],
    ) -> list[bytes]:
        """The file of a tile."""
        arrays = PackedArrays()
        surfaces = [surface for surface, _ in grids]
        surfaces += [repeat.surface for repeat in repeats]
        ids = [one.materials for one in surfaces if one.materials is not None]
        used = np.unique(np.concatenate(ids)).tolist() if ids else []
        lost: list[str] = []
        table = MaterialTable(self._keep_image, [self.materials[k] for k in used], lost)
        table.write()
        numbers = {k: i for i, k in enumerate(used)}
        meshes = [
            {"primitives": arrays.mesh(one, lambda k, sets: table.number(numbers[k], sets))}
            for one in surfaces
        ]
        self.lost.update({FEWER}.intersection(lost))
        nodes = [grid_node(origin, step, mesh=k) for k, (_, origin) in enumerate(grids)]
        nodes += [r.node(arrays, len(nodes) + k, corner) for k, r in enumerate(repeats)]
        scene = {
            "asset": self.asset,
            "roots": list(range(len(nodes))),
            "nodes": nodes,
            "meshes": meshes,
        }
        return glb_bytes(arrays, table, scene, name=name)

    def _shared_materials(self) -> list[Any]:
        """The materials; their images become files that all tiles share."""
        lost: list[str] = []
        given = []
        made: Made = {}
        files: dict[Path, bytes] = {}
        for material in material_list(self.source):
            ours, gone = packed(material, made)
            images = {slot: _in_memory(image, files) for slot, image in ours.images.items()}
            given.append(replace(ours, images=images))
            lost += gone
        MaterialTable(self._keep_image, given, lost).write()
        if lost:
            warn_lost("the tiles have not all textures", list(dict.fromkeys(lost)))
        return given

    def _keep_image(self, data: bytes, kind: str) -> dict[str, Any]:
        if data not in self.images:
            name = f"textures/{len(self.images)}.{kind.rpartition('/')[2]}"
            self._file(name, [data])
            self.images[data] = name
        return {"uri": f"../../{self.images[data]}"}

    def _file(self, name: str, chunks: list[bytes]) -> None:
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("xb") as file:  # the folder has no name yet
            file.writelines(chunks)
        self.files += 1
        self.bytes += sum(len(chunk) for chunk in chunks)


def _in_memory(image: TextureImage, files: dict[Path, bytes]) -> TextureImage:
    """The image with the bytes of its file, which every tile would read again; `files` are those
    that are known. It stays as it is where there is no such file."""
    if image.fallback is not None:
        image = replace(image, fallback=_in_memory(image.fallback, files))
    if image.path is None:
        return image
    try:
        if image.path not in files:
            files[image.path] = image.encoded()
    except Error:
        return image
    return replace(image, data=files[image.path])  # with its path, which errors name
