"""What measurements make together: total times of pictures, ratios to the full sweep, and which
builder is the fastest for how many samples."""

from __future__ import annotations

from collections.abc import Sequence

from umbel.bench.bvh.columns import BASELINE
from umbel.bench.table import Row

LQ, HQ = 8, 128


def normalised(rows: Sequence[Row]) -> list[Row]:
    """The rows with their total times, and with ratios to the full sweep of the same scene and
    width, whose build counts as nothing."""
    baseline = {(row["scene"], row["width"]): row for row in rows if row["builder"] == BASELINE}
    found = []
    for row in rows:
        to = baseline[row["scene"], row["width"]]
        made = row["build_seconds"] + row["widen_seconds"]
        found.append(
            {
                **row,
                "lq_seconds": made + LQ * row["sample_seconds"],
                "hq_seconds": made + HQ * row["sample_seconds"],
                "sah_ratio": _ratio(row["sah_cost"], to["sah_cost"]),
                "epo_ratio": _ratio(row["epo"], to["epo"]),
                "speed_ratio": row["mrays_per_second"] / to["mrays_per_second"],
                "lq_ratio": _total_ratio(row, to, LQ),
                "hq_ratio": _total_ratio(row, to, HQ),
            }
        )
    return found


def _ratio(value: float | None, to: float | None) -> float | None:
    return value / to if value is not None and to else None


def _total_ratio(row: Row, to: Row, samples: int) -> float:
    # The idealised sweep is not slowed down by its build; that of the row's own sweep is.
    made = 0.0 if row is to else row["build_seconds"] + row["widen_seconds"]
    ratio: float = (made + samples * row["sample_seconds"]) / (samples * to["sample_seconds"])
    return ratio


def cheapest(rows: Sequence[Row]) -> list[Row]:
    """For each scene and width the builders that make a picture soonest for some number of samples
    a pixel, and from which number, and how many rays, on: the lower envelope of
    build + samples * trace."""
    groups: dict[tuple[str, int], list[Row]] = {}
    for row in rows:
        groups.setdefault((row["scene"], row["width"]), []).append(row)
    found = []
    for (name, width), group in groups.items():
        lines = [
            (row["build_seconds"] + row["widen_seconds"], row["sample_seconds"], row["builder"])
            for row in group
        ]
        start, best = 0.0, min(lines)
        while True:
            found.append(
                {
                    "scene": name,
                    "width": width,
                    "builder": best[2],
                    "from_samples": start,
                    "from_mrays": start * group[0]["sample_rays"] * 1e-6,
                }
            )
            later = [
                ((line[0] - best[0]) / (best[1] - line[1]), line[1], line)
                for line in lines
                if line[1] < best[1]
            ]
            if not later:
                break
            start, _, best = min(later)
    return found
