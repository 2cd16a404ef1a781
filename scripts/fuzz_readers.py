"""Fuzzes the readers of mesh files that are Python (ply, stl, gltf, glb) and the one of OBJ through
them, guided by what they cover: any bytes are read, or refused with a sentence that names the file,
within five seconds and two gigabytes.

    scripts/fuzz_readers.py [--seconds 60] [--only ply] [--build build/fuzz]

Inputs that fail lie in build/fuzz/failures, what is learned stays in build/fuzz/corpus, and
tests/fuzz/corpus/reader_FORMAT has what was found before.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import re
import subprocess
import sys
import tempfile
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FORMATS = ("ply", "stl", "obj", "gltf", "glb")
#: Words that mean something to a format, so that not each has to be found letter by letter.
WORDS = {
    "ply": "ply format ascii binary_little_endian binary_big_endian 1.0 element property list "
    "vertex face vertex_indices uchar int float double uint8 int32 float64 x y z end_header",
    "stl": "solid facet normal outer loop vertex endloop endfacet endsolid",
    "obj": "v vt vn f usemtl mtllib l p g o s // / -1 1 0.5 #",
    "gltf": "",
    "glb": "",
}
GLTF_WORDS = (
    "asset version accessors bufferView byteOffset componentType count type SCALAR VEC3 sparse "
    "indices values bufferViews buffer byteLength byteStride buffers uri meshes primitives "
    "attributes POSITION NORMAL TEXCOORD_0 mode material nodes mesh children matrix scenes scene "
    "extensions EXT_meshopt_compression KHR_draco_mesh_compression EXT_mesh_gpu_instancing"
)


def seeds(kind: str, folder: Path) -> None:
    """Files to begin with: those that the tests break."""
    sys.path.insert(0, str(ROOT / "tests" / "python"))
    from helpers.broken_files import SOURCES

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name, make in SOURCES[kind].items():
            (folder / name).write_bytes(make(folder))
    for left_over in folder.glob("source.*"):
        left_over.unlink()


def dictionary(kind: str, path: Path) -> None:
    words = (WORDS[kind] or GLTF_WORDS).split()
    path.write_text("".join(f'"{word}"\n' for word in words))


def fuzz(kind: str, arguments: list[str]) -> None:
    """Runs in a process of its own, which libFuzzer ends."""
    import atheris

    with atheris.instrument_imports(include=["umbel.io", "umbel.geometry"]):
        import umbel
        import umbel.io.gltf.reader
        import umbel.io.obj.reader
        import umbel.io.ply.reader
        import umbel.io.stl
    # A file of this name is written again and again, so it had better be in memory.
    memory = Path("/dev/shm")
    folder = tempfile.mkdtemp(prefix="umbel-fuzz-", dir=memory if memory.is_dir() else None)
    path = Path(folder) / f"a.{kind}"
    warnings.simplefilter("ignore")

    def one(data: bytes) -> None:
        path.write_bytes(data)
        try:
            umbel.validate(umbel.load(path))
        except umbel.Error as error:
            if str(path) not in str(error):
                raise AssertionError(f"a refusal names no file: {error}") from error

    atheris.Setup([sys.argv[0], *arguments], one)
    atheris.Fuzz()


def run(kind: str, seconds: int, build: Path) -> bool:
    """Fuzzes one format; prints how that went."""
    corpus, failures = build / "corpus" / f"reader_{kind}", build / "failures"
    for folder in (corpus, failures):
        folder.mkdir(parents=True, exist_ok=True)
    seeds(kind, corpus)
    words = build / f"reader_{kind}.dict"
    dictionary(kind, words)
    kept = ROOT / "tests" / "fuzz" / "corpus" / f"reader_{kind}"
    command = [sys.executable, __file__, "--child", kind, f"-max_total_time={seconds}"]
    command += ["-timeout=20", "-rss_limit_mb=2048", "-max_len=20000", "-print_final_stats=1"]
    if "SEED" in os.environ:
        command.append(f"-seed={os.environ['SEED']}")
    command += [f"-dict={words}", f"-artifact_prefix={failures}/reader_{kind}-", str(corpus)]
    command += [str(kept)] if kept.is_dir() else []
    log = build / f"reader_{kind}.log"
    with log.open("w") as out:
        status = subprocess.run(command, stdout=out, stderr=subprocess.STDOUT, check=False)
    text = log.read_text(errors="replace")
    if status.returncode == 0:
        units = re.search(r"number_of_executed_units: *(\d+)", text)
        count = units[1] if units else "no"
        print(f"fuzz: reader_{kind}: {count} inputs in {seconds} s, no failure", flush=True)
        return True
    print(text[-4000:], file=sys.stderr)
    print(
        f"fuzz: reader_{kind}: failed; the log is {log}, the input lies in {failures}", flush=True
    )
    return False


def main() -> int:
    if sys.argv[1:2] == ["--child"]:
        fuzz(sys.argv[2], sys.argv[3:])
        return 0
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("--seconds", type=int, default=int(os.environ.get("SECONDS_EACH", "60")))
    parser.add_argument("--only", choices=FORMATS, action="append")
    parser.add_argument("--jobs", type=int, default=1, help="formats at a time")
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "fuzz")
    given = parser.parse_args()
    for needed in ("atheris", "umbel"):
        if importlib.util.find_spec(needed) is None:
            print(f"fuzz: readers: left out, {needed} is not here (make setup, on Linux)")
            return 0
    with ThreadPoolExecutor(max(given.jobs, 1)) as pool:
        good = pool.map(lambda kind: run(kind, given.seconds, given.build), given.only or FORMATS)
        return 0 if all(list(good)) else 1


if __name__ == "__main__":
    sys.exit(main())
