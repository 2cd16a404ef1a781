"""STL, binary and ASCII: three corners a triangle and nothing shared.

The facet normals repeat what the corners say, so they are left out. Vertices are not merged:
`umbel.weld` does that.
"""

from __future__ import annotations

import re
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error, LoadWarning
from umbel.geometry.mesh import Float32Array, Float64Array, Mesh
from umbel.io.files import BOM, numbers
from umbel.io.scene import Instance, Scene
from umbel.io.text_lines import Words, line_at

_HEADER = 84
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_COLOR = b"COLOR="  # of all triangles, in a header that Magics writes
_BLOCK = 1 << 20  # triangles that are looked at together
#: The words of a facet, "-" for numbers.
_CORNER = ["vertex", "-", "-", "-"]
_FACET = ["facet", "normal", "-", "-", "-", "outer", "loop", *_CORNER, *_CORNER, *_CORNER]
_FACET += ["endloop", "endfacet"]
_LINE_END = re.compile(rb"[\r\n]")
# What ends a name where the file is a single line; names may have these words, too.
_FIRST_FACET = re.compile(rb"(?<!\S)facet\s+normal\s+[-+.\dni]")
_NEXT_SOLID = re.compile(rb"(?<!\S)solid\s(?=.*?\sfacet\s+normal\s+[-+.\dni])")


def read_stl(data: bytes, where: str) -> Scene:
    """The scene in an STL file's bytes; `where` names the file in errors."""
    corners: NDArray[Any] = (
        _ascii(data, where) if _is_ascii(data, len(data)) else _binary(data, where)
    )
    mesh = Mesh(corners, np.arange(len(corners), dtype=np.uint32).reshape(-1, 3))
    return Scene([mesh], [], [Instance(0)])


def _is_ascii(data: bytes, length: int) -> bool:
    """Whether a file is text, by its first bytes and its length."""
    if is_whole_binary(data, length):  # which may begin with "solid", too
        return False
    if not data[:1024].removeprefix(BOM).lstrip().lower().startswith(b"solid"):
        return False
    return b"facet" in data[:4096].lower() or b"\0" not in data[:4096]


def is_whole_binary(head: bytes, length: int) -> bool:
    """Whether a file is as long as its count of triangles says, if it is a binary one."""
    return length == _HEADER + int.from_bytes(head[80:84], "little") * _RECORD.itemsize


def binary_table(head: bytes, length: int, where: str) -> tuple[int, int, int] | None:
    """Where the triangles of a binary file begin, the bytes of each, and how many there are, by the
    file's first 4096 bytes and its length; None for a text."""
    return (
        None
        if _is_ascii(head, length)
        else (_HEADER, _RECORD.itemsize, _count(head, length, where))
    )


def _count(head: bytes, length: int, where: str) -> int:
    if length < _HEADER:
        raise Error(
            f"{where} is cut short or no STL: a binary one has at least {_HEADER} bytes, this has "
            f"{length}"
        )
    count = int.from_bytes(head[80:84], "little")
    size = _RECORD.itemsize
    have = (length - _HEADER) // size
    if count > have:
        raise Error(
            f"{where} is cut short or no STL: the header says {count} triangles, there "
            f"are bytes for {have}, the last of them at byte {_HEADER + have * size}"
        )
    end = _HEADER + count * size
    if end < length and not count:
        raise Error(f"{where} is no STL: it says 0 triangles, and {length - end} bytes follow")
    if end < length:
        says = f"{have - count} more" if have > count else "no whole one"
        warnings.warn(
            f"{where}: {length - end} bytes after the {count} triangles of its header are left "
            f"out, from byte {end} on; there is room for {says}",
            LoadWarning,
            stacklevel=6,
        )
    return count


