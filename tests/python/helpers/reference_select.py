"""Selection as docs/selection.md specifies it, in NumPy's 32-bit floats, one operation at a time.
Shares no code with the library."""

from __future__ import annotations

from typing import Any

import numpy as np

F = np.float32
NONE = 0xFFFFFFFF
MAX = np.finfo(F).max


def f(value: float | None) -> Any:
    return F(np.inf) if value is None else F(value)


def length(x: Any, y: Any, z: Any) -> Any:
    square = (x * x + y * y) + z * z
    if F(2.0**-100) <= square <= MAX:
        return np.sqrt(square)
    scale = F(2.0**96) if square < F(2.0**-100) else F(2.0**-96)
    x, y, z = x * scale, y * scale, z * scale
    return np.sqrt((x * x + y * y) + z * z) * (F(1) / scale)


def distance(sphere: Any, eye: Any) -> Any:
    x, y, z = (f(c) - f(e) for c, e in zip(sphere[:3], eye, strict=True))
    return max(min(length(x, y, z), MAX) - f(sphere[3]), F(0))


def too_large(sphere: Any, error: float | None, view: dict[str, Any]) -> bool:
    if error is None:
        return True
    if view["kind"] == "error":
        return bool(f(error) > f(view["error"]))
    return bool(f(error) > f(view["threshold"]) * distance(sphere, view["eye"]))


def side(plane: Any, p: Any) -> Any:
    n = [f(v) for v in plane]
    return ((n[0] * p[0] + n[1] * p[1]) + n[2] * p[2]) + n[3]


class Selector:
    def __init__(self, tables: dict[str, Any], case: dict[str, Any]) -> None:
        self.tables, self.view, self.planes = tables, case["view"], case["planes"]
        self.facing = tables["facing"] if case["facing"] else None

    def refine(self, g: int) -> bool:
        group = self.tables["groups"][g]
        if self.view["kind"] == "level":
            return bool(group[2] >= self.view["level"] or group[8] is None)
        return too_large(group[4:8], group[8], self.view)

    def sphere_outside(self, sphere: Any, slack: Any) -> bool:
        c = [f(v) for v in sphere[:3]]
        for plane in self.planes:
            n = [f(v) for v in plane]
            s = side(plane, c)
            if slack:
                size = ((abs(n[0] * c[0]) + abs(n[1] * c[1])) + abs(n[2] * c[2])) + abs(n[3])
                s = s + slack * size
            if s < -f(sphere[3]):
                return True
        return False

    def visible(self, c: int) -> bool:
        low, high = self.tables["clusters"][c][5:8], self.tables["clusters"][c][8:11]
        for plane in self.planes:
            corner = [f(high[i] if plane[i] >= 0 else low[i]) for i in range(3)]
            if side(plane, corner) < 0:
                return False
        if self.facing is None:
            return True
        row = self.facing[c]
        x, y, z = (f(a) - f(e) for a, e in zip(row[:3], self.view["eye"], strict=True))
        along = (x * f(row[7]) + y * f(row[8])) + z * f(row[9])
        return not along >= f(row[10]) * length(x, y, z) + f(row[3])

    def clusters_of(self, g: int) -> list[int]:
        first, count = self.tables["groups"][g][:2]
        found = []
        for c in range(first, first + count):
            made_from = self.tables["clusters"][c][1]
            if (made_from == NONE or not self.refine(made_from)) and self.visible(c):
                found.append(c)
        return found

    def shown(self, g: int) -> bool:
        return self.refine(g) and not self.sphere_outside(self.tables["groups"][g][4:8], None)

    def flat(self) -> list[int]:
        groups = range(len(self.tables["groups"]))
        return sorted(c for g in groups if self.shown(g) for c in self.clusters_of(g))

    def hierarchy(self) -> list[int]:
        cut, stack = [], [0]
        while stack:
            node = self.tables["nodes"][stack.pop()]
            if node[5] != NONE:
                if self.shown(node[5]):
                    cut += self.clusters_of(node[5])
            elif (
                self.view["kind"] == "level" or too_large(node[:4], node[4], self.view)
            ) and not self.sphere_outside(node[:4], F(2.0**-20)):
                stack += range(node[6], node[6] + node[7])
        return sorted(cut)
