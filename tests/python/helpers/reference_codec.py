"""Decodes the clusters of `.umbel` files by docs/format.md alone, for reference_reader.py."""

from dataclasses import dataclass

from helpers.reference_uvs import predict_uvs, signed


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

    def coded(self, k: int, kind: int) -> int:
        """The code of a parameter and a kind: rice, golomb, or either with 0 apart."""
        q = self.zeros(16)
        if q == 16:
            return self.take(32)
        if kind >= 2:
            if q == 0:
                return 0
            q -= 1
        below = 2**k * (2**q - 1 if kind % 2 else q)
        return (kind >= 2) + below + self.take(k + q if kind % 2 else k)

    def below(self, count: int) -> int:
        value = self.take(max(count - 1, 0).bit_length())
        assert value < count
        return value


@dataclass
class Attribute:
    flag: int
    set: int
    coding: int
    components: int
    smooth: int
    bits: int
    step: float


# The words for each apex: where neither of the edges (b, c) and (c, a) is a gate, the first is, the
# second, or both; empty where there is no word.
APEXES = {
    "new": ("00011", "0010", "0011", "1"),
    "from": ("", "00010", "", "011"),
    "into": ("", "", "00001", "010"),
    "named": ("00000001", "00000010", "00000011", "000001"),
    "nothing": ("00000000", "", "", ""),
}
BORDER_APEXES = {
    "new": ("01", "10", "11", "001"),
    "from": ("", "000010", "", "000011"),
    "into": ("", "", "00010", "00011"),
    "named": ("0000001", "0000010", "0000011", "00000001"),
    "nothing": ("00000000", "", "", ""),
}
WORDS, BORDER_WORDS = (
    {
        word: (apex, gates & 1, gates >> 1)
        for apex, words in apexes.items()
        for gates, word in enumerate(words)
        if word
    }
    for apexes in (APEXES, BORDER_APEXES)
)


class Walk:
    """The triangles of a cluster, and from which vertices each vertex is predicted."""

    def __init__(self, major: int, bits: Bits, vertices: int, triangles: int):
        self.major, self.bits, self.seen, self.next = major, bits, 0, 0
        self.words = BORDER_WORDS if major > 5 and bits.take(1) else WORDS
        self.closing: set[int] = set()
        self.triangles: list[tuple[int, int, int]] = []
        self.parents: list[tuple[int, int, int]] = []
        self.gates: list[tuple[int, int, int]] = []
        self.border: list[tuple[int, int]] = []
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

    def pass_edge(self, x: int, y: int, w: int, is_gate: int) -> None:
        gate = self.begins.get(x)
        if gate is None or self.gates[gate][1] != y:
            gate = self.ends.get(y)
        if gate is not None and self.gates[gate][0] == x:
            self.close(gate)
        elif is_gate:
            self.begins[y] = self.ends[x] = len(self.gates)
            self.open.add(len(self.gates))
            self.gates.append((y, x, w))
        else:
            self.border.append((x, y))

    def start(self) -> None:
        take, below = self.bits.take, self.bits.below
        new = self.major > 5 and take(1) == 1
        a, b, c = (self.new_after_last() if new or take(1) else below(self.seen) for _ in range(3))
        if new:
            self.closing.add(c)
        self.triangles.append((a, b, c))
        for edge in ((a, b, c), (b, c, a), (c, a, b)):
            self.pass_edge(*edge, take(1))

    def cross(self, a: int, b: int, across: int) -> None:
        word = ""
        while word not in self.words:
            word += str(self.bits.take(1))
        apex, right, left = self.words[word]
        if apex == "nothing":
            return
        if apex == "new":
            c = self.new(a, b, across)
        elif apex == "from":
            c = self.gates[self.begins[b]][1]
        elif apex == "into":
            c = self.gates[self.ends[a]][0]
        else:
            c = self.bits.below(self.seen)
        self.triangles.append((a, b, c))
        self.pass_edge(b, c, a, right)
        self.pass_edge(c, a, b, left)


