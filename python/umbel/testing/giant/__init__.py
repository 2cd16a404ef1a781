"""Meshes of any number of triangles, made piece by piece: for experiments with what does not fit
into memory.

    from umbel.testing import giant

    mesh = giant.scan(256_000_000, seed=7)
    for block in mesh.blocks():          # positions, and triangles of them, a million at a time
        ...
    giant.write(mesh, "scan.ply")        # also .stl, .obj, .glb
    giant.write_tiles(mesh, "tiles", ".ply")

The same arguments give the same bits on every machine. Vertices that blocks or files share have
equal positions to the bit, so whoever joins equal positions gets the whole surface.
"""

from __future__ import annotations

from umbel.errors import Error
from umbel.testing.giant.city import City
from umbel.testing.giant.files import write, write_tiles
from umbel.testing.giant.foliage import Foliage
from umbel.testing.giant.grid import Grid, scan_grid, terrain_grid
from umbel.testing.giant.mesh import Block, Giant
from umbel.testing.giant.variants import Shuffled, Soup

__all__ = [
    "KINDS",
    "Block",
    "Giant",
    "city",
    "foliage",
    "make",
    "scan",
    "terrain",
    "write",
    "write_tiles",
]

KINDS = ("terrain", "scan", "foliage", "city")

_MOST = 1 << 40


def terrain(
    triangles: int,
    seed: int = 1,
    *,
    seams: bool = False,
    shuffled: bool = False,
    soup: bool = False,
) -> Giant:
    """A field of fractal heights over a square, one vertex at each point. With `seams`: charts of
    128 x 128 cells with texture coordinates of their own, so vertices on their borders are
    doubled."""
    return _variant(terrain_grid(_checked(triangles), seed, seams), seed, shuffled, soup)


def scan(
    triangles: int,
    seed: int = 1,
    *,
    tile: int = 512,
    origin: tuple[float, float, float] = (523_000.0, 5_412_000.0, 310.0),
    seams: bool = False,
    shuffled: bool = False,
    soup: bool = False,
) -> Giant:
    """A rough surface in square tiles of `tile` x `tile` cells, far from zero as maps are. Each
    tile has vertices of its own; those on a border are equal to the neighbour's to the bit."""
    if not 1 <= tile <= 4096:
        raise Error(f"tile is {tile}, must be 1 to 4096 cells")
    grid: Grid = scan_grid(_checked(triangles), seed, tile, origin, seams)
    return _variant(grid, seed, shuffled, soup)


def foliage(
    triangles: int,
    seed: int = 1,
    *,
    seams: bool = False,
    shuffled: bool = False,
    soup: bool = False,
) -> Giant:
    """Leaves of two triangles each, in crowns: nothing is connected to anything."""
    return _variant(Foliage(_checked(triangles), seed, seams), seed, shuffled, soup)


def city(
    triangles: int,
    seed: int = 1,
    *,
    seams: bool = False,
    shuffled: bool = False,
    soup: bool = False,
) -> Giant:
    """Buildings of 768 triangles, each closed and apart from the others, of two materials. With
    `seams` each of a building's sides is a chart."""
    return _variant(City(_checked(triangles), seed, seams), seed, shuffled, soup)


def make(kind: str, triangles: int, seed: int = 1, **options: bool) -> Giant:
    """A mesh of one of `KINDS`."""
    makers = {"terrain": terrain, "scan": scan, "foliage": foliage, "city": city}
    if kind not in makers:
        raise Error(f"kind is {kind!r}, must be one of {', '.join(KINDS)}")
    return makers[kind](triangles, seed, **options)


def _checked(triangles: int) -> int:
    if not 1 <= triangles <= _MOST:
        raise Error(f"triangles is {triangles}, must be 1 to 2^40")
    return int(triangles)


def _variant(mesh: Giant, seed: int, shuffled: bool, soup: bool) -> Giant:
    if shuffled:
        mesh = Shuffled(mesh, seed)
    return Soup(mesh) if soup else mesh
