"""Reads `.umbel` files by docs/format.md alone: plain Python and NumPy, none of the library."""

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from helpers.reference_codec import (
    Attribute,
    Bits,
    Borders,
    Walk,
    read_vertices,
    read_vertices_3,
    signed,
)

NONE = 0xFFFFFFFF
NAMES = {0: "positions", 1: "normals", 2: "tangents", 4: "uvs", 8: "colors"}
NAMES |= {16: "joints", 32: "weights", 64: "material"}


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
        if attribute.flag not in NAMES or attribute.coding > 4:
            continue
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
        values[NAMES[attribute.flag] + str(attribute.set or "")] = value
    return values


def numbers(layout: str, data: bytes, offset: int, count: int, stride: int) -> list[tuple]:
    return [struct.unpack_from(layout, data, offset + i * stride) for i in range(count)]


def tables_3(part: bytes, components: int, clusters: int, references: int) -> tuple:
    """The components' ranges, the clusters' records, and where their data begin."""
    ranges = numbers("<iI", part, 32 * references, components, 8)
    begin = 32 * references + 8 * components
    records = numbers("<IBBHI6H", part, begin, clusters, 24)
    return ranges, records, begin + 24 * clusters


def tables_4(part: bytes, components: int, clusters: int, references: int) -> tuple:
    """The same, since version 4, with records as version 3 has them."""
    before = 32 * references
    bits = Bits(part[before:])
    ranges = [(signed(bits.take(32)), bits.take(6)) for _ in range(components)]
    size, lowest, material = bits.take(6), bits.take(32), bits.take(6)
    axes = [(bits.take(16), bits.take(5), bits.take(5)) for _ in range(3)]
    reference = references.bit_length()
    row = size + 16 + reference + material + sum(corner + extent for _, corner, extent in axes)
    begin = end = before + (components * 38 + 122 + row * clusters + 7) // 8
    records = []
    for _ in range(clusters):
        end += bits.take(size)
        counts = bits.take(8), bits.take(8)
        made_from = bits.take(reference)
        index = 0xFFFF if made_from == 0 else made_from - 1
        number = lowest + bits.take(material)
        corners = [(low + bits.take(corner), bits.take(extent)) for low, corner, extent in axes]
        box = [low for low, _ in corners] + [low + extent for low, extent in corners]
        records.append((end, *counts, index, number, *box))
    return ranges, records, begin


@dataclass
class Group:
    mesh: int
    first_cluster: int
    level: int
    method: int
    parents: int
    sphere: tuple[float, ...]
    error: float
    references: list[tuple]
    """Group, page, parents, error, centre, radius."""
    boxes: list[np.ndarray]
    materials: list[int]
    made_from: list[int]
    """Of each cluster, the group or none."""
    clusters: list[dict[str, np.ndarray]]


