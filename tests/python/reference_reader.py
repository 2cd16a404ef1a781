"""Reads `.umbel` files by docs/format.md alone: plain Python and NumPy, none of the library."""

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

NONE = 0xFFFFFFFF
NAMES = {0: "positions", 1: "normals", 2: "tangents", 4: "uvs", 8: "colors"}


class Bits:
    """A stream of bits, the lowest of a byte first."""

    def __init__(self, data: bytes):
        self.value, self.left = int.from_bytes(data, "little"), 8 * len(data)

    def take(self, count: int) -> int:
        value = self.value & ((1 << count) - 1)
        self.value >>= count
        self.left -= count
        return value

    def zeros(self, most: int) -> int:
        count = 0
        while count < most and self.take(1) == 0:
            count += 1
        return count

    def rice(self, k: int) -> int:
        quotient = self.zeros(16)
        return self.take(32) if quotient == 16 else quotient << k | self.take(k)


@dataclass
class Attribute:
    flag: int
    coding: int
    bits: int
    step: float

    @property
    def components(self) -> int:
        if self.coding in (2, 3):
            return 2
        return {0: 3, 1: 3, 2: 4, 4: 2, 8: 4}[self.flag]


class Walk:
    """The triangles of a cluster, and from which vertices each vertex is predicted."""

    def __init__(self, bits: Bits, vertices: int, triangles: int):
        self.bits, self.seen, self.next = bits, 0, 0
        self.triangles: list[tuple[int, int, int]] = []
        self.parents: list[tuple[int, int, int]] = []
        self.gates: list[tuple[int, int, int]] = []
        self.open: set[int] = set()
        self.begins: dict[int, int] = {}
        self.ends: dict[int, int] = {}
        while len(self.triangles) < triangles:
            gate = self.pop()
            if gate is None:
                self.start()
            else:
                self.cross(*gate)
        while self.seen < vertices:
            self.new_after_last()
        assert self.seen == vertices

    def new(self, a: int, b: int, across: int) -> int:
        self.parents.append((a, b, across))
        self.seen += 1
        return self.seen - 1

    def new_after_last(self) -> int:
        before = max(self.seen, 1) - 1
        return self.new(before, before, before)

    def index(self) -> int:
        index = self.bits.take(max(self.seen - 1, 0).bit_length())
        assert index < self.seen
        return index

    def close(self, gate: int) -> None:
        a, b, _ = self.gates[gate]
        self.open.discard(gate)
        if self.begins.get(a) == gate:
            del self.begins[a]
        if self.ends.get(b) == gate:
            del self.ends[b]

    def pop(self) -> tuple[int, int, int] | None:
        while self.next < len(self.gates):
            gate = self.next
            self.next += 1
            if gate in self.open:
                self.close(gate)
                return self.gates[gate]
        return None

    def pass_edge(self, x: int, y: int, w: int) -> None:
        gate = self.begins.get(x)
        if gate is None or self.gates[gate][1] != y:
            gate = self.ends.get(y)
        if gate is not None and self.gates[gate][0] == x:
            self.close(gate)
        elif self.bits.take(1):
            self.begins[y] = self.ends[x] = len(self.gates)
            self.open.add(len(self.gates))
            self.gates.append((y, x, w))

    def start(self) -> None:
        a, b, c = (self.new_after_last() if self.bits.take(1) else self.index() for _ in range(3))
        self.triangles.append((a, b, c))
        for edge in ((a, b, c), (b, c, a), (c, a, b)):
            self.pass_edge(*edge)

    def cross(self, a: int, b: int, across: int) -> None:
        kind = self.bits.zeros(4)
        if kind == 4:
            return
        if kind == 0:
            c = self.new(a, b, across)
        elif kind == 1:
            c = self.gates[self.begins[b]][1]
        elif kind == 2:
            c = self.gates[self.ends[a]][0]
        else:
            c = self.index()
        self.triangles.append((a, b, c))
        self.pass_edge(b, c, a)
        self.pass_edge(c, a, b)


def signed(value: int) -> int:
    return (value + 2**31) % 2**32 - 2**31


def read_vertices(bits: Bits, walk: Walk, attributes: list[Attribute], ranges: list) -> np.ndarray:
    """The integers of a cluster's vertices, a row each."""
    smooth = [a.flag not in (0, 4) for a in attributes for _ in range(a.components)]
    columns = range(len(smooth))
    parameters, first = [], []
    for lowest, width in ranges:
        parameters.append(bits.take(5))
        first.append(signed(lowest + bits.take(width)))
    rows = [first]
    for a, b, across in walk.parents[1:]:
        row = []
        for i in columns:
            r = 0 if parameters[i] == 31 else bits.rice(parameters[i])
            remainder = r // 2 if r % 2 == 0 else -(r + 1) // 2
            if smooth[i]:
                predicted = (rows[a][i] + rows[b][i]) // 2
            else:
                predicted = rows[a][i] + rows[b][i] - rows[across][i]
            row.append(signed(predicted + remainder))
        rows.append(row)
    return np.array(rows, np.int64)