class Borders:
    """The borders of a group's clusters, whose vertices are numbered one after the other."""

    def __init__(self) -> None:
        self.next: dict[int, int] = {}
        self.previous: dict[int, int] = {}
        self.vertices: list[int] = []
        self.last: list[int] = []
        self.has_twins = False

    def add(self, first: int, walk: Walk) -> list[int]:
        """The next cluster's border vertices."""
        for x, y in walk.border:
            self.next[first + x] = first + y
            self.previous[first + y] = first + x
        mine = range(first, first + walk.seen)
        return [v for v in mine if v in self.next or v in self.previous]

    def read_shared(self, bits: Bits, first: int, walk: Walk) -> dict[int, int]:
        """The vertices of the next cluster that earlier ones have, and which those are."""
        equal: dict[int, int] = {}
        mine = self.add(first, walk)
        if bits.take(1):
            for v in mine:
                if v not in equal and bits.take(1):
                    equal[v] = self.vertices[bits.below(len(self.vertices))]
                    for ahead, back in ((self.next, self.previous), (self.previous, self.next)):
                        w, u = ahead.get(v), back.get(equal[v])
                        while w is not None and u is not None and w not in equal and bits.take(1):
                            equal[w] = u
                            w, u = ahead.get(w), back.get(u)
        self.vertices += mine
        self.last = mine
        return equal

    def read_twins(self, bits: Bits, equal: dict[int, int]) -> dict[int, int]:
        """The last cluster's vertices at the position of an earlier vertex, and that vertex."""
        twins: dict[int, int] = {}
        others = self.vertices[: len(self.vertices) - len(self.last)]
        self.has_twins = bits.take(1) == 1
        if self.has_twins:
            for i, v in enumerate(self.last):
                if v in equal or v in twins or not bits.take(1):
                    continue
                choice = self.last[:i] if bits.take(1) else others
                twins[v] = choice[bits.below(len(choice))]
                for ahead, back in ((self.next, self.previous), (self.previous, self.next)):
                    w, u = ahead.get(v), back.get(twins[v])
                    while w is not None and u is not None and w != u:
                        if max(w, u) in equal or max(w, u) in twins or not bits.take(1):
                            break
                        twins[max(w, u)] = min(w, u)
                        w, u = ahead.get(w), back.get(u)
        return twins


def predict_normals(
    triangles: list[tuple[int, int, int]], positions: list[list[int]], shift: int, steps: int
) -> list[tuple[int, int, bool]]:
    """Octahedral integers of vertices by their triangles, and whether they are in the lower half,
    which is not folded out."""
    sums = [[0, 0, 0] for _ in positions]
    for triangle in triangles:
        a, b, c = (positions[v] for v in triangle)
        e, f = ([signed(q - p) >> shift for p, q in zip(a, end, strict=True)] for end in (b, c))
        for v in triangle:
            for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
                sums[v][i] = signed(sums[v][i] + e[j] * f[k] - e[k] * f[j])
    normals = []
    for x, y, z in sums:
        length = float(abs(x) + abs(y) + abs(z))
        scale = steps / length if length > 0 else 0.0
        u, v = (int(i * scale + (steps + 1.5)) - (steps + 1) for i in (x, y))
        normals.append((u, v, z < 0))
    return normals


def fold(u: int, v: int, steps: int) -> tuple[int, int]:
    x, y = steps - abs(v), steps - abs(u)
    return signed(-x if u < 0 else x), signed(-y if v < 0 else y)


def remainder_of(bits: Bits, k: int, kind: int = 0) -> int:
    r = 0 if k == 31 else bits.coded(k, kind)
    return r // 2 if r % 2 == 0 else -(r + 1) // 2


def predict(attribute: Attribute, damping: int, a: int, b: int, across: int) -> int:
    if attribute.smooth:
        return (a + b) // 2
    return a + b - across - damping * (a + b - 2 * across) // 16