class Reader:
    """An asset: the sections as they are in the file, and pages when asked for."""

    def __init__(self, path: Path):
        self.data = data = path.read_bytes()
        assert data[:8] == b"\xabUMBL\r\n\x1a"
        self.major, _, size, file_bytes, head_bytes = struct.unpack_from("<HHIQQ", data, 8)
        assert self.major in (3, 4, 5, 6)
        assert file_bytes == len(data)
        (count,) = struct.unpack_from("<I", data, 40)
        self.sections = {}
        for name, stride, offset, length, rows, _ in numbers("<4sIQQQQ", data, size, count, 40):
            assert offset + length <= (len(data) if name == b"NODE" else head_bytes)
            self.sections[name.decode()] = (offset, stride, rows)
        self.metadata, self.materials = self.text("META"), self.text("MTRL")
        self.attributes = [Attribute(*row) for row in self.rows("ATTR", "<IIIHHIf")]
        self.meshes = self.rows("MESH", "<QQQ6f10I")
        self.levels = self.rows("LEVL", "<II")
        self.roots = self.rows("ROOT", "<IIIfffff")
        self.instances = self.rows("INST", "<12fI")
        self.pages = self.rows("PAGE", "<QIIQ")
        self.nodes = self.rows("NODE", "<fffffIII")
        origins = self.rows("ORIG", "<3d") if "ORIG" in self.sections else []
        assert len(origins) <= 1
        self.origin = origins[0] if origins else (0.0, 0.0, 0.0)
        self.scene = self.text("SCEN") if "SCEN" in self.sections else ""
        self.slices = {name: self.slices_of(*name) for name in (("PAGE", "PSUM"), ("NODE", "NSUM"))}
        (opening,) = struct.unpack_from("<Q", data, 56)
        assert opening == (self.sections["PAGE"][0] if opening else 0)

    def slices_of(self, table: str, sums: str) -> list[tuple[bytes, int]]:
        """Each slice of a table, and its checksum."""
        if sums not in self.sections:
            return []
        offset, stride, rows = self.sections[table]
        begins = range(0, rows, 4096)
        slices = [self.data[offset + i * stride :][: min(4096, rows - i) * stride] for i in begins]
        return list(zip(slices, [row[0] for row in self.rows(sums, "<Q")], strict=True))

    def text(self, section: str) -> str:
        offset, _, count = self.sections[section]
        return self.data[offset : offset + count].decode()

    def rows(self, section: str, layout: str) -> list[tuple]:
        offset, stride, count = self.sections[section]
        return numbers(layout, self.data, offset, count, stride)

    def file(self, index: int) -> bytes:
        offset, size, _ = self.rows("FILE", "<QQQ")[index]
        return self.data[offset : offset + size]

    def page(self, index: int) -> dict[tuple[int, int], Group]:
        """The page's groups by mesh and number."""
        offset, size, count, _ = self.pages[index]
        page = self.data[offset : offset + size]
        assert struct.unpack_from("<II", page) == (index, count)
        groups = {}
        for row in numbers("<8I5f2I", page, 16, count, 64):
            mesh, number, first, clusters, level, method, parents, references = row[:8]
            part = page[row[13] : row[13] + row[14]]
            made = self.part(part, mesh, clusters, references)
            groups[mesh, number] = Group(
                mesh, first, level, method, parents, row[8:12], row[12], *made
            )
        return groups

    def part(self, part: bytes, mesh: int, clusters: int, references: int) -> tuple:
        entry = self.meshes[mesh]
        attributes = self.attributes[entry[9] : entry[9] + entry[10]]
        low, high = np.array(entry[3:9], np.float64).reshape(2, 3)
        components = sum(a.components for a in attributes)
        refs = numbers("<IIIfffff", part, 0, references, 32)
        tables = tables_3 if self.major == 3 else tables_4
        ranges, records, begin = tables(part, components, clusters, references)
        borders, rows, made, boxes = Borders(), [], [], []
        for end, vertices, triangles, _, _, *box in records:
            bits = Bits(part[begin:end])
            walk = Walk(self.major, bits, vertices + 1, triangles + 1)
            first = len(rows)
            equal = borders.read_shared(bits, first, walk)
            if self.major == 3:
                read_vertices_3(bits, walk, attributes, ranges, rows, equal)
            else:
                twins = borders.read_twins(bits, equal)
                of = (self.major, bits, walk, attributes, ranges, rows, equal, twins)
                read_vertices(*of, borders.has_twins)
            assert 0 <= bits.left < 8
            assert bits.value == 0
            values = decode_values(np.array(rows[first:], np.int64), attributes)
            made.append({"triangles": np.array(walk.triangles), **values})
            q = np.array(box, np.float64).reshape(2, 3)
            boxes.append((low + (high - low) * (q / 65535)).astype(np.float32))
            begin = end
        made_from = [NONE if record[3] == 0xFFFF else refs[record[3]][0] for record in records]
        return refs, boxes, [record[4] for record in records], made_from, made
