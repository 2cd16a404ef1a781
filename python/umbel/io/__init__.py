"""Reading and writing meshes: .glb .gltf .obj .ply .stl in, .glb .gltf .obj .ply out."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from umbel.errors import Error
from umbel.geometry.mesh import Mesh
from umbel.io.addresses import fetched, is_address, load_fetched
from umbel.io.coordinates import sidecar
from umbel.io.files import GZIP, read_bytes, read_head
from umbel.io.folder import Folder
from umbel.io.gltf.tree import check_tree
from umbel.io.ply.data import FIRST_LINE
from umbel.io.scene import Instance, Scene, scene_of
from umbel.io.stl import is_whole_binary

__all__ = ["Instance", "Scene", "load", "load_poses", "load_scene", "save"]

_READABLE = (".glb", ".gltf", ".obj", ".ply", ".stl")
_WRITABLE = (".glb", ".gltf", ".obj", ".ply")


def load(path: str | os.PathLike[str], *, allow_outside: bool = False) -> Mesh:
    """Reads a mesh file as one mesh, as drawn: all primitives, node transforms and instances.

    Formats: .glb .gltf .obj .ply .stl, each also inside .gz. What a file's first bytes say wins
    over its extension. An address that fsspec understands (https://, s3://, memory://) is fetched
    with what the file refers to: the extra `umbel[remote]`. Raises `umbel.Error` naming the file,
    the line or byte and what is wrong there: a file that is cut short, or holds no mesh, is never a
    smaller or an empty one. What was left out is a `LoadWarning`. NaN and indices beyond the
    vertices are not looked for; `umbel.validate` does that.

    allow_outside: files that the file refers to (buffers, material libraries, images) may lie
        outside its folder.
    """
    return load_scene(path, allow_outside=allow_outside).flatten()


def load_poses(
    path: str | os.PathLike[str], rate: float = 30.0, *, allow_outside: bool = False
) -> Iterator[Mesh]:
    """The mesh of a glTF file as `load` gives it, in poses `rate` a second of each of its
    animations, one after the other: skins, morph targets and moving nodes. None without
    animations."""
    if not 0 < rate <= 1e4:
        raise Error(f"rate is {rate}, must be in (0, 10000]")
    file = Path(path)
    data = read_bytes(file)
    kind = _sniffed(data) or _extension(file)
    if kind not in (".glb", ".gltf"):
        raise Error(f"{file} has no animations: only glTF files can")
    from umbel.io.gltf.animation import read_poses

    return read_poses(data, str(file), Folder(file.parent, allow_outside), rate)


def load_scene(path: str | os.PathLike[str], *, allow_outside: bool = False) -> Scene:
    """Reads a mesh file with its instances apart; else like `load`."""
    if is_address(path):
        if allow_outside:
            raise Error(f"{path}: allow_outside is of files; an address's folder is never left")
        with fetched(str(path)) as local:
            return load_fetched(local, str(path))
    file = Path(path)
    extension = _extension(file)
    # An OBJ file is read in pieces, unless it is packed.
    data: bytes | Path = file if extension == ".obj" and _is_plain(file) else read_bytes(file)
    kind = _sniffed(data) or extension if isinstance(data, bytes) else extension
    if kind not in _READABLE:
        raise Error(f"{file}: cannot read '{extension}' files; {', '.join(_READABLE)} can be read")
    try:
        scene = _read(kind, data, file, Folder(file.parent, allow_outside))
    except Error:
        raise
    except MemoryError:
        raise Error(f"{file} does not fit into memory") from None
    except (ArithmeticError, AttributeError, LookupError, RuntimeError, TypeError, ValueError) as e:
        raise Error(f"{file} is corrupt: {type(e).__name__}: {e}") from e
    scene.name = os.path.splitext(file.name.removesuffix(".gz"))[0]
    beside = sidecar(file)
    for mesh in scene.meshes:
        mesh.name = mesh.name or scene.name
        mesh.source = str(file)
        mesh.coordinates = mesh.coordinates | beside
    return scene


def save(path: str | os.PathLike[str], mesh: object) -> None:
    """Writes a mesh (anything that `Mesh.from_any` takes) or a `Scene`: .glb, .gltf, .ply or .obj.

    glTF keeps everything: a scene's nodes, materials with their textures, joints, cameras, lights,
    extras. What the other formats cannot hold is one `umbel.LoadWarning`. The file is written
    under another name and renamed when whole, together with the .bin of a .gltf or the .mtl and
    images of an .obj, so a failure leaves nothing new. Of the files beside it only those are
    replaced that Umbel wrote with an older file at `path`; others stay, and ours get a number.
    Raises `umbel.Error` if the folder cannot be written, the disk is full or the extension is
    unknown. Positions, normals and UVs come back to the bit, but for UVs that OBJ turns round.
    """
    file = Path(path)
    extension = file.suffix.lower()
    if extension not in _WRITABLE:
        raise Error(f"{file}: cannot write '{file.suffix}' files; {', '.join(_WRITABLE)} can be")
    if extension in (".glb", ".gltf"):
        from umbel.io.gltf.writer import write_gltf

        write_gltf(file, mesh if isinstance(mesh, Scene) else scene_of(Mesh.from_any(mesh)))
        return
    made = Mesh.from_any(mesh)
    if isinstance(mesh, Scene) and "meshes" not in made.tree:
        # Joined meshes leave their names and extras out of the tree; losses are read from it.
        used = dict.fromkeys(instance.mesh for instance in mesh.instances)
        made.tree = made.tree | {"meshes": [mesh.mesh_notes(k) for k in used]}
    check_tree(made.tree, made.name or "the mesh")
    if extension == ".ply":
        from umbel.io.ply.writer import write_ply

        write_ply(file, made)
    else:
        from umbel.io.obj.writer import write_obj

        write_obj(file, made)


def _extension(file: Path) -> str:
    return os.path.splitext(file.name.removesuffix(".gz"))[1].lower()


def _is_plain(file: Path) -> bool:
    """Whether a file can be read at any place, and is neither packed nor of another format."""
    return file.is_file() and not (head := read_head(file)).startswith(GZIP) and not _sniffed(head)


def _sniffed(data: bytes) -> str:
    """The format that the first bytes show, or nothing."""
    if is_whole_binary(data, len(data)):  # whose first bytes may be any
        return ".stl"
    if data[:4] == b"glTF":
        return ".glb"
    if FIRST_LINE.match(data):
        return ".ply"
    head = data[:512].lstrip(b"\xef\xbb\xbf \t\r\n")
    if head[:1] == b"{" and b'"asset"' in data:
        return ".gltf"
    return ""


def _read(kind: str, data: bytes | Path, file: Path, folder: Folder) -> Scene:
    where = str(file)
    if kind == ".obj":
        from umbel.io.obj.reader import read_obj

        return read_obj(data, where, folder)
    assert isinstance(data, bytes)
    if kind == ".ply":
        from umbel.io.ply.reader import read_ply

        return read_ply(data, where)
    if kind == ".stl":
        from umbel.io.stl import read_stl

        return read_stl(data, where)
    from umbel.io.gltf.reader import read_gltf

    return read_gltf(data, where, folder)