def warn_of_attributes(data: Any, count: int, where: str) -> None:
    """Says so if a binary file's header has a colour, or one of its triangles more than its normal
    and corners."""
    lost = ["the colour in its header"] if _COLOR in bytes(data[:80]) else []
    attributes = np.frombuffer(data, _RECORD, count, _HEADER)["attribute"]
    if any(attributes[k : k + _BLOCK].any() for k in range(0, count, _BLOCK)):
        lost.append("the attributes of triangles, which in some programs are colours")
    if lost:
        warnings.warn(f"{where}: left out: {'; '.join(lost)}", LoadWarning, stacklevel=6)


def _binary(data: bytes, where: str) -> Float32Array:
    count = _count(data, len(data), where)
    records = np.frombuffer(data, _RECORD, count, _HEADER)
    warn_of_attributes(data, count, where)
    return np.ascontiguousarray(records["corners"]).reshape(-1, 3)


# --- ASCII ------------------------------------------------------------------------------------


def _ascii(data: bytes, where: str) -> Float64Array:
    text = data.removeprefix(BOM).lower()
    body = _facets_of(text, where)
    words = Words.of(body)
    size = len(_FACET)
    wrong = len(words) // size  # the first facet that is not whole
    for k, word in enumerate(_FACET):
        good = words.are(slice(k, None, size), word.encode()) if word != "-" else np.ones(1, bool)
        wrong = min(wrong, int(np.argmin(good))) if not good.all() else wrong
    if wrong * size < len(words):
        _refuse(words, text, wrong * size, where)
    mask = np.zeros(len(body) + 1, np.int8)
    for k in (8, 12, 16):  # the first number of each corner
        mask[words.starts[k::size]] += 1
        mask[words.ends[k + 2 :: size]] -= 1
    kept = np.cumsum(mask, dtype=np.int8)[:-1].astype(bool)
    kept |= (words.text == 10) | (words.text == 13)  # for messages, which name lines
    chosen = np.where(kept, words.text, np.uint8(32)).tobytes()
    values = numbers(chosen, len(words) // size * 9, where, first_line=1)
    points: Float64Array = values.reshape(-1, 3)
    return points


def _refuse(words: Words, text: bytes, first: int, where: str) -> None:
    """Raises for the first word of the facet from word `first` on that should be another."""
    for k, word in enumerate(_FACET):
        at = first + k
        if at >= len(words):
            line = line_at(text, int(words.ends[-1]))
            raise Error(f"{where}, line {line}: the facet is cut short, {word!r} should follow")
        if word != "-" and not words.are(slice(at, at + 1), word.encode())[0]:
            line = line_at(text, int(words.starts[at]))
            raise Error(f"{where}, line {line}: {words.word(at)} is where {word!r} should be")


def _facets_of(text: bytes, where: str) -> bytes:
    """The text with blanks in place of "solid" and "endsolid" and the names that follow them."""
    out = bytearray(text)
    is_open, at, last, solids, line_end = False, 0, 0, 0, -1
    while (at := text.find(b"solid", at)) >= 0:
        is_end = text[max(at - 3, 0) : at] == b"end"
        begin = at - 3 * is_end
        if text[begin - 1 : begin].strip():
            at += 5  # part of a word
            continue
        if line_end < at:  # looked for once a line, which may be all of the file
            end = _LINE_END.search(text, at)
            line_end = end.start() if end else len(text)
        more = (_NEXT_SOLID if is_end else _FIRST_FACET).search(text, at + 5, line_end)
        stop = more.start() if more else line_end
        if is_end != is_open:
            line = line_at(text, at)
            raise Error(f"{where}, line {line}: 'solid' and 'endsolid' do not take turns")
        is_open = not is_end
        solids += is_open
        out[begin:stop] = b" " * (stop - begin)
        at = last = stop
    if is_open:
        raise Error(
            f"{where}, line {line_at(text, len(text.rstrip()))}: there is no 'endsolid'; the file "
            f"is cut short"
        )
    if rest := Words.of(bytes(out[last:])):
        line = line_at(text, last + int(rest.starts[0]))
        raise Error(f"{where}, line {line}: {rest.word(0)} follows the last 'endsolid'")
    if solids > 1:
        warnings.warn(f"{where}: its {solids} solids become one mesh", LoadWarning, stacklevel=7)
    return bytes(out)
