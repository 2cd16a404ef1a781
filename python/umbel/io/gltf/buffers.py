"""Buffers, buffer views and accessors of glTF 2.0 as NumPy arrays, decompressed where they are
meshopt-compressed (EXT_meshopt_compression, KHR_meshopt_compression).
"""

from __future__ import annotations

import base64
import binascii
import json
import urllib.parse
import warnings
from collections.abc import Callable
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error, LoadWarning
from umbel.geometry.mesh import Float32Array, UInt32Array, to_unit_floats
from umbel.io.files import read_bytes
from umbel.io.folder import Folder

Json = dict[str, Any]

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_GLB_MAGIC = 0x46546C67
_JSON_CHUNK = 0x4E4F534A
_BIN_CHUNK = 0x004E4942
#: No codec here makes more of its input than this; larger claims are damage.
_MOST_EXPANSION = 4096
_SHOWN = 5  # names in a warning
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")


def parse_container(data: bytes, where: str) -> tuple[Json, bytes | None]:
    """The JSON of a .gltf or .glb, and the .glb's binary chunk if it has one."""
    binary = None
    text = data
    if data[:4] == b"glTF":
        text, binary = _glb_chunks(data, where)
    return parse_json(text, where), binary


def parse_json(text: bytes, where: str) -> Json:
    """The object that a file's JSON is. Warns of names that an object has more than once, and of
    NaN and infinities, which some writers take for JSON."""
    repeated: dict[str, None] = {}
    no_numbers: dict[str, None] = {}

    def unique(pairs: list[tuple[str, Any]]) -> Json:
        out = dict(pairs)
        if len(out) < len(pairs):
            last = {name: k for k, (name, _) in enumerate(pairs)}
            found = [repr(name[:40]) for k, (name, _) in enumerate(pairs) if last[name] != k]
            repeated.update(dict.fromkeys(found))
        return out

    def no_number(word: str) -> float:
        no_numbers[word] = None
        return float(word)

    try:
        # Some writers pad a chunk with zeros.
        plain = text.rstrip(b"\0").decode("utf-8-sig")
        root = json.loads(plain, object_pairs_hook=unique, parse_constant=no_number)
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise Error(f"{where}: its JSON is corrupt: {error}") from None
    if not isinstance(root, dict):
        raise Error(f"{where}: its JSON is no object")
    if repeated:
        more = f" and {len(repeated) - _SHOWN} more" if len(repeated) > _SHOWN else ""
        shown = ", ".join(list(repeated)[:_SHOWN])
        _warn(f"{where}: all but the last of {shown}{more}, which objects of its JSON have twice")
    if no_numbers:
        sentence = (
            f"{where}: {', '.join(no_numbers)}, which JSON does not have, become null in files"
        )
        warnings.warn(sentence, LoadWarning, stacklevel=2)
    return root


def _glb_chunks(data: bytes, where: str) -> tuple[bytes, bytes | None]:
    ranges = glb_ranges(lambda at, size: data[at : at + size], len(data), where)
    parts = [data[at : at + size] for at, size in (r for r in ranges if r is not None)]
    return parts[0], parts[1] if len(parts) > 1 else None


