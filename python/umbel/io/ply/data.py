"""The tables of a PLY file, ASCII or binary of either byte order: its header's elements, and for
each of their properties an array."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error, LoadWarning
from umbel.io.files import BOM, numbers
from umbel.io.text_lines import Words, line_at

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "int64": "i8", "uint64": "u8",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_BYTE_ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
FIRST_LINE = re.compile(rb"ply[ \t]*(\r\n|\n|\r)")
LONGEST_HEADER = 1 << 20


@dataclass
class Property:
    name: str
    type: str
    count_type: str | None = None  # of a list


@dataclass
class Element:
    name: str
    count: int
    properties: list[Property] = field(default_factory=list)

    @property
    def has_lists(self) -> bool:
        return any(p.count_type for p in self.properties)


@dataclass
class ListColumn:
    """A list property of all rows: row i holds values[sum of counts before i, + counts[i])."""

    counts: NDArray[np.int64]
    values: NDArray[Any]


Columns = dict[str, Any]  # property name -> array of one value a row, or ListColumn


def read_tables(data: bytes, where: str) -> dict[str, Columns]:
    """The columns of each element. Raises, with the line or the byte, where the data do not fit the
    header, and warns of data after the last element."""
    byte_order, elements, body, data = read_header(data, where)
    columns: dict[str, Columns] = {}
    place = _Position(data, where, body, byte_order == "=")
    if byte_order == "=":
        values = numbers(data[body:], None, where, first_line=line_at(data, body))
        at = 0
        for element in elements:
            columns[element.name], at = _ascii_element(values, at, element, place)
        left_out, what = len(values) - at, "numbers"
        if left_out:
            _check_lines(elements, columns, place)
        if not data.endswith((b"\n", b"\r")) and len(values):
            last = place.named(len(values) - 1)
            _warn(f"{last}: the last line has no end; the file may be cut short")
    else:
        at = body
        for element in elements:
            columns[element.name], at = _binary_element(data, at, element, byte_order, place)
        left_out, what = len(data) - at, "bytes"
    if left_out:
        sentence = f"{place.named(at)}: {left_out} {what} after the last element are left out"
        _warn(f"{sentence}; do the header's counts lie?")
    return columns


def _warn(sentence: str) -> None:
    warnings.warn(sentence, LoadWarning, stacklevel=7)


@dataclass
class _Position:
    """Where in a file something is: a byte, or in ASCII a number, whose line is named."""

    data: bytes
    where: str
    body: int
    is_ascii: bool
    first: int = 0  #: the number that `at` counts from
    size: int = 1  #: what `at` counts for each number

    def named(self, at: int) -> str:
        """The file and the place in it."""
        if not self.is_ascii:
            return f"{self.where}, byte {min(at, len(self.data))}"
        words = Words.of(self.data[self.body :])
        at = self.first + at // self.size
        if not len(words):
            offset = 0
        else:
            offset = int(words.starts[at] if at < len(words) else words.ends[-1])
        return f"{self.where}, line {line_at(self.data, self.body + offset)}"


# --- header -----------------------------------------------------------------------------------


def read_header(data: bytes, where: str) -> tuple[str, list[Element], int, bytes]:
    """Byte order, elements, where the body begins, and the data, which begin with "ply" and end
    with a line's end."""
    data = data.removeprefix(BOM)
    first = FIRST_LINE.match(data)
    if not first:
        raise Error(f"{where} is no PLY file: it does not begin with 'ply'")
    newline = first.group(1)
    end = re.search(rb"[\r\n]end_header[ \t]*" + newline, data[:LONGEST_HEADER])
    if not end and re.search(rb"[\r\n]end_header[ \t]*$", data[:LONGEST_HEADER]):
        data += newline  # nothing follows
        end = re.search(rb"[\r\n]end_header[ \t]*" + newline, data[:LONGEST_HEADER])
    if not end:
        raise Error(f"{where} is cut short or corrupt: its header has no 'end_header'")
    byte_order = ""
    elements: list[Element] = []
    # As bytes: comments may be in any encoding, and other texts have more ends of lines.
    for number, raw in enumerate(data[first.end() : end.start()].splitlines()):
        words = [word.decode("utf-8", "backslashreplace") for word in raw.split()]
        line, place = " ".join(words), f"{where}, line {number + 2}"
        if not words or words[0] in ("comment", "obj_info"):
            continue
        if words[0] == "format" and len(words) >= 2 and words[1] in _BYTE_ORDERS:
            byte_order = _BYTE_ORDERS[words[1]]
        elif words[0] == "element" and len(words) == 3 and words[2].isdecimal():
            if any(e.name == words[1] for e in elements):
                raise Error(f"{place}: there are two elements named {words[1]!r}")
            elements.append(Element(words[1], int(words[2][:20])))
        elif words[0] == "property" and elements:
            added = _property(words, line, place)
            if any(p.name == added.name for p in elements[-1].properties):
                _warn(f"{place}: all but the last property {added.name!r} are left out")
            elements[-1].properties.append(added)
        else:
            raise Error(f"{place}: header line {line[:80]!r} makes no sense")
    if not byte_order:
        raise Error(f"{where}: the header names no known format")
    return byte_order, elements, end.end(), data


