"""Draws docs/images/vulkan-deforming.png from what umbel_vulkan_deform has measured.

.venv/bin/python scripts/vulkan_deform_chart.py FOLDER/deform.csv [OUT.png]
"""

import csv
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

ROOT = Path(__file__).resolve().parent.parent
STEPS = ("cluster", "blas", "tlas", "rays")


def main() -> None:
    source = Path(sys.argv[1])
    out = Path(sys.argv[2]) if len(sys.argv) > 2 else ROOT / "docs/images/vulkan-deforming.png"
    with source.open() as file:
        rows = list(csv.DictReader(file))
    ways = list(dict.fromkeys(row["way"] for row in rows))
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4))
    for way in ways:
        values = [float(row["area_ratio"]) for row in rows if row["way"] == way]
        left.plot(values, label=way, linewidth=1.4)
    left.set_xlabel("frame")
    left.set_ylabel("clusters that a random line intersects")
    left.set_ylim(bottom=0)
    left.legend(fontsize=8)
    left.grid(alpha=0.3)
    before = [0.0] * len(ways)
    for step in STEPS:
        sums = []
        for way in ways:
            values = [float(row[step]) for row in rows if row["way"] == way]
            sums.append(sum(values) / len(values))
        right.barh(ways, sums, left=before, label=step)
        before = [a + b for a, b in zip(before, sums, strict=True)]
    right.set_xlabel("milliseconds a frame")
    right.invert_yaxis()
    right.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(out, dpi=100)


if __name__ == "__main__":
    main()
