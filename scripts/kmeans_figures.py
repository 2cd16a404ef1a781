"""What the passes of the k-means builder do (Meister & Bittner 2016), in the plane."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from svg_figure import COLORS, GREY, INK, PALE, Figure, Point

Floats = NDArray[np.float64]
Rows = Sequence[Sequence[int]]

_CROWDS = ((0.0, 0.2, 0.9, 90), (4.2, 0.6, 0.6, 80), (1.9, 2.4, 0.5, 70), (5.6, 2.7, 0.7, 80))
"""Middles, deviations and numbers of the boxes that are clustered."""
_K, _P, _ITERATIONS = 4, 5, 4


def _boxes(seed: int, share: float) -> Floats:
    """(n, 4): the least x and y and the greatest ones, y downwards."""
    dice = np.random.default_rng(seed)
    middles = np.concatenate(
        [dice.normal((x, y), s, (round(n * share), 2)) for x, y, s, n in _CROWDS]
    )
    half = dice.uniform(0.04, 0.16, middles.shape) / share**0.4
    return np.concatenate([middles - half, middles + half], axis=1)


class _Panel:
    """A part of a figure that shows boxes, scaled to fit."""

    def __init__(self, figure: Figure, at: Point, size: Point, boxes: Floats) -> None:
        self.figure = figure
        low, high = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
        self._scale = float((np.array(size) / (high - low)).min())
        self._origin = np.array(at) + (np.array(size) - (high - low) * self._scale) / 2
        self._low = low

    def spot(self, point: Floats) -> Point:
        x, y = self._origin + (point - self._low) * self._scale
        return float(x), float(y)

    def fill(self, boxes: Floats, color: str) -> None:
        """Many boxes as one path."""
        parts = []
        for box in boxes:
            (a, b), (c, d) = self.spot(box[:2]), self.spot(box[2:])
            parts.append(f"M{a:.1f} {b:.1f}h{c - a:.1f}v{d - b:.1f}h{a - c:.1f}z")
        look = f'fill="{color}" fill-opacity="0.75" stroke="white" stroke-width="0.5"'
        self.figure.parts.append(f'<path d="{"".join(parts)}" {look}/>')

    def outline(self, box: Floats, color: str, width: float = 1.5, dash: str = "") -> None:
        (a, b), (c, d) = self.spot(box[:2]), self.spot(box[2:])
        path = f"M {a:.1f} {b:.1f} H {c:.1f} V {d:.1f} H {a:.1f} Z"
        self.figure.path(path, color, width, dash)


# ---- one division ------------------------------------------------------------------------------


def _distances(boxes: Floats, representatives: Floats) -> Floats:
    """(n, k): |min - min|^2 + |max - max|^2, which is that of boxes as points of a space with
    twice as many dimensions."""
    squares: Floats = ((boxes[:, None] - representatives[None]) ** 2).sum(axis=2)
    return squares


def kmeans_lloyd() -> Figure:
    """The seeds of a cluster, and Lloyd's loop."""
    boxes = _boxes(7, 0.2)
    figure = Figure(720, 470, "How k-means divides a cluster of boxes")
    places = [(20.0 + 236 * (i % 3), 30.0 + 232 * (i // 3)) for i in range(6)]
    size = (206.0, 176.0)
    for number, (place, name) in enumerate(
        zip(
            places,
            (
                "distance of two boxes",
                f"seeding: {_P} candidates",
                f"k = {_K} representatives",
                "assignment: to the nearest",
                "update: to the mean",
                f"after {_ITERATIONS} iterations",
            ),
            strict=True,
        )
    ):
        figure.text((place[0], place[1] - 10), f"{number + 1}. {name}", 12.5)
    panels = [_Panel(figure, place, size, boxes) for place in places[1:]]
    _draw_distance(figure, places[0])

    dice = np.random.default_rng(4)
    seeds = [boxes[int(dice.integers(len(boxes)))]]
    while len(seeds) < _K:
        tried = boxes[dice.choice(len(boxes), _P, replace=False)]
        nearest = _distances(tried, np.array(seeds)).min(axis=1)
        if len(seeds) == 2:
            _draw_seeding(panels[0], boxes, np.array(seeds), tried, int(nearest.argmax()))
        seeds.append(tried[nearest.argmax()])
    means = np.array(seeds)
    panels[1].fill(boxes, GREY)
    _draw_representatives(panels[1], means)
    for iteration in range(_ITERATIONS):
        labels = _distances(boxes, means).argmin(axis=1)
        moved = np.array([boxes[labels == k].mean(axis=0) for k in range(_K)])
        if iteration == 0:
            _draw_labels(panels[2], boxes, labels)
            _draw_representatives(panels[2], means)
            _draw_labels(panels[3], boxes, labels)
            for old, new in zip(means, moved, strict=True):
                figure.line(panels[3].spot(_middle(old)), panels[3].spot(_middle(new)), INK, 1.5)
            _draw_representatives(panels[3], moved)
        means = moved
    labels = _distances(boxes, means).argmin(axis=1)
    _draw_labels(panels[4], boxes, labels)
    _draw_representatives(panels[4], means)
    for k in range(_K):
        panels[4].outline(_hull(boxes[labels == k]), COLORS[k], 2)
    return figure


def _middle(box: Floats) -> Floats:
    return (box[:2] + box[2:]) / 2


def _hull(boxes: Floats) -> Floats:
    return np.concatenate([boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)])


def _draw_distance(figure: Figure, at: Point) -> None:
    x, y = at
    first, second = ((x + 14, y + 66), (84, 88)), ((x + 84, y + 26), (100, 74))
    for (low, size), color in ((first, COLORS[0]), (second, COLORS[1])):
        figure.rect(low, size, "none", color)
    ends = [(low, (low[0] + size[0], low[1] + size[1])) for low, size in (first, second)]
    for a, b in zip(*ends, strict=True):
        figure.line(a, b, INK, 1.5, "5 3")
        figure.circle(a, 3, INK)
        figure.circle(b, 3, INK)
    figure.text((x - 4, y + 36), "|min - min|²", 12)
    figure.text((x + 130, y + 148), "|max - max|²", 12)
    figure.text((x + 84, y + 172), "their sum", 12, GREY)


def _draw_seeding(
    panel: _Panel, boxes: Floats, seeds: Floats, tried: Floats, farthest: int
) -> None:
    panel.fill(boxes, PALE)
    nearest = _distances(tried, seeds).argmin(axis=1)
    for i, (box, near) in enumerate(zip(tried, nearest, strict=True)):
        ends = panel.spot(_middle(box)), panel.spot(_middle(seeds[near]))
        is_kept = i == farthest
        panel.figure.line(*ends, COLORS[5] if is_kept else GREY, 2 if is_kept else 1, "4 3")
    panel.fill(tried, GREY)
    panel.fill(tried[farthest : farthest + 1], COLORS[5])
    panel.figure.text(_beside(panel, tried[farthest]), "farthest: kept", 12, COLORS[5])
    _draw_representatives(panel, seeds)


def _beside(panel: _Panel, box: Floats) -> Point:
    x, y = panel.spot(np.array([box[2], box[1]]))
    return x + 6, y - 4


def _draw_labels(panel: _Panel, boxes: Floats, labels: NDArray[np.int64]) -> None:
    for k in range(_K):
        panel.fill(boxes[labels == k], COLORS[k])


def _draw_representatives(panel: _Panel, representatives: Floats) -> None:
    for k, box in enumerate(representatives):
        panel.outline(box, INK, 2)
        panel.figure.circle(panel.spot(_middle(box)), 4, COLORS[k])


# ---- all passes --------------------------------------------------------------------------------


def kmeans_passes() -> Figure:
    """The clusters that the library makes in each pass from the top, and the binary tree."""
    from umbel.accel.trees import build_kary

    boxes = _boxes(5, 1.0)
    solid = np.zeros((len(boxes), 6), np.float32)
    solid[:, [0, 1, 3, 4]] = boxes
    tree = build_kary(solid, clusters=_K, candidates=_P, iterations=3, max_leaf_size=8)
    nodes, primitives = tree.nodes, np.array(tree.primitives)
    levels = _levels(nodes)
    figure = Figure(720, 600, "The passes of the k-means builder")
    for number in range(1, 4):
        x, y = 20 + 360.0 * ((number - 1) % 2), 34 + 300.0 * ((number - 1) // 2)
        figure.text((x, y - 12), f"pass {number}: {_clusters(nodes, levels, number)} clusters")
        panel = _Panel(figure, (x, y), (320, 160), boxes)
        for shown, (node, family) in enumerate(_shown(nodes, levels, number)):
            color = COLORS[family] if number == 1 else COLORS[shown % 7]
            panel.fill(boxes[primitives[_range(nodes, node)]], color)
            if number < 3:
                panel.outline(_box_of(nodes[node]), color, 2)
        _draw_kary(figure, (x, y + 178), nodes, levels, number)
    _draw_agglomeration(figure, (380.0, 334.0), boxes, nodes, levels)
    return figure


def _levels(nodes: NDArray[np.void]) -> list[list[int]]:
    levels = [[0]]
    while levels[-1]:
        children = [
            int(nodes[n]["first"]) + c for n in levels[-1] for c in range(nodes[n]["children"])
        ]
        levels.append(children)
    return levels[:-1]


def _clusters(nodes: NDArray[np.void], levels: Rows, number: int) -> int:
    return len(_shown(nodes, levels, number))


def _shown(nodes: NDArray[np.void], levels: Rows, number: int) -> list[tuple[int, int]]:
    """The clusters after so many passes, leaves of earlier ones too, and from which of the first
    pass each comes."""
    found: list[tuple[int, int]] = []

    def visit(node: int, depth: int, family: int) -> None:
        if depth == number or not nodes[node]["children"]:
            found.append((node, family))
            return
        for c in range(nodes[node]["children"]):
            visit(int(nodes[node]["first"]) + c, depth + 1, c if depth == 0 else family)

    visit(0, 0, 0)
    return found


def _range(nodes: NDArray[np.void], node: int) -> slice:
    """The primitives below a node, which are one after the other."""
    first = last = node
    while nodes[first]["children"]:
        first = int(nodes[first]["first"])
    while nodes[last]["children"]:
        last = int(nodes[last]["first"]) + int(nodes[last]["children"]) - 1
    begin = int(nodes[first]["first"])
    return slice(begin, int(nodes[last]["first"]) + int(nodes[last]["count"]))


def _box_of(node: np.void) -> Floats:
    return np.array([*node["min"][:2], *node["max"][:2]], np.float64)


def _draw_kary(
    figure: Figure, at: Point, nodes: NDArray[np.void], levels: Rows, number: int
) -> None:
    """The tree down to a level, each node in the middle of its children."""
    x, y = at
    spots: dict[int, Point] = {}
    below = [node for node, _ in _shown(nodes, levels, number)]
    step = 320.0 / len(below)
    for depth in range(number, -1, -1):
        for node in levels[depth]:
            if node in below:
                spots[node] = x + step * (below.index(node) + 0.5), y + 26.0 * depth
            else:
                first = int(nodes[node]["first"])
                ends = [spots[first + c][0] for c in range(nodes[node]["children"])]
                spots[node] = (ends[0] + ends[-1]) / 2, y + 26.0 * depth
    for depth in range(number):
        for node in levels[depth]:
            for c in range(nodes[node]["children"]):
                child = spots[int(nodes[node]["first"]) + c]
                figure.line(spots[node], child, GREY, 1)
    for depth in range(number + 1):
        for node in levels[depth]:
            color = COLORS[below.index(node) % 7] if node in below else "white"
            figure.circle(spots[node], 5 if len(levels[depth]) < 20 else 2.2, color)


def _draw_agglomeration(
    figure: Figure, at: Point, boxes: Floats, nodes: NDArray[np.void], levels: Rows
) -> None:
    """The clusters of the first pass joined in pairs, those of the least area first."""
    x, y = at
    figure.text((x, y - 12), "then: the children of each cluster, joined in pairs")
    panel = _Panel(figure, (x, y), (320, 160), boxes)
    panel.fill(boxes, PALE)
    live = {k: _box_of(nodes[node]) for k, node in enumerate(levels[1])}
    order: dict[int, list[int]] = {k: [k] for k in live}
    for k, box in live.items():
        panel.outline(box, COLORS[k], 2)
    joins = []
    for step in range(_K - 1):
        pairs = [(a, b) for a in live for b in live if a < b]
        a, b = min(pairs, key=lambda pair: _area(_hull(np.array([live[k] for k in pair]))))
        made = _K + step
        live[made] = _hull(np.array([live.pop(a), live.pop(b)]))
        order[made] = order[a] + order[b]
        joins.append((a, b))
        if step < _K - 2:
            panel.outline(live[made], INK, 1.5, "5 3")
    spots: dict[int, Point] = {}
    for slot, k in enumerate(order[max(order)]):
        spots[k] = x + 320.0 / _K * (slot + 0.5), y + 256.0
    for step, (a, b) in enumerate(joins):
        up = y + 256.0 - 26 * (step + 1)
        spots[_K + step] = (spots[a][0] + spots[b][0]) / 2, up
        for end in (a, b):
            figure.line(spots[_K + step], spots[end], GREY, 1)
    for k, spot in spots.items():
        figure.circle(spot, 5, COLORS[k] if k < _K else "white")


def _area(box: Floats) -> float:
    return float(np.prod(box[2:] - box[:2]))