def _property(words: list[str], line: str, place: str) -> Property:
    if len(words) == 3 and words[1] in _TYPES:
        return Property(words[2], _TYPES[words[1]])
    if len(words) == 5 and words[1] == "list" and words[2] in _TYPES and words[3] in _TYPES:
        return Property(words[4], _TYPES[words[3]], _TYPES[words[2]])
    raise Error(f"{place}: header line {line[:80]!r} makes no sense")


# --- elements ---------------------------------------------------------------------------------


def _short(element: Element, rows: int, at: int, place: _Position) -> Error:
    return Error(
        f"{place.named(at)}: the file is cut short or corrupt: the header says {element.count} of "
        f"element {element.name!r}, the data holds {rows}"
    )


def _bad_count(element: Element, row: int, count: float, at: int, place: _Position) -> Error:
    return Error(
        f"{place.named(at)}: a list of element {element.name!r}, row {row}, has length {count:g}"
    )


def _dtype(element: Element, byte_order: str, lengths: list[int]) -> np.dtype[Any]:
    fields: list[tuple[str, Any]] = []
    at = iter(lengths)
    for k, p in enumerate(element.properties):
        if p.count_type:
            fields.append((f"n{k}", byte_order + p.count_type))
            fields.append((f"p{k}", (byte_order + p.type, (next(at),))))
        else:
            fields.append((f"p{k}", byte_order + p.type))
    return np.dtype(fields)


