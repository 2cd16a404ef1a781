"""Makes the pictures in docs/images again: `umbel render` on real meshes, results as JPEG files.

    .venv/bin/python scripts/pictures.py [NAME...]

The meshes are looked for in the folder $UMBEL_DATA, else in ../shared/data beside the repository.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

from umbel import Asset

ROOT = Path(__file__).resolve().parent.parent
DATA = Path(os.environ.get("UMBEL_DATA") or ROOT.parent / "shared" / "data")
IMAGES = ROOT / "docs" / "images"
LARGEST = 400_000  # bytes

#: The file, and what its picture is made with beside the size.
PICTURES = {
    "dragon": "dragon_871k.ply --ground --camera auto:12,8:24 --sun 60,28 --spp 64 --denoise",
    "car": "car_lamborghini.glb --ground --camera auto:-12,9:26 --sun 200,40 --spp 64 --denoise",
    "tokyo": "littlest_tokyo.glb --ground --hide outline --camera auto:38,15:28 --sun 70,40 "
    "--spp 64 --denoise",
    "sponza": "sponza_dabrovic_66k.obj --camera=-9.5,1.6,-0.4:4,4,0.1:75 --sun 40,66 "
    "--spp 96 --denoise",
    "chess": "textured/chess-board.glb --ground --camera=-251.7,140.1,-343.5:-14,-4,-4:21 "
    "--sun 150,40 --spp 64 --denoise",
    "cat": "textured/cat.glb --ground --camera=2.05,0.9,4.51:0.08,0.45,-0.06:15 --sun 70,40 "
    "--spp 64 --denoise",
}
SIZE = "--width 880 --height 550"

#: The same of meshes beside their cuts with a tenth of the triangles.
PAIRS = {
    "lod_athena": "statue_athena_uv_normals.ply --camera auto:20,5:24 --sun 60,40 --spp 64",
    "lod_car": "car_lamborghini.glb --ground --camera auto:-12,9:26 --sun 200,40 --spp 64",
    "lod_tokyo": "littlest_tokyo.glb --ground --hide outline --camera auto:38,15:28 --sun 70,40 "
    "--clamp 2 --spp 96",
}
PAIR_SIZE = "--width 600 --height 500"


def umbel(*words: str | Path) -> None:
    """Runs the command, and says which."""
    names = [word.name if isinstance(word, Path) else word for word in words]
    print("umbel", *names, flush=True)
    command = [Path(sys.executable).parent / "umbel", *words]
    subprocess.run([str(word) for word in command], check=True, stdout=sys.stderr)


def picture(name: str, folder: Path) -> Image.Image:
    """One mesh."""
    file, *options = PICTURES[name].split()
    png = folder / f"{name}.png"
    umbel("render", DATA / file, "-o", png, *options, *SIZE.split())
    return Image.open(png)


def pair(name: str, folder: Path) -> Image.Image:
    """One mesh, and to the right of it the finest cut with at most a tenth of its triangles."""
    file, *options = PAIRS[name].split()
    asset, cut = folder / "mesh.umbel", folder / "cut.glb"
    umbel("build", DATA / file, "-o", asset)
    opened = Asset(asset)
    most = len(opened.mesh(opened.cut(level=0)).triangles) // 10
    umbel("extract", asset, "-o", cut, "--triangles", str(most))
    both = []
    for mesh in (DATA / file, cut):
        png = folder / f"{mesh.stem}.png"
        umbel("render", mesh, "-o", png, *options, *PAIR_SIZE.split())
        both.append(Image.open(png))
    joined = Image.new("RGB", (both[0].width + both[1].width, both[0].height))
    joined.paste(both[0], (0, 0))
    joined.paste(both[1], (both[0].width, 0))
    return joined


def save_jpeg(image: Image.Image, out: Path) -> None:
    """As good as fits."""
    out.parent.mkdir(parents=True, exist_ok=True)
    for quality in range(92, 40, -4):
        image.save(out, quality=quality, optimize=True, progressive=True)
        if out.stat().st_size <= LARGEST:
            return


def main() -> None:
    """Makes those that are named, or all."""
    names = [*PICTURES, *PAIRS]
    unknown = [name for name in sys.argv[1:] if name not in names]
    if unknown:
        sys.exit(f"pictures: there is no {unknown[0]}, only {', '.join(names)}")
    for name in sys.argv[1:] or names:
        with tempfile.TemporaryDirectory() as folder:
            make = picture if name in PICTURES else pair
            save_jpeg(make(name, Path(folder)), IMAGES / f"{name}.jpg")


if __name__ == "__main__":
    main()
