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

ROOT = Path(__file__).resolve().parent.parent
DATA = Path(os.environ.get("UMBEL_DATA") or ROOT.parent / "shared" / "data")
IMAGES = ROOT / "docs" / "images"
LARGEST = 400_000  # bytes

#: The file, and what its picture is made with beside the size.
PICTURES = {
    "dragon": "dragon_871k.ply --ground --camera auto:12,8:24 --sun 60,28 --spp 64",
    "car": "car_lamborghini.glb --ground --camera auto:-12,9:26 --sun 200,40 --spp 64",
    "tokyo": "littlest_tokyo.glb --ground --hide outline --camera auto:38,15:28 --sun 70,40 "
    "--clamp 2 --spp 320",
    "sponza": "sponza_dabrovic_66k.obj --camera=-9.5,1.6,-0.4:4,4,0.1:75 --sun 40,66 "
    "--clamp 4 --spp 384",
}
SIZE = "--width 880 --height 550"


def make(name: str) -> None:
    """Renders one picture and says by which command."""
    file, *options = PICTURES[name].split()
    options += SIZE.split()
    print(f"umbel render {file} -o {name}.png {' '.join(options)}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        png = Path(folder) / f"{name}.png"
        command = [Path(sys.executable).parent / "umbel", "render", DATA / file, "-o", png]
        subprocess.run([str(word) for word in [*command, *options]], check=True, stdout=sys.stderr)
        save_jpeg(png, IMAGES / f"{name}.jpg")


def save_jpeg(png: Path, out: Path) -> None:
    """As good as fits."""
    out.parent.mkdir(parents=True, exist_ok=True)
    with Image.open(png) as image:
        for quality in range(92, 40, -4):
            image.save(out, quality=quality, optimize=True, progressive=True)
            if out.stat().st_size <= LARGEST:
                return


def main() -> None:
    """Makes those that are named, or all."""
    unknown = [name for name in sys.argv[1:] if name not in PICTURES]
    if unknown:
        sys.exit(f"pictures: there is no {unknown[0]}, only {', '.join(PICTURES)}")
    for name in sys.argv[1:] or PICTURES:
        make(name)


if __name__ == "__main__":
    main()