class Cluster:
    """Reads the vertices of a cluster into the rows of its group, attribute by attribute."""

    def __init__(
        self,
        major: int,
        bits: Bits,
        walk: Walk,
        rows: list,
        equal: dict,
        twins: dict,
        has_twins: bool,
    ):
        self.major, self.has_twins = major, has_twins
        self.bits, self.walk, self.rows, self.equal, self.twins = bits, walk, rows, equal, twins
        self.base = len(rows)
        self.damping = bits.take(2)
        self.own = [v for v in range(walk.seen) if self.base + v not in equal]
        mine = range(self.base, self.base + walk.seen)
        rows += [list(rows[equal[v]]) if v in equal else [] for v in mine]

    def read(self, attribute: Attribute, at: int, ranges: list) -> None:
        take, rows, base = self.bits.take, self.rows, self.base
        if not any(width for _, width in ranges):
            for v in self.own:
                rows[base + v] += [lowest for lowest, _ in ranges]
            return
        ruled = all_twins = at == 0
        if at > 0 and self.has_twins and take(1):
            ruled, all_twins = True, take(1) == 1
        is_octahedral = (attribute.flag, attribute.set, attribute.coding) == (1, 0, 2)
        geometric = is_octahedral and take(1) == 1
        steps, normals, starts = 2 ** (attribute.bits - 1) - 1, [], False
        if geometric:
            positions = [row[:3] for row in rows[base:]]
            normals = predict_normals(self.walk.triangles, positions, take(4), steps)
        is_uvs = (attribute.flag, attribute.coding, attribute.smooth) == (4, 1, 0)
        small = all(low >= -(2**26) and low + 2**width <= 2**26 for low, width in ranges)
        mapped = self.major > 5 and is_uvs and len(ranges) == 2 and small and take(1) == 1
        mirrored = mapped and take(1) == 1
        if not geometric:
            starts = take(1) == 1
        kinds = self.major > 4 and take(1) == 1
        codes = []
        for _, width in ranges:
            usual = self.code(kinds) if width > 0 or geometric else (31, 0)
            start = self.code(kinds) if starts and width > 0 else usual
            codes.append((usual, start))
        for v in self.own:
            row, twin = rows[base + v], self.twins.get(base + v)
            if twin is not None and ruled and (all_twins or take(1)):
                row += rows[twin][at : at + len(ranges)]
            elif geometric:
                u, w, lower = normals[v]
                u = signed(u + remainder_of(self.bits, *codes[0][0]))
                w = signed(w + remainder_of(self.bits, *codes[1][0]))
                row += fold(u, w, steps) if lower else (u, w)
            elif v == 0:
                row += [signed(lowest + take(width)) for lowest, width in ranges]
            else:
                parents = self.walk.parents[v]
                start = parents[0] == parents[1]
                if mapped:
                    mine = [row[:3] + row[at : at + 2] for row in rows[base : base + v + 1]]
                    expected = predict_uvs(mine, parents, v, v in self.walk.closing, mirrored)
                else:
                    three = [rows[base + parent][at : at + len(ranges)] for parent in parents]
                    values = zip(*three, strict=True)
                    expected = [predict(attribute, self.damping, *of) for of in values]
                for value, code in zip(expected, codes, strict=True):
                    row.append(signed(value + remainder_of(self.bits, *code[start])))

    def code(self, has_kind: bool) -> tuple[int, int]:
        k = self.bits.take(5)
        kind = self.bits.take(2) if has_kind and k != 31 else 0
        assert k < 16 or k == 31 or kind % 2 == 0
        return k, kind


def read_vertices(
    major: int,
    bits: Bits,
    walk: Walk,
    attributes: list[Attribute],
    ranges: list,
    rows: list[list[int]],
    equal: dict[int, int],
    twins: dict[int, int],
    has_twins: bool,
) -> None:
    """Appends the integers of a cluster's vertices to those of its group."""
    cluster, at = Cluster(major, bits, walk, rows, equal, twins, has_twins), 0
    for attribute in attributes:
        cluster.read(attribute, at, ranges[at : at + attribute.components])
        at += attribute.components


def read_vertices_3(
    bits: Bits,
    walk: Walk,
    attributes: list[Attribute],
    ranges: list,
    rows: list[list[int]],
    equal: dict[int, int],
) -> None:
    """The same, of version 3: vertex by vertex."""
    of = [a for a in attributes for _ in range(a.components)]
    damping, parameters, values = bits.take(2), [], []
    base = len(rows)
    for lowest, width in ranges:
        parameters.append(bits.take(5))
        values.append(0 if base in equal else signed(lowest + bits.take(width)))
    rows.append(rows[equal[base]] if base in equal else values)
    for v in range(base + 1, base + walk.seen):
        if v in equal:
            rows.append(rows[equal[v]])
            continue
        a, b, across = (rows[base + parent] for parent in walk.parents[v - base])
        row = []
        for i, k in enumerate(parameters):
            predicted = predict(of[i], damping, a[i], b[i], across[i])
            row.append(signed(predicted + remainder_of(bits, k)))
        rows.append(row)
