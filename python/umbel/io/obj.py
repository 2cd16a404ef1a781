"""Wavefront OBJ and its MTL: polygons, negative indices, vertex colours, materials.

The text is taken apart by whole-array operations: a line is known by its first word, and all
lines of a kind are parsed in one go, so that no Python loop runs over vertices or faces.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error, LoadWarning
from umbel.io.files import numbers
from umbel.io.mtl import read_mtl
from umbel.io.polygons import fans
from umbel.io.scene import NO_MATERIAL, Instance, Scene, with_default
from umbel.mesh import (
    Float32Array,
    Material,
    Mesh,
    UInt32Array,
    area_weighted_normals,
    unit_normals,
)


def read_obj(data: bytes, where: str, folder: Path | None = None) -> Scene:
    """The scene in an OBJ file's bytes; `where` names the file in errors, material libraries are
    looked for in `folder`."""
    lines = _Lines.of(data, where)
    points = _rows(lines, b"v", 3, 7, where)
    positions = points.columns(0, 3)
    colors = _vertex_colors(points)
    uvs = _rows(lines, b"vt", 1, 3, where)
    normals = _rows(lines, b"vn", 3, 3, where)
    corners = _corners(lines, where)
    face_lines, counts = corners.lines, corners.counts
    fan, parents = fans(counts)
    v, vt, vn = (
        _resolved(corners, lines, kind, values)
        for kind, values in ((b"v", corners.v), (b"vt", corners.vt), (b"vn", corners.vn))
    )
    _check(vt, len(uvs), corners, "texture coordinate", lines, where)
    _check(vn, len(normals), corners, "normal", lines, where)
    triangles, keep = _vertices(v, vt, vn, len(positions), len(uvs), len(normals), fan)
    mesh = Mesh(positions[keep.v], triangles)
    if colors is not None:
        mesh.colors = colors[keep.v]
    if len(uvs) and keep.vt is not None:
        coordinates = np.zeros((len(uvs) + 1, 2), np.float32)
        coordinates[1:] = uvs.columns(0, 2)
        mesh.uvs = coordinates[keep.vt]
    if len(normals) and keep.vn is not None:
        mesh.normals = _normals(normals.columns(0, 3), keep.vn, mesh)
    materials, ids = _materials(lines, face_lines[parents], folder, where)
    mesh.materials, mesh.material_ids = with_default(materials, ids)
    return Scene([mesh], mesh.materials, [Instance(0)])


# --- lines ------------------------------------------------------------------------------------


@dataclass
class _Lines:
    data: bytes
    first: NDArray[np.int64]  # offset of each line's first word
    end: NDArray[np.int64]  # offset of each line's newline
    words: NDArray[np.int64]  # number of words
    number: NDArray[np.int64]  # line number in the file, from 0
    kinds: dict[bytes, NDArray[np.int64]]  # keyword -> lines, ascending

    @staticmethod
    def of(data: bytes, where: str) -> _Lines:
        if b"\n" not in data and b"\r" in data:
            data = data.replace(b"\r", b"\n")
        if b"\\" in data:  # a backslash at a line's end continues it
            data = re.sub(rb"\\[ \t]*\r?\n", lambda m: b" " * len(m.group()), data)
        data += b"\n\n\n"
        text = np.frombuffer(data, np.uint8)
        space = text <= 32
        starts = np.flatnonzero(space[:-1] & ~space[1:]) + 1
        if not space[0]:
            starts = np.concatenate([[0], starts])
        ends = np.flatnonzero(text == 10)
        begins = np.concatenate([[0], ends[:-1] + 1])
        first = np.searchsorted(starts, begins)
        words = np.diff(np.concatenate([first, [len(starts)]]))
        data, changed = _without_comments(data, text, starts, first, words, ends)
        if changed:
            return _Lines.of(data, where)
        full = np.flatnonzero(words)
        offset = starts[first[full]]
        kinds = _kinds(text, offset)
        return _Lines(data, offset, ends[full], words[full], full, kinds)

    def text_of(self, keyword: bytes) -> bytes:
        """All that follows the keyword, of all its lines, one line each."""
        chosen = self.kinds[keyword]
        if not len(chosen):
            return b""
        # Lines of a kind come in long runs, which are cut out whole.
        breaks = np.flatnonzero(np.diff(chosen) != 1)
        run_first = self.first[chosen[np.concatenate([[0], breaks + 1])]].tolist()
        run_end = self.end[chosen[np.concatenate([breaks, [len(chosen) - 1]])]].tolist()
        text = b"\n".join([self.data[a:b] for a, b in zip(run_first, run_end, strict=True)])
        if keyword == b"vn":
            return text.replace(b"vn", b"  ")  # "nan" keeps its letters
        return text.translate(None, keyword)

    def line(self, index: int) -> bytes:
        return self.data[self.first[index] : self.end[index]].strip()


def _without_comments(
    data: bytes, text: Any, starts: Any, first: Any, words: Any, ends: Any
) -> tuple[bytes, bool]:
    """Blanks comments that follow something on their line (whole-line ones do no harm)."""
    if b"#" not in data:
        return data, False
    hashes = np.flatnonzero(text[starts] == ord("#"))
    is_first = np.zeros(len(starts) + 1, bool)
    is_first[first[words > 0]] = True
    inner = starts[hashes[~is_first[hashes]]]
    if not len(inner):
        return data, False
    line = np.searchsorted(ends, inner)
    begin = np.concatenate([[0], ends[:-1] + 1])[line]
    whole = text[starts[np.searchsorted(starts, begin)]] == ord("#")
    inner, line = inner[~whole], line[~whole]
    if not len(inner):
        return data, False
    out = bytearray(data)
    for a, b in zip(inner.tolist(), ends[line].tolist(), strict=True):
        out[a:b] = b" " * (b - a)
    return bytes(out).removesuffix(b"\n\n\n"), True


def _kinds(text: NDArray[np.uint8], offset: NDArray[np.int64]) -> dict[bytes, NDArray[np.int64]]:
    c0, c1, c2 = text[offset], text[offset + 1], text[offset + 2]
    v = c0 == ord("v")
    other = ~v
    kinds = {
        b"v": v & (c1 <= 32),
        b"vt": v & (c1 == ord("t")) & (c2 <= 32),
        b"vn": v & (c1 == ord("n")) & (c2 <= 32),
        b"f": other & (c0 == ord("f")) & (c1 <= 32),
        b"usemtl": other & (c0 == ord("u")) & (c1 == ord("s")),
        b"mtllib": other & (c0 == ord("m")) & (c1 == ord("t")),
    }
    return {keyword: np.flatnonzero(mask) for keyword, mask in kinds.items()}


# --- numbers ----------------------------------------------------------------------------------


@dataclass
class _Rows:
    """Lines of numbers, one after another; row i begins at starts[i]."""

    values: NDArray[np.float64]
    starts: NDArray[np.int64]
    lengths: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.starts)

    def columns(self, low: int, high: int) -> Float32Array:
        """(n, high - low) float32; what a row lacks is 0."""
        n = len(self.starts)
        with np.errstate(over="ignore"):
            if n and (self.lengths == self.lengths[0]).all() and self.lengths[0] >= high:
                return np.ascontiguousarray(
                    self.values.reshape(n, -1)[:, low:high], dtype=np.float32
                )
            padded = np.concatenate([self.values, [0.0]])
            out = np.empty((n, high - low), np.float32)
            for k in range(low, high):
                at = np.where(self.lengths > k, self.starts + k, len(self.values))
                out[:, k - low] = padded[at]
        return out


def _rows(lines: _Lines, keyword: bytes, least: int, most: int, where: str) -> _Rows:
    chosen = lines.kinds[keyword]
    lengths = lines.words[chosen] - 1
    bad = np.flatnonzero((lengths < least) | (lengths > most + 1))
    if len(bad):
        at = chosen[bad[0]]
        raise Error(
            f"{where}, line {lines.number[at] + 1}: '{keyword.decode()}' has "
            f"{lengths[bad[0]]} numbers, not {least} to {most}"
        )
    starts = np.cumsum(lengths) - lengths
    text = lines.text_of(keyword)
    try:
        values = numbers(text, int(lengths.sum()), where)
    except Error:
        raise _bad_line(lines, keyword, lengths, where, float) from None
    return _Rows(values, starts, lengths)


def _bad_line(lines: _Lines, keyword: bytes, lengths: Any, where: str, parse: Any) -> Error:
    for at in lines.kinds[keyword].tolist():
        for word in lines.line(at).split()[1:]:
            try:
                for part in word.split(b"/") if keyword == b"f" else [word]:
                    parse(part or b"0")
            except ValueError:
                shown = word[:40].decode("utf-8", "replace")
                return Error(f"{where}, line {lines.number[at] + 1}: {shown!r} is no number")
    return Error(f"{where}: the numbers after '{keyword.decode()}' make no sense")


def _vertex_colors(points: _Rows) -> Float32Array | None:
    coloured = points.lengths >= 6
    if not coloured.any():
        return None
    out = np.ones((len(points), 4), np.float32)
    out[coloured, :3] = points.columns(3, 6)[coloured]
    with_alpha = points.lengths == 7
    out[with_alpha, 3:] = points.columns(6, 7)[with_alpha]
    if np.nanmax(out[:, :3], initial=0.0) > 1.0:
        out[:, :3] /= np.float32(255.0)
    return out


# --- faces ------------------------------------------------------------------------------------


@dataclass
class _Corners:
    """The corners of all faces; indices as written, 0 where there is none."""

    v: NDArray[np.int64]
    vt: NDArray[np.int64] | None
    vn: NDArray[np.int64] | None
    counts: NDArray[np.int64]  # of each face
    lines: NDArray[np.int64]  # of each face


def _corners(lines: _Lines, where: str) -> _Corners:
    chosen = lines.kinds[b"f"]
    counts = lines.words[chosen] - 1
    text = lines.text_of(b"f")
    if b"/" in text:
        text = re.sub(rb"/+(?=\s|$)", b"", text) if _dangles(text) else text
        text = text.replace(b"//", b"/0/")
    total = int(counts.sum())
    slashes = _slashes_per_word(text) if b"/" in text else np.zeros(total, np.int64)
    if len(slashes) != total or (total and slashes.max() > 2):
        raise _bad_line(lines, b"f", counts, where, int)
    try:
        values = numbers(
            text.replace(b"/", b" "), total + int(slashes.sum()), where, dtype=np.int64
        )
    except Error:
        raise _bad_line(lines, b"f", counts, where, int) from None
    first = np.cumsum(slashes + 1) - slashes - 1
    zero = np.flatnonzero(values[first] == 0)
    if len(zero):
        at = chosen[np.searchsorted(np.cumsum(counts), zero[0], "right")]
        raise Error(f"{where}, line {lines.number[at] + 1}: vertex index 0; OBJ counts from 1")
    few = int((counts < 3).sum())
    if few:
        warnings.warn(
            f"{where}: {few} faces have fewer than three corners and are left out",
            LoadWarning,
            stacklevel=3,
        )
    most = int(slashes.max()) if total else 0
    vt = np.where(slashes >= 1, values[np.minimum(first + 1, len(values) - 1)], 0) if most else None
    vn = (
        np.where(slashes == 2, values[np.minimum(first + 2, len(values) - 1)], 0)
        if most == 2
        else None
    )
    if vt is not None and not vt.any():
        vt = None
    return _Corners(values[first], vt, vn, counts, chosen)


def _dangles(text: bytes) -> bool:
    return any(mark in text for mark in (b"/ ", b"/\n", b"/\r", b"/\t")) or text.endswith(b"/")


def _slashes_per_word(text: bytes) -> NDArray[np.int64]:
    letters = np.frombuffer(b" " + text, np.uint8)
    space = letters <= 32
    starts = np.flatnonzero(space[:-1] & ~space[1:]) + 1
    total = np.cumsum(letters == ord("/"), dtype=np.int64)
    before = total[starts] - (letters[starts] == ord("/"))
    return np.diff(np.concatenate([before, total[-1:]]))


def _resolved(
    corners: _Corners, lines: _Lines, keyword: bytes, values: NDArray[np.int64] | None
) -> NDArray[np.int64] | None:
    """Indices from 0; -1 where there is none. Negative ones count back from their own line."""
    if values is None:
        return None
    out = values - 1
    negative = np.flatnonzero(values < 0)
    if len(negative):
        face = np.searchsorted(np.cumsum(corners.counts), negative, "right")
        seen = np.searchsorted(lines.kinds[keyword], corners.lines[face])
        back = seen + values[negative]
        out[negative] = np.where(back < 0, -2, back)
    return out


def _check(
    indices: NDArray[np.int64] | None,
    count: int,
    corners: _Corners,
    what: str,
    lines: _Lines,
    where: str,
) -> None:
    if indices is None:
        return
    bad = np.flatnonzero((indices >= count) | (indices < -1))
    if len(bad):
        face = np.searchsorted(np.cumsum(corners.counts), bad[0], "right")
        number = lines.number[corners.lines[face]] + 1
        raise Error(f"{where}, line {number}: a {what} index is beyond the {count} there are")


@dataclass
class _Kept:
    """Which v, vt + 1 and vn + 1 each vertex of the mesh has; None where no corner has any."""

    v: Any
    vt: NDArray[np.int64] | None
    vn: NDArray[np.int64] | None


def _vertices(
    v: NDArray[np.int64] | None,
    vt: NDArray[np.int64] | None,
    vn: NDArray[np.int64] | None,
    n_v: int,
    n_vt: int,
    n_vn: int,
    fan: NDArray[np.int64],
) -> tuple[UInt32Array, _Kept]:
    assert v is not None
    inside = (v >= 0) & (v < n_v)
    # Where each v always goes with the vt and vn of its own number, the file's vertices stay.
    if all(
        w is None or (n == n_v and np.array_equal(w[inside], v[inside]))
        for w, n in ((vt, n_vt), (vn, n_vn))
    ):
        numbered = np.where(inside, v, NO_MATERIAL).astype(np.uint32)
        own = np.arange(n_v) + 1
        return numbered[fan], _Kept(
            slice(None), None if vt is None else own, None if vn is None else own
        )
    t = np.zeros(len(v), np.int64) if vt is None else vt + 1
    m = np.zeros(len(v), np.int64) if vn is None else vn + 1
    used = np.zeros(len(v), bool)
    used[fan.reshape(-1)] = True
    used &= inside
    chosen = np.flatnonzero(used)
    if (n_v + 1) * (n_vt + 1) * (n_vn + 1) < 2**62:
        key = (v[chosen] * (n_vt + 1) + t[chosen]) * (n_vn + 1) + m[chosen]
        _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    else:
        table = np.stack([v[chosen], t[chosen], m[chosen]], axis=1)
        _, first, inverse = np.unique(table, axis=0, return_index=True, return_inverse=True)
    numbered = np.full(len(v), 0xFFFFFFFF, np.uint32)
    numbered[chosen] = inverse.reshape(-1)
    source = chosen[first]
    return numbered[fan], _Kept(
        v[source], None if vt is None else t[source], None if vn is None else m[source]
    )


def _normals(given: Float32Array, which: NDArray[np.int64], mesh: Mesh) -> Float32Array:
    padded = np.zeros((len(given) + 1, 3), np.float32)
    padded[1:] = unit_normals(given)
    out = padded[which]
    missing = which == 0
    if missing.any():
        out[missing] = area_weighted_normals(mesh.positions, mesh.triangles)[missing]
    return out


# --- materials --------------------------------------------------------------------------------


def _materials(
    lines: _Lines, triangle_lines: NDArray[np.int64], folder: Path | None, where: str
) -> tuple[list[Material], UInt32Array | None]:
    uses = lines.kinds[b"usemtl"]
    if not len(uses):
        return [], None
    library = _libraries(lines, folder, where)
    numbers_of: dict[str, int] = {}
    materials: list[Material] = []
    use_ids = []
    for at in uses.tolist():
        name = _argument(lines.line(at))
        if name not in numbers_of:
            numbers_of[name] = len(materials)
            materials.append(library.get(name) or Material(name=name))
        use_ids.append(numbers_of[name])
    ids = np.array([NO_MATERIAL, *use_ids], np.uint32)
    return materials, ids[np.searchsorted(uses, triangle_lines)]


def _argument(line: bytes) -> str:
    words = line.split(None, 1)
    return words[1].strip().decode("utf-8", "replace") if len(words) > 1 else ""


def _libraries(lines: _Lines, folder: Path | None, where: str) -> dict[str, Material]:
    found: dict[str, Material] = {}
    if folder is None:
        return found
    for at in lines.kinds[b"mtllib"].tolist():
        whole = _argument(lines.line(at))
        names = [whole] if _is_file(folder, whole) else whole.split()
        for name in names:
            if not _is_file(folder, name):
                warnings.warn(f"{where}: no material library {name!r}", LoadWarning, stacklevel=4)
                continue
            try:
                library = folder / name.replace("\\", "/")
                found.update(read_mtl(library.read_bytes(), library.parent))
            except OSError as error:
                warnings.warn(
                    f"{where}: cannot read {name!r}: {error.strerror}", LoadWarning, stacklevel=4
                )
    return found


def _is_file(folder: Path, name: str) -> bool:
    try:
        return (folder / name.replace("\\", "/")).is_file()
    except (OSError, ValueError):
        return False