def glb_ranges(
    read: Callable[[int, int], bytes], length: int, where: str
) -> tuple[tuple[int, int], tuple[int, int] | None]:
    """Where in a .glb of so many bytes the JSON and the binary chunk are: first byte and size.
    `read(at, size)` gives bytes of the file."""
    if length < 20:
        raise Error(f"{where} is cut short: {length} bytes are no .glb")
    head = read(0, 12)
    version = int.from_bytes(head[4:8], "little")
    says = int.from_bytes(head[8:12], "little")
    if version != 2:
        raise Error(f"{where}: glTF version {version}, only 2 can be read")
    if says > length:
        raise Error(f"{where} is cut short: its header says {says} bytes, it has {length}")
    if says < length:
        _warn(f"{where}: {length - says} bytes from byte {says} on, its header's end")
    chunks: dict[int, tuple[int, int]] = {}
    others: list[int] = []
    at = 12
    while at + 8 <= says:
        chunk = read(at, 8)
        size = int.from_bytes(chunk[:4], "little")
        kind = int.from_bytes(chunk[4:], "little")
        if at + 8 + size > says:
            raise Error(f"{where}: the chunk at byte {at} runs past the end of the file")
        if kind not in (_JSON_CHUNK, _BIN_CHUNK) or kind in chunks:
            others.append(at)
        chunks.setdefault(kind, (at + 8, size))
        at += 8 + size
    if at != says:
        raise Error(f"{where}, byte {at}: {says - at} bytes are no chunk; the file is corrupt")
    if _JSON_CHUNK not in chunks:
        raise Error(f"{where} has no JSON chunk")
    if others:
        _warn(f"{where}: {len(others)} chunks that glTF does not have, from byte {others[0]} on")
    return chunks[_JSON_CHUNK], chunks.get(_BIN_CHUNK)


def _warn(sentence: str) -> None:
    warnings.warn(f"{sentence}, are left out", LoadWarning, stacklevel=2)


