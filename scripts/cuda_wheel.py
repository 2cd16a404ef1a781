#!/usr/bin/env python3
"""Makes the wheel umbel-cuda, which has the library for CUDA devices and nothing else; the package
umbel finds it there. CUDA's and C++'s runtimes are linked statically; oneTBB is that of the wheel
tbb, which umbel needs as well.

    CUDA_ARCHS="75-real 80-real 86-real 89-real 90" make cuda
    scripts/cuda_wheel.py [--library build/release/libumbel_cuda_c.so] [-o build/wheels]
"""

import argparse
import base64
import hashlib
import platform
import re
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
NAME = "umbel_cuda"
LIBRARY = "libumbel_cuda_c.so"
INIT = '"""The library of umbel.cuda for CUDA devices: umbel loads it from this folder."""\n'


def metadata(project: dict[str, str]) -> str:
    needed = [f"umbel == {project['version']}", project["tbb"]]
    lines = [
        "Metadata-Version: 2.1",
        "Name: umbel-cuda",
        f"Version: {project['version']}",
        "Summary: The library of umbel.cuda for CUDA devices",
        f"License: {project['license']}",
        f"Requires-Python: {project['requires-python']}",
        *(f"Requires-Dist: {line}" for line in needed),
    ]
    return "\n".join(lines) + "\n"


def project_fields() -> dict[str, str]:
    """What both packages share. Python 3.10 has no reader of TOML."""
    text = (ROOT / "pyproject.toml").read_text()
    named = {
        name: re.search(rf'^{name} = "(.*)"$', text, re.MULTILINE)
        for name in ("version", "license", "requires-python")
    }
    named["tbb"] = re.search(r'^  "(tbb >=.*)",$', text, re.MULTILINE)
    return {name: found[1] for name, found in named.items() if found}


def without_build_paths(library: bytes) -> bytes:
    """Its RUNPATH names the folders of a wheel first (cmake/UmbelCuda.cmake), and then those of the
    machine that built it, which no other machine should look at."""
    return re.sub(
        rb"(\$ORIGIN/\.\./\.\./\.\.:\$ORIGIN/\.\./\.\./\.\./\.\./lib)(:[^\0]*)(?=\0)",
        lambda found: found[1] + bytes(len(found[2])),
        library,
    )


def write_wheel(library: Path, folder: Path) -> Path:
    project = project_fields()
    tag = f"py3-none-linux_{platform.machine()}"
    info = f"{NAME}-{project['version']}.dist-info"
    files = {
        f"{NAME}/__init__.py": INIT.encode(),
        f"{NAME}/{LIBRARY}": without_build_paths(library.read_bytes()),
        f"{info}/METADATA": metadata(project).encode(),
        f"{info}/WHEEL": (
            f"Wheel-Version: 1.0\nGenerator: umbel\nRoot-Is-Purelib: false\nTag: {tag}\n"
        ).encode(),
        f"{info}/LICENSE": (ROOT / "LICENSE").read_bytes(),
    }
    record = [f"{name},{digest(data)},{len(data)}" for name, data in files.items()]
    files[f"{info}/RECORD"] = "\n".join([*record, f"{info}/RECORD,,", ""]).encode()
    folder.mkdir(parents=True, exist_ok=True)
    wheel = folder / f"{NAME}-{project['version']}-{tag}.whl"
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            # The same bytes for the same library.
            archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return wheel


def digest(data: bytes) -> str:
    return "sha256=" + base64.urlsafe_b64encode(hashlib.sha256(data).digest()).decode().rstrip("=")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    built = ROOT / "build" / "release" / LIBRARY
    parser.add_argument("--library", type=Path, default=built)
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "build" / "wheels")
    options = parser.parse_args()
    if not options.library.is_file():
        parser.error(f"there is no {options.library}: `make cuda` builds it")
    print(write_wheel(options.library, options.output))


if __name__ == "__main__":
    main()