def decode_octahedral(i: np.ndarray, bits: int) -> np.ndarray:
    xy = i / (2 ** (bits - 1) - 1)
    z = 1 - np.abs(xy).sum(axis=1, keepdims=True)
    xy = xy + np.minimum(z, 0) * np.where(xy < 0, -1, 1)
    n = np.hstack([xy, z])
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def decode_tangents(i: np.ndarray, bits: int, normals: np.ndarray, below: np.ndarray) -> np.ndarray:
    x, y, z = normals.T
    g = np.where(below, -1.0, 1.0)
    p = -1 / (g + z)
    q = x * y * p
    u = np.stack([1 + g * x * x * p, g * q, -g * x], axis=1)
    v = np.stack([q, g + y * y * p, -y], axis=1)
    angle = 2 * np.pi * i[:, :1] / 2**bits
    side = np.where(i[:, 1:] != 0, -1.0, 1.0)
    return np.hstack([u * np.cos(angle) + v * np.sin(angle), side])


def decode_srgb(i: np.ndarray, bits: int) -> np.ndarray:
    s = i / (2**bits - 1)
    linear = np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)
    return np.hstack([linear[:, :3], s[:, 3:]])


def decode_values(rows: np.ndarray, attributes: list[Attribute]) -> dict[str, np.ndarray]:
    values: dict[str, np.ndarray] = {}
    at = 0
    for attribute in attributes:
        i = rows[:, at : at + attribute.components]
        at += attribute.components
        if attribute.coding == 0:
            words = np.where(i < 0, i ^ 0x7FFFFFFF, i).astype(np.int32)
            value = words.view(np.float32)
        elif attribute.coding == 1:
            value = i * attribute.step
        elif attribute.coding == 2:
            value = decode_octahedral(i, attribute.bits)
            below = np.abs(i).sum(axis=1) > 2 ** (attribute.bits - 1) - 1
        elif attribute.coding == 3:
            value = decode_tangents(i, attribute.bits, values["normals"], below)
        else:
            value = decode_srgb(i, attribute.bits)
        values[NAMES[attribute.flag]] = value
    return values


class Reader:
    """An asset: `header` and `tables` as they are in the file, clusters when asked for."""

    def __init__(self, path: Path):
        self.data = data = path.read_bytes()
        assert data[:8] == b"\xabUMBL\r\n\x1a"
        major, _, size, file_bytes, head_bytes = struct.unpack_from("<HHIQQ", data, 8)
        assert major == 2
        assert file_bytes == len(data)
        (count,) = struct.unpack_from("<I", data, 40)
        self.source_triangles, self.source_vertices = struct.unpack_from("<QQ", data, 56)
        self.low = np.frombuffer(data, "<f4", 3, 80)
        self.high = np.frombuffer(data, "<f4", 3, 92)
        self.sections = {}
        for i in range(count):
            name, stride, offset, length, rows = struct.unpack_from("<4sIQQQ", data, size + 32 * i)
            assert offset + length <= head_bytes
            self.sections[name.decode()] = (offset, stride, rows)
        self.metadata = data[self.sections["META"][0] :][: self.sections["META"][2]].decode()
        self.attributes = [Attribute(*row) for row in self.rows("ATTR", "<IIIf")]
        self.levels = self.rows("LEVL", "<II")
        self.groups = self.rows("GRUP", "<IIIIfffff")
        self.clusters = self.rows("CLUS", "<IIHH6H")
        self.nodes = self.rows("NODE", "<fffffIII")
        self.pages = {row[3]: row[:3] for row in self.rows("PAGE", "<QQQII")}

    def rows(self, section: str, layout: str) -> list[tuple]:
        offset, stride, count = self.sections[section]
        return [struct.unpack_from(layout, self.data, offset + i * stride) for i in range(count)]

    def box(self, cluster: int) -> np.ndarray:
        """Lowest and highest corner."""
        q = np.array(self.clusters[cluster][4:], np.float64).reshape(2, 3)
        low, high = self.low.astype(np.float64), self.high.astype(np.float64)
        return (low + (high - low) * (q / 65535)).astype(np.float32)

    def group(self, group: int) -> list[dict[str, np.ndarray]]:
        """The clusters of a group: their triangles and attributes."""
        offset, size, _ = self.pages[group]
        page = self.data[offset : offset + size]
        name, first, count, components = struct.unpack_from("<IIII", page)
        assert (name, first, count) == (group, *self.groups[group][:2])
        assert components == sum(a.components for a in self.attributes)
        ranges = [struct.unpack_from("<iI", page, 16 + 8 * i) for i in range(components)]
        entries = 16 + 8 * components
        begin, made = entries + 8 * count, []
        for i in range(count):
            end, vertices, triangles = struct.unpack_from("<IHH", page, entries + 8 * i)
            bits = Bits(page[begin:end])
            walk = Walk(bits, vertices + 1, triangles + 1)
            rows = read_vertices(bits, walk, self.attributes, ranges)
            assert 0 <= bits.left < 8
            assert bits.value == 0
            cluster = decode_values(rows, self.attributes)
            made.append({"triangles": np.array(walk.triangles), **cluster})
            begin = end
        return made