class Buffers:
    """The binary data of one glTF asset, read and decompressed on first use."""

    def __init__(self, root: Json, binary: bytes | None, where: str, folder: Folder | None) -> None:
        self.root = root
        self.where = where
        self._binary = binary
        self.folder = folder
        self._buffers: dict[int, bytes] = {}
        self._views: dict[int, tuple[bytes, int | None]] = {}
        self._has_warned = False

    def item(self, table: str, index: Any, user: str) -> Json:
        """Entry `index` of one of the asset's top-level arrays."""
        entries = self.root.get(table, [])
        if not isinstance(entries, list):
            raise Error(f"{self.where}: '{table}' is no array")
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(entries):
            raise Error(
                f"{self.where}: {user} refers to {table}[{index}], there are {len(entries)}"
            )
        entry = entries[index]
        if not isinstance(entry, dict):
            raise Error(f"{self.where}: {table}[{index}] is no object")
        return entry

    def number(self, entry: Json, key: str, user: str, default: int | None = None) -> int:
        """A count or an offset: an integer that is not negative."""
        value = entry.get(key, default)
        if not isinstance(value, int) or isinstance(value, bool) or value < 0:
            raise Error(f"{self.where}: {user} has {key} {value!r}")
        return value

    def buffer(self, index: Any, user: str) -> bytes:
        entry = self.item("buffers", index, user)
        if index not in self._buffers:
            self._buffers[index] = self._load(entry, index)
        return self._buffers[index]

    def _load(self, entry: Json, index: int) -> bytes:
        name = f"buffers[{index}]"
        uri = entry.get("uri")
        if uri is None:
            if self._binary is None or index != 0:
                raise Error(f"{self.where}: {name} has no data")
            data = self._binary
        elif is_data_uri(uri):
            data = data_uri(uri, f"{self.where}: {name}")
        elif isinstance(uri, str):
            data = self._external(uri, name)
        else:
            raise Error(f"{self.where}: {name} has a URI that is no text")
        length = self.number(entry, "byteLength", name, len(data))
        if length > len(data):
            raise Error(
                f"{self.where}: {name} should have {length} bytes, there are {len(data)}; the "
                f"file is cut short"
            )
        if uri is None and len(data) > length + 3:  # chunks are padded to whole words
            _warn(f"{self.where}: {len(data) - length} bytes after the {length} of {name}")
        return data[:length] if length < len(data) else data

    def _external(self, uri: str, name: str) -> bytes:
        if self.folder is None:
            raise Error(f"{self.where}: {name} is another file, {uri[:80]!r}")
        try:
            return read_bytes(self.folder.find_uri(uri), is_binary=True)
        except Error as error:
            raise Error(f"{self.where}: {name}: {error}") from None

    def slice(self, entry: Json, name: str) -> bytes:
        """The bytes that a view, or a compression extension in its place, points at."""
        data = self.buffer(entry.get("buffer"), name)
        offset = self.number(entry, "byteOffset", name, 0)
        length = self.number(entry, "byteLength", name)
        if offset + length > len(data):
            raise Error(
                f"{self.where}: {name} covers bytes {offset} to {offset + length} of a buffer "
                f"that has {len(data)}"
            )
        return data[offset : offset + length]

    def view(self, index: Any, user: str) -> tuple[bytes, int | None]:
        """The bytes of a buffer view and its stride (None: tightly packed)."""
        entry = self.item("bufferViews", index, user)
        if index not in self._views:
            name = f"bufferViews[{index}]"
            packed = _extension(entry, MESHOPT)
            if packed is not None:
                self._views[index] = self._meshopt(packed, name)
            else:
                stride = self.number(entry, "byteStride", name, 0) or None
                self._views[index] = self.slice(entry, name), stride
        return self._views[index]

    def _begin(self, view: Any) -> int:
        """Where a view that is not compressed begins in its buffer."""
        entry = self.item("bufferViews", view, "a view")
        return 0 if _extension(entry, MESHOPT) else self.number(entry, "byteOffset", "a view", 0)

    def _meshopt(self, entry: Json, name: str) -> tuple[bytes, int]:
        data = self.slice(entry, name)
        count = self.number(entry, "count", name)
        stride = self.number(entry, "byteStride", name)
        if count * stride > _MOST_EXPANSION * len(data):
            raise Error(f"{self.where}: {name} claims {count} elements from {len(data)} bytes")
        codec = _codec(self.where)
        mode, kind = entry.get("mode"), entry.get("filter", "NONE")
        try:
            if mode == "ATTRIBUTES":
                out = codec.meshopt_decode_vertex(data, count, stride)
                if kind != "NONE":
                    out = codec.meshopt_filter(out, kind, stride)
            elif mode == "TRIANGLES":
                out = codec.meshopt_decode_index(data, count, stride)
            elif mode == "INDICES":
                out = codec.meshopt_decode_index_sequence(data, count, stride)
            else:
                raise Error(f"mode {mode!r} is unknown")
        except (ValueError, RuntimeError) as error:
            raise Error(f"{self.where}: {name}: {error}") from None
        return np.ascontiguousarray(out).tobytes(), stride

    def array(self, index: Any, user: str) -> tuple[NDArray[Any], bool]:
        """An accessor as (count, width) in its own type, and whether its integers are normalised.
        Sparse entries are filled in."""
        entry = self.item("accessors", index, user)
        name = f"accessors[{index}]"
        component = _COMPONENTS.get(entry.get("componentType", 0))
        width = _WIDTHS.get(entry.get("type", ""))
        if component is None or width is None:
            raise Error(
                f"{self.where}: {name} has type {entry.get('type')!r} of component type "
                f"{entry.get('componentType')!r}"
            )
        count = self.number(entry, "count", name)
        if entry.get("bufferView") is None:
            available = sum(len(self.buffer(k, name)) for k in range(self._local_buffers()))
            if count > 1_000_000 + 64 * available:
                raise Error(f"{self.where}: {name} claims {count} elements and has no data")
            values = np.zeros((count, width), component)
        else:
            offset = self.number(entry, "byteOffset", name, 0)
            values = self._strided(entry["bufferView"], offset, count, component, width, name)
        if "sparse" in entry:
            values = self._with_sparse(values, entry["sparse"], name)
        return values, bool(entry.get("normalized", False))

    def _local_buffers(self) -> int:
        return 1 if self._binary is not None and self.root.get("buffers") else 0

    def _strided(
        self, view: Any, offset: int, count: int, component: str, width: int, name: str
    ) -> NDArray[Any]:
        data, stride = self.view(view, name)
        dtype = np.dtype(component)
        size = dtype.itemsize * width
        step = stride or size
        if step < size:
            raise Error(f"{self.where}: {name} has elements of {size} bytes every {step} bytes")
        if count and offset + (count - 1) * step + size > len(data):
            raise Error(
                f"{self.where}: {name} needs {offset + (count - 1) * step + size} bytes of "
                f"bufferViews[{view}], which has {len(data)}"
            )
        if not count:
            return np.zeros((0, width), dtype)
        begin = offset + self._begin(view)
        if begin % dtype.itemsize and not self._has_warned:
            self._has_warned = True  # once a file: if one array is so, mostly many are
            what = f"{name} begins at byte {begin} of its buffer, no multiple of {dtype.itemsize}"
            warnings.warn(
                f"{self.where}: {what}, and others may as well", LoadWarning, stacklevel=2
            )
        return np.ndarray((count, width), dtype, data, offset, (step, dtype.itemsize))

    def _with_sparse(self, values: NDArray[Any], sparse: Json, name: str) -> NDArray[Any]:
        name = f"{name}.sparse"
        count = self.number(sparse, "count", name)
        indices, entries = sparse.get("indices"), sparse.get("values")
        if indices is None or entries is None:
            raise Error(f"{self.where}: {name} lacks its indices or values")
        kind = _COMPONENTS.get(indices.get("componentType", 0))
        if kind is None or kind[1] != "u":
            raise Error(f"{self.where}: {name} has indices of no integer type")
        at = self._strided(
            indices.get("bufferView"),
            self.number(indices, "byteOffset", name, 0), count, kind, 1, name,
        )[:, 0]  # fmt: skip
        new = self._strided(
            entries.get("bufferView"),
            self.number(entries, "byteOffset", name, 0),
            count, values.dtype.str, values.shape[1], name,
        )  # fmt: skip
        if count and int(at.max()) >= len(values):
            raise Error(f"{self.where}: {name} sets element {int(at.max())} of {len(values)}")
        out = values.copy()
        out[at] = new
        return out

    def floats(self, index: Any, user: str, normalized: bool | None = None) -> Float32Array:
        """An accessor as (count, width) float32; normalised integers become [0, 1] or [-1, 1]."""
        values, flag = self.array(index, user)
        if flag if normalized is None else normalized:
            return to_unit_floats(values)
        return np.ascontiguousarray(values, np.float32)

    def indices(self, index: Any, user: str) -> UInt32Array:
        values, _ = self.array(index, user)
        if values.dtype.kind != "u" or values.shape[1] != 1:
            raise Error(f"{self.where}: {user} has indices that are no unsigned integers")
        return np.ascontiguousarray(values[:, 0], np.uint32)


def _extension(entry: Json, names: tuple[str, ...]) -> Json | None:
    extensions = entry.get("extensions")
    if isinstance(extensions, dict):
        for name in names:
            if isinstance(extensions.get(name), dict):
                found: Json = extensions[name]
                return found
    return None


def is_data_uri(uri: Any) -> TypeGuard[str]:
    """Whether a URI is the data themselves; schemes are of any case."""
    return isinstance(uri, str) and uri[:5].lower() == "data:"


def data_uri(uri: str, what: str) -> bytes:
    """What a data URI holds."""
    head, _, body = uri.partition(",")
    try:
        if head.lower().endswith(";base64"):
            packed = b"".join(urllib.parse.unquote_to_bytes(body).split())
            return base64.b64decode(packed, validate=True)
        return urllib.parse.unquote_to_bytes(body)
    except (binascii.Error, ValueError) as error:
        raise Error(f"{what} has a damaged data URI: {error}") from None


def _codec(where: str) -> Any:
    try:
        from umbel import _umbel
    except ImportError:
        raise Error(
            f"{where} is meshopt-compressed, which this installation of umbel cannot decode"
        ) from None
    return _umbel
