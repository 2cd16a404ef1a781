"""Draws the figures of the documentation as SVG, from the formulas and the library that they show.

.venv/bin/python scripts/figures.py             # all, into docs/images
.venv/bin/python scripts/figures.py lod-dag -o /tmp
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from kmeans_figures import kmeans_lloyd, kmeans_passes
from svg_figure import COLORS, GREY, INK, PALE, WRONG, Figure, Point

# ---- clusters ----------------------------------------------------------------------------------


def legal_splits() -> Figure:
    """Which numbers of items may lie left of a split, by the rule of docs/clusters.md."""
    low, high, n = 6, 8, 40
    figure = Figure(720, 190, f"Feasible splits of {n} items into clusters of {low} to {high}")

    def feasible(items: int) -> bool:
        return items % low <= (high - low) * (items // low)

    left_side = [feasible(i) for i in range(n + 1)]
    right_side = left_side[::-1]
    rows = (
        ("left side", left_side, COLORS[4]),
        ("right side", right_side, COLORS[4]),
        ("both: legal", [a and b for a, b in zip(left_side, right_side, strict=True)], COLORS[2]),
    )
    left, step = 110.0, 14.5
    for row, (name, is_legal, color) in enumerate(rows):
        y = 20.0 + 40 * row
        figure.text((left - 12, y + 18), name, anchor="end")
        for i in range(1, n):
            figure.rect((left + step * i, y), (step - 2, 26), color if is_legal[i] else PALE)
    for i in range(0, n + 1, 4):
        figure.text((left + step * i + 6, 156), str(i), 12, GREY, "middle")
    figure.text((left, 180), f"items on the left of {n}, for clusters of {low} to {high}", 13, GREY)
    return figure


def underfill() -> Figure:
    """Items that two sides of a split lack to full clusters."""
    most, n, i = 4, 16, 11
    figure = Figure(720, 150, "Items that are missing to full clusters")
    size, x = 26.0, 20.0
    for side, items in enumerate((i, n - i)):
        clusters = -(-items // most)
        start = x
        for slot in range(clusters * most):
            is_there = slot < items
            figure.rect((x, 40), (size - 3, size), COLORS[side] if is_there else "white", INK)
            if not is_there:
                figure.cross((x + size / 2 - 1.5, 40 + size / 2))
            x += size + (8 if slot % most == most - 1 else 0)
        figure.text(
            (start, 28),
            f"{items} items: {items / most:g} clusters, {clusters * most - items} missing",
        )
        x += 26
        if side == 0:
            figure.line((x - 22, 14), (x - 22, 92), INK, 2, "5 4")
    missing = most * (-(-i // most) + -(-(n - i) // most)) - n
    figure.text(
        (20, 118),
        f"A split after {i} of {n} items, clusters of at most {most}: {missing} items are missing.",
    )
    figure.text((20, 138), "Each counts as underfill_cost items in its side's box.", 13, GREY)
    return figure


def cut_sweep() -> Figure:
    """The weight that every split of an order cuts, by one prefix sum."""
    links = [(0, 1), (0, 2), (1, 3), (2, 3), (2, 4), (3, 4), (5, 6), (4, 7), (6, 7), (6, 8), (7, 8)]
    links += [(7, 9), (8, 9), (9, 10), (10, 11)]
    n = 12
    figure = Figure(720, 330, "Connections cut at every position, by a prefix sum")
    x0, step, y = 60.0, 54.0, 120.0
    change = np.zeros(n, int)
    for a, b in links:
        change[a] += 1
        change[b] -= 1
        xa, xb = x0 + step * a, x0 + step * b
        height = 22.0 + 16 * (b - a)
        figure.path(
            f"M {xa:.1f} {y - 12:.1f} C {xa:.1f} {y - height:.1f} {xb:.1f} {y - height:.1f} "
            f"{xb:.1f} {y - 12:.1f}",
            GREY,
        )
    cuts = np.cumsum(change)[:-1]
    for i in range(n):
        figure.circle((x0 + step * i, y), 11, "white")
        figure.text((x0 + step * i, y + 4.5), str(i), 12, INK, "middle")
        figure.text((x0 + step * i, y + 44), f"{change[i]:+d}", 13, COLORS[0], "middle")
    figure.text((2, y + 44), "change", 12, COLORS[0])
    base = 300.0
    ratio = [cut * n * n / (4 * (i + 1) * (n - i - 1)) for i, cut in enumerate(cuts)]
    best = int(np.argmin(ratio))
    for i, cut in enumerate(cuts):
        x = x0 + step * (i + 0.5)
        color = COLORS[2] if i == best else COLORS[4]
        figure.rect((x - 12, base - 22 * float(cut)), (24, 22 * float(cut)), color)
        figure.text((x, base - 22 * float(cut) - 5), str(cut), 12, INK, "middle")
    figure.text((2, base - 5), "cut", 12, INK)
    figure.line((x0 - 20, base), (x0 + step * (n - 1) + 20, base), GREY)
    x = x0 + step * (best + 0.5)
    figure.line((x, 20), (x, base), COLORS[2], 2, "5 4")
    figure.text((x, 322), "least ratio cut", 12, COLORS[2], "middle")
    return figure


def clusters_on_mesh() -> Figure:
    """Clusters that the library makes of a flat mesh, each in a colour of its own."""
    import umbel

    random = np.random.default_rng(3)
    rows = 18
    grid = np.stack(np.meshgrid(np.arange(30.0), np.arange(float(rows))), -1).reshape(-1, 2)
    grid += random.uniform(-0.3, 0.3, grid.shape)
    grid[:, 0] += 2.5 * np.sin(grid[:, 1] / 6)
    corner = np.arange(30 * rows).reshape(rows, 30)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    faces = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (b, d, c))]).astype(
        np.uint32
    )
    positions = np.concatenate([grid, np.zeros((len(grid), 1))], 1).astype(np.float32)
    labels = umbel.cluster_mesh(umbel.Mesh(positions, faces), 64).labels()
    figure = Figure(720, 420, "Clusters of at most 64 triangles")
    scale = 21.4
    points = grid * scale + [45, 22]
    neighbours = _colored(labels, faces)
    for label, color in enumerate(neighbours):
        triangles = [points[face] for face in faces[labels == label]]
        outline = " ".join(
            "M" + " ".join(f"{x:.0f} {y:.0f}" for x, y in triangle) + "z" for triangle in triangles
        )
        figure.parts.append(f'<path d="{outline}" fill="{COLORS[color]}" stroke="white"/>')
    return figure


def _colored(labels: np.ndarray, faces: np.ndarray) -> list[int]:
    """A colour a cluster, other than those of clusters that share a vertex with it."""
    owners: dict[int, set[int]] = {}
    for face, label in zip(faces.tolist(), labels.tolist(), strict=True):
        for v in face:
            owners.setdefault(v, set()).add(label)
    near: dict[int, set[int]] = {}
    for shared in owners.values():
        for label in shared:
            near.setdefault(label, set()).update(shared - {label})
    colors: list[int] = []
    for label in range(int(labels.max()) + 1):
        taken = {colors[other] for other in near.get(label, ()) if other < label}
        free = [k for k in range(7) if k not in taken]
        colors.append(free[label % len(free)])
    return colors


# ---- levels of detail --------------------------------------------------------------------------

# Groups of each level as ranges of its clusters, finest first: each becomes half as many clusters
# of the next level, and groups of that take clusters from both sides of old borders.
_LEVELS = (((0, 4), (4, 8), (8, 12), (12, 16)), ((0, 2), (2, 6), (6, 8)), ((0, 4),), ((0, 2),))


def _parents(level: int, group: int) -> range:
    """The clusters of the next level that a group is simplified to."""
    begin, end = _LEVELS[level][group]
    return range(begin // 2, end // 2)


def _spot(level: int, cluster: int) -> Point:
    count = _LEVELS[level][-1][1]
    return 90.0 + (cluster + 0.5) * 600 / count, 330.0 - 92 * level


def _draw_dag(figure: Figure, drawn: Callable[[int, int], bool] | None) -> None:
    for level, groups in enumerate(_LEVELS):
        figure.text((14, _spot(level, 0)[1] + 5), f"level {level}", 13, GREY)
        for number, (begin, end) in enumerate(groups):
            color = COLORS[(number + 2 * level) % 6]
            xa, y = _spot(level, begin)
            xb = _spot(level, end - 1)[0]
            if level + 1 < len(_LEVELS):
                for child in _parents(level, number):
                    x, top = _spot(level + 1, child)
                    for cluster in range(begin, end):
                        figure.line((_spot(level, cluster)[0], y - 11), (x, top + 14), PALE, 1.2)
            figure.rect((xa - 17, y - 18), (xb - xa + 34, 36), "white", color)
            for cluster in range(begin, end):
                x = _spot(level, cluster)[0]
                shown = drawn is None or drawn(level, cluster)
                figure.rect((x - 11, y - 11), (22, 22), color if shown else PALE)


def lod_dag() -> Figure:
    """The DAG: groups of clusters, and the clusters that each is simplified to."""
    figure = Figure(720, 400, "Groups, and the clusters that they are simplified to")
    _draw_dag(figure, None)
    figure.text(
        (90, 388),
        "A frame is a group; the lines lead to the clusters that it is simplified to.",
        13,
        GREY,
    )
    return figure


def _refined(level: int, group: int) -> bool:
    """A view that wants detail on the left."""
    return level >= 2 or (level == 1 and group < 2) or (level == 0 and group < 1)


def _group_of(level: int, cluster: int) -> int:
    return next(g for g, (begin, end) in enumerate(_LEVELS[level]) if begin <= cluster < end)


def lod_cut() -> Figure:
    """A cut: a cluster is drawn if its group must be refined and its generating group need not."""

    def drawn(level: int, cluster: int) -> bool:
        if not _refined(level, _group_of(level, cluster)):
            return False
        if level == 0:
            return True
        made_by = next(
            g for g in range(len(_LEVELS[level - 1])) if cluster in _parents(level - 1, g)
        )
        return not _refined(level - 1, made_by)

    figure = Figure(720, 400, "A cut of the DAG")
    _draw_dag(figure, drawn)
    for level, groups in enumerate(_LEVELS):
        for number, (begin, _) in enumerate(groups):
            x, y = _spot(level, begin)
            words = "refine" if _refined(level, number) else "good enough"
            figure.text((x - 16, y + 31), words, 11, INK if _refined(level, number) else GREY)
    figure.text(
        (90, 392),
        "Coloured: the cut. Its group must be refined, the one that made it not.",
        13,
        GREY,
    )
    return figure


def locked_borders() -> Figure:
    """Borders between groups stay for one level and are simplified in the next."""
    figure = Figure(720, 290, "Locked borders of two levels")
    size, n = 26.0, 9
    for picture, (x0, cells) in enumerate(((30.0, 3), (400.0, 3))):
        shift = 0 if picture == 0 else 1.5
        step = size if picture == 0 else 1.5 * size
        count = round(n * size / step)
        for i in range(count + 1):
            figure.line((x0 + i * step, 20), (x0 + i * step, 20 + n * size), PALE)
            figure.line((x0, 20 + i * step), (x0 + n * size, 20 + i * step), PALE)
            if i < count:
                for j in range(count):
                    figure.line(
                        (x0 + i * step, 20 + (j + 1) * step),
                        (x0 + (i + 1) * step, 20 + j * step),
                        PALE,
                    )
        if picture == 1:
            for k in range(1, cells):
                at = k * cells * size
                figure.line((x0 + at, 20), (x0 + at, 20 + n * size), GREY, 1.5, "4 4")
                figure.line((x0, 20 + at), (x0 + n * size, 20 + at), GREY, 1.5, "4 4")
        for k in range(1, cells):
            at = (k * cells + shift) * size if picture == 0 else (k * cells - shift) * size
            figure.line((x0 + at, 20), (x0 + at, 20 + n * size), COLORS[5], 3)
            figure.line((x0, 20 + at), (x0 + n * size, 20 + at), COLORS[5], 3)
        figure.rect((x0, 20), (n * size, n * size), "none", INK)
    figure.text((30, 276), "level 0: groups with their borders, locked", 13)
    figure.text((400, 276), "level 1: new groups cross the old borders", 13)
    figure.line((286, 137), (376, 137), INK, 2)
    figure.polygon([(386, 137), (374, 131), (374, 143)], INK)
    return figure


def angular_error() -> Figure:
    """An error seen from the point of the group's sphere that is nearest to the eye."""
    figure = Figure(720, 280, "The angle that an error covers at most")
    eye, center, radius, error = (60.0, 150.0), (560.0, 150.0), 110.0, 38.0
    near = (center[0] - radius, center[1])
    figure.circle(center, radius, "#eef5fa", COLORS[0])
    figure.circle(near, error, "#fbe9dc", WRONG)
    distance = near[0] - eye[0]
    angle = math.asin(error / distance)
    for sign in (-1, 1):
        reach = math.sqrt(distance**2 - error**2)
        touch = (eye[0] + reach * math.cos(angle), eye[1] + sign * reach * math.sin(angle))
        figure.line(eye, touch, WRONG)
        figure.line(near, touch, WRONG, 1, "4 3")
    figure.line(eye, center, GREY, 1, "5 4")
    figure.circle(eye, 5, INK)
    figure.circle(near, 3, WRONG, WRONG)
    figure.circle(center, 3, COLORS[0], COLORS[0])
    figure.text((40, 182), "eye")
    figure.text((250, 168), "distance d", 13, GREY)
    figure.text((near[0] - 10, 92), "error e", 13, WRONG)
    figure.text((center[0] + 8, 144), "sphere of the group", 13, COLORS[0], "middle")
    x, y = eye[0] + 120 * math.cos(angle), 120 * math.sin(angle)
    figure.path(f"M {x:.1f} {eye[1] - y:.1f} A 120 120 0 0 1 {x:.1f} {eye[1] + y:.1f}", WRONG)
    figure.text((190, 132), "asin(e / d)", 13, WRONG)
    figure.text((60, 262), "d: to the nearest point of the sphere that holds the group", 13, GREY)
    return figure


