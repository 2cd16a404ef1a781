"""Makes docs/images/heatmaps.jpg again: how many boxes of clusters each pixel's ray pierces, on one
scale, for several clusterings of a mesh at rest and bent.

    .venv/bin/python scripts/heatmaps.py [MESH [OUT.jpg]]
"""

import argparse
import importlib.util
import os
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import umbel
from umbel.bench.clusters import MAX_TRIANGLES, methods
from umbel.geometry.arrays import native

ROOT = Path(__file__).resolve().parent.parent
DATA = Path(os.environ.get("UMBEL_DATA") or ROOT.parent / "shared" / "data")
WIDTH, HEIGHT, HEADER, SIDE = 440, 330, 26, 26
METHODS = ["quality", "Morton", "meshoptimizer Spatial v128"]
#: Of the scale: the few pixels above are white.
PERCENTILE = 99.8


def example():
    """The example whose mesh is bent."""
    path = ROOT / "examples" / "python" / "5_deforming.py"
    spec = importlib.util.spec_from_file_location("deforming", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def clusters(mesh: umbel.Mesh) -> dict[str, umbel.Clusters]:
    """By each method that this installation has."""
    from umbel.cluster.clusters import clusters_of

    made = {}
    for method in methods(1):
        if method.name in METHODS:
            items, ranges, _ = method.make(native(mesh))
            offsets = np.append(ranges[:, 0], ranges[-1].sum())
            made[method.name] = clusters_of(mesh, items, offsets, MAX_TRIANGLES)
    return {name: made[name] for name in METHODS if name in made}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("mesh", nargs="?", default=str(DATA / "dragon_871k.ply"))
    parser.add_argument("out", nargs="?", default=str(ROOT / "docs" / "images" / "heatmaps.jpg"))
    options = parser.parse_args()
    deforming = example()
    mesh = umbel.load(options.mesh)
    rest, size = deforming.unit_scaled(mesh.positions)
    bent = deforming.deformed(rest, size, 0.5)
    poses = {
        name: umbel.Mesh(positions=positions, triangles=mesh.triangles)
        for name, positions in (("rest", rest), ("bent", bent))
    }
    cameras = {
        name: umbel.Renderer(pose).view("auto", WIDTH, HEIGHT) for name, pose in poses.items()
    }
    kept, rebuilt = clusters(poses["rest"]), clusters(poses["bent"])
    rows = {
        "at rest": ("rest", kept),
        "bent, clusters kept": ("bent", kept),
        "bent, clustered again": ("bent", rebuilt),
    }
    counts = {
        (row, name): umbel.boxes_per_pixel(
            umbel.cluster_boxes(poses[pose], made), cameras[pose], WIDTH, HEIGHT
        )
        for row, (pose, by_name) in rows.items()
        for name, made in by_name.items()
    }
    most = max(int(np.percentile(c[c > 0], PERCENTILE)) for c in counts.values())
    print(f"scale: 0 to {most} boxes")
    for (row, name), c in counts.items():
        print(f"{row:22}{name:28} mean {c[c > 0].mean():6.2f}  most {c.max():4}")
    draw_all(Path(options.out), counts, list(rows), list(kept), most)


def draw_all(out: Path, counts: dict, rows: list[str], columns: list[str], most: int) -> None:
    """All on one scale, with their names and the mean over what they cover."""
    picture = Image.new("RGB", (SIDE + WIDTH * len(columns), (HEADER + HEIGHT) * len(rows) + 40))
    draw = ImageDraw.Draw(picture)
    font = ImageFont.load_default(size=15)
    for y, row in enumerate(rows):
        top = y * (HEADER + HEIGHT)
        for x, name in enumerate(columns):
            c = counts[row, name]
            picture.paste(Image.fromarray(umbel.heatmap(c, most)), (SIDE + x * WIDTH, top + HEADER))
            text = f"{row}: {name}, {c[c > 0].mean():.1f}"
            draw.text((SIDE + x * WIDTH, top + 5), text, font=font, fill=(255, 255, 255))
    low = (HEADER + HEIGHT) * len(rows) + 12
    bar = umbel.heatmap(np.tile(np.linspace(0, most, 400), (14, 1)), most)
    picture.paste(Image.fromarray(bar), (SIDE + 30, low))
    draw.text((SIDE, low - 2), "0", font=font, fill=(255, 255, 255))
    draw.text((SIDE + 440, low - 2), f"{most} boxes", font=font, fill=(255, 255, 255))
    picture.save(out, quality=82, optimize=True)


if __name__ == "__main__":
    main()