def _binary_element(
    data: bytes, start: int, element: Element, byte_order: str, place: _Position
) -> tuple[Columns, int]:
    if not element.properties or not element.count:
        return {p.name: _empty(p) for p in element.properties}, start
    shortest = _dtype(element, byte_order, [0] * len(element.properties)).itemsize
    if element.count * shortest > len(data) - start:
        raise _short(element, (len(data) - start) // shortest, len(data), place)
    columns = _uniform_rows(data, start, element, byte_order)
    if columns is not None:
        return columns
    return _ragged_rows(data, start, element, byte_order, place)


def _empty(p: Property) -> Any:
    values = np.zeros(0, p.type)
    return ListColumn(np.zeros(0, np.int64), values) if p.count_type else values


def _uniform_rows(
    data: bytes, start: int, element: Element, byte_order: str
) -> tuple[Columns, int] | None:
    """All rows at once, if every row's lists are as long as the first row's; else None."""
    lengths: list[int] = []
    position = start
    for p in element.properties:
        size = np.dtype(p.type).itemsize
        if p.count_type:
            head = np.dtype(byte_order + p.count_type)
            if position + head.itemsize > len(data):
                return None
            count = np.frombuffer(data, head, 1, position)[0]
            if not 0 <= count <= len(data):
                return None
            lengths.append(int(count))
            position += head.itemsize + int(count) * size
        else:
            position += size
    if (position - start) * element.count > len(data) - start:
        return None
    rows = np.frombuffer(data, _dtype(element, byte_order, lengths), element.count, start)
    columns: Columns = {}
    at = iter(lengths)
    for k, p in enumerate(element.properties):
        values = rows[f"p{k}"]
        if p.count_type:
            length = next(at)
            if not (rows[f"n{k}"] == length).all():
                return None
            columns[p.name] = ListColumn(
                np.full(element.count, length, np.int64), values.reshape(element.count * length)
            )
        else:
            columns[p.name] = values
    return columns, position + (position - start) * (element.count - 1)


def _ragged_rows(
    data: bytes, start: int, element: Element, byte_order: str, place: _Position
) -> tuple[Columns, int]:
    """Rows whose lists differ in length: found one by one, then gathered all at once."""
    sizes = [np.dtype(p.type).itemsize for p in element.properties]
    heads = [np.dtype(p.count_type).itemsize if p.count_type else 0 for p in element.properties]
    order = "big" if byte_order == ">" else "little"
    offsets: list[list[int]] = [[] for _ in element.properties]
    counts: list[list[int]] = [[] for _ in element.properties]
    single_bytes = [p.count_type == "u1" for p in element.properties]
    steps = list(zip(heads, sizes, single_bytes, offsets, counts, element.properties, strict=True))
    position, end = start, len(data)
    for row in range(element.count):
        for head, size, single, column_offsets, column_counts, p in steps:
            if head:
                if position + head > end:
                    raise _short(element, row, end, place)
                if single:
                    count = data[position]
                else:
                    raw = data[position : position + head]
                    count = _list_length(raw, p, order)
                    if count < 0:
                        raise _bad_count(element, row, _number(raw, p, order), position, place)
                position += head
                column_offsets.append(position)
                column_counts.append(count)
                position += count * size
            else:
                column_offsets.append(position)
                position += size
        if position > end:
            raise _short(element, row, end, place)
    every = np.frombuffer(data, np.uint8)
    columns: Columns = {}
    for k, p in enumerate(element.properties):
        first = np.array(offsets[k], np.int64)
        dtype = np.dtype(byte_order + p.type)
        if p.count_type:
            lengths = np.array(counts[k], np.int64)
            columns[p.name] = ListColumn(lengths, _gather(every, first, lengths, dtype))
        else:
            columns[p.name] = _gather(every, first, np.ones(len(first), np.int64), dtype)
    return columns, position


def _number(raw: bytes, p: Property, order: Any) -> float:
    return float(np.frombuffer(raw, (">" if order == "big" else "<") + str(p.count_type))[0])


def _list_length(raw: bytes, p: Property, order: Any) -> int:
    assert p.count_type is not None
    if p.count_type[0] == "f":
        value = _number(raw, p, order)
        return int(value) if value >= 0 and value == value // 1 and value < 2**53 else -1
    return int.from_bytes(raw, order, signed=p.count_type[0] == "i")


def _gather(
    raw: NDArray[np.uint8], first: NDArray[np.int64], lengths: NDArray[np.int64], dtype: Any
) -> NDArray[Any]:
    """`lengths[i]` items from byte `first[i]` on, for all i one after another."""
    total = int(lengths.sum())
    out = np.empty((total, dtype.itemsize), np.uint8)
    starts = np.cumsum(lengths) - lengths
    for length in np.unique(lengths):
        if not length:
            continue
        rows = np.flatnonzero(lengths == length)
        source = first[rows, None] + np.arange(length * dtype.itemsize)
        target = starts[rows, None] + np.arange(length)
        out[target.reshape(-1)] = raw[source].reshape(-1, dtype.itemsize)
    return out.reshape(-1).view(dtype)


def _check_lines(elements: list[Element], columns: dict[str, Columns], place: _Position) -> None:
    """Raises where a row does not begin with a line: the row before has more or fewer numbers than
    it should have, and all that follow are wrong."""
    words = Words.of(place.data[place.body :])
    line_end = ord("\n") if b"\n" in place.data else ord("\r")
    lines = np.searchsorted(np.flatnonzero(words.text == line_end), words.starts)  # of each word
    at = last = 0
    for element in elements:
        sizes = np.zeros(element.count if element.properties else 0, np.int64)
        for p in element.properties:
            column = columns[element.name][p.name]
            sizes += 1 + column.counts if isinstance(column, ListColumn) else 1
        starts = at + np.cumsum(sizes) - sizes
        before = np.concatenate([[last], starts])
        wrong = np.flatnonzero((starts > 0) & (lines[starts] == lines[np.maximum(starts - 1, 0)]))
        if len(wrong):
            row = int(before[wrong[0]])
            raise Error(
                f"{place.named(row)}: the line has {(lines == lines[row]).sum()} numbers, which is "
                f"no row of its element"
            )
        at, last = at + int(sizes.sum()), int(before[-1])


def _ascii_element(
    values: NDArray[Any], start: int, element: Element, place: _Position
) -> tuple[Columns, int]:
    if not element.properties or not element.count:
        return {p.name: _empty(p) for p in element.properties}, start
    columns_least = len(element.properties)
    if element.count * columns_least > len(values) - start:
        raise _short(element, (len(values) - start) // columns_least, len(values), place)
    if not element.has_lists:
        stop = start + element.count * columns_least
        table = values[start:stop].reshape(element.count, columns_least)
        return {p.name: _typed(table[:, k], p.type) for k, p in enumerate(element.properties)}, stop
    # A file of numbers is a binary file whose every item is a double.
    doubles = Element(
        element.name,
        element.count,
        [Property(p.name, "f8", "f8" if p.count_type else None) for p in element.properties],
    )
    raw = values[start:].tobytes()
    columns, stop = _binary_element(raw, 0, doubles, "=", replace(place, first=start, size=8))
    for p in element.properties:
        column = columns[p.name]
        if isinstance(column, ListColumn):
            columns[p.name] = ListColumn(column.counts, _typed(column.values, p.type))
        else:
            columns[p.name] = _typed(column, p.type)
    return columns, start + stop // 8


def _typed(values: NDArray[Any], type_name: str) -> NDArray[Any]:
    """Numbers of an ASCII file as their declared type, where that keeps them; wide indices and
    fractions stay."""
    dtype = np.dtype(type_name)
    if dtype.kind == "f":
        with np.errstate(over="ignore"):
            return values.astype(dtype)
    info = np.iinfo(dtype)
    fits = (values >= info.min) & (values <= info.max) & (values == np.floor(values))
    return values.astype(dtype) if dtype.itemsize < 8 and bool(fits.all()) else values