def hierarchy() -> Figure:
    """One tree a level below a common root; a search leaves trees that are fine enough."""
    figure = Figure(720, 330, "The hierarchy, and where a search ends")
    root = (360.0, 36.0)
    trees = ((130.0, "level 2, coarse", 2), (340.0, "level 1", 4), (580.0, "level 0, fine", 8))
    ended = {(1, 1, 1), (2, 0, 0)}
    for number, (x, name, leaves) in enumerate(trees):
        spread = 18.0 * leaves + 12
        top = (x, 100.0)
        figure.line(root, top, GREY)
        stop = (number, 0, 0) in ended
        middle = [(x - spread / 3, 168.0), (x + spread / 3, 168.0)]
        for m, at in enumerate(middle):
            dead = stop or (number, 1, m) in ended
            figure.line(top, at, PALE if stop else GREY)
            for leaf in range(leaves // 2):
                offset = (leaf - (leaves // 2 - 1) / 2) * 34
                below = (at[0] + offset, 236.0)
                figure.line(at, below, PALE if dead else GREY)
                figure.rect(
                    (below[0] - 10, 228), (20, 20), PALE if dead else COLORS[number], "none"
                )
            figure.circle(at, 9, PALE if stop else "white", GREY if stop else INK)
            if dead and not stop:
                figure.cross(at)
        figure.circle(top, 10, "white")
        if stop:
            figure.cross(top)
        figure.text((x, 276), name, 13, INK, "middle")
    figure.circle(root, 11, "white")
    figure.text((20, 310), "Circles: spheres and errors of nodes. Squares: groups.", 13, GREY)
    figure.cross((400, 305))
    figure.text((414, 310), "all below is finer than needed: not visited", 13, GREY)
    return figure


FIGURES: dict[str, Callable[[], Figure]] = {
    "clusters-legal-splits": legal_splits,
    "clusters-underfill": underfill,
    "clusters-cut-sweep": cut_sweep,
    "clusters-on-mesh": clusters_on_mesh,
    "builders-kmeans-lloyd": kmeans_lloyd,
    "builders-kmeans-passes": kmeans_passes,
    "lod-dag": lod_dag,
    "lod-cut": lod_cut,
    "lod-locked-borders": locked_borders,
    "lod-angular-error": angular_error,
    "lod-hierarchy": hierarchy,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="all of them by default")
    parser.add_argument("-o", "--output", type=Path, default=Path("docs/images"))
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    for name in given.names or FIGURES:
        (given.output / f"{name}.svg").write_text(FIGURES[name]().svg(), encoding="utf-8")


if __name__ == "__main__":
    main()
