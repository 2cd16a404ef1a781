"""Runs every check of `make lint`, or with --fix what can be put right by itself.

All checks run, whatever the ones before them say; the exit status is 1 if any failed.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TOOLS = Path(sys.executable).parent
COMPILE_COMMANDS = ROOT / "build" / "release" / "compile_commands.json"
TIDY_COMMANDS = ROOT / "build" / "tidy" / "compile_commands.json"
CPP_SUFFIXES = (".cpp", ".hpp", ".cu", ".cuh", ".h")
SIMT_INCLUDES = ("tests/simt/kernels/", "tests/simt/device_tests/", "tests/simt/exec_tests.cpp")
TEST_FOLDERS = ("tests/", "bench/")
RECENT_COMMITS = 40
PYTHON = ["python", "scripts", "tests", "viewer/tests"]


def output_of(*command: str) -> list[str]:
    """The lines that a command prints; none if it fails."""
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    return done.stdout.splitlines() if done.returncode == 0 else []


def run(*command: str | Path) -> bool:
    """Runs a command that speaks for itself; whether it succeeded."""
    return subprocess.run([str(part) for part in command], cwd=ROOT, check=False).returncode == 0


def repository_files() -> list[str]:
    """Everything that is committed or could be."""
    listed = output_of("git", "ls-files", "--cached", "--others", "--exclude-standard")
    return sorted(path for path in set(listed) if (ROOT / path).is_file())


def cpp_files() -> list[str]:
    """The repository's C++ and CUDA files."""
    return [path for path in repository_files() if path.endswith(CPP_SUFFIXES)]


def changed_files() -> set[str]:
    """What differs from the branch that this one will go into, committed or not."""
    base = next(iter(output_of("git", "merge-base", "HEAD", "origin/HEAD")), "HEAD")
    committed = output_of("git", "diff", "--name-only", base)
    return set(committed) | set(output_of("git", "ls-files", "--others", "--exclude-standard"))


def recent_files() -> set[str]:
    """All of the library, and the tests and benchmarks that the last commits changed: the others
    would take as long again."""
    log = ["git", "log", f"--max-count={RECENT_COMMITS}", "--name-only", "--format="]
    recent = changed_files() | set(output_of(*log))
    return {path for path in cpp_files() if path in recent or not path.startswith(TEST_FOLDERS)}


def clang_format(fix: bool) -> bool:
    """Formatting of the C++ sources."""
    mode = ["-i"] if fix else ["--dry-run", "--Werror"]
    files = cpp_files()
    return not files or run(TOOLS / "clang-format", *mode, *files)


def ruff(fix: bool) -> bool:
    """Formatting and lint of the Python sources."""
    folders = [folder for folder in PYTHON if (ROOT / folder).is_dir()]
    check = run(TOOLS / "ruff", "check", *(["--fix"] if fix else []), *folders)
    return run(TOOLS / "ruff", "format", *([] if fix else ["--check"]), *folders) and check


def mypy() -> bool:
    """Types of the Python package, seen together with the stub of its extension module."""
    stub = ROOT / "build" / "release" / "python" / "umbel" / "_umbel.pyi"
    if not stub.is_file():
        print(f"there is no {stub.relative_to(ROOT)}: run `make setup` first")
        return False
    merged = ROOT / "build" / "mypy" / "umbel"
    shutil.rmtree(merged, ignore_errors=True)
    merged.mkdir(parents=True)
    for source in [*stub.parent.glob("*.pyi"), *(ROOT / "python" / "umbel").iterdir()]:
        (merged / source.name).symlink_to(source)
    command = [TOOLS / "mypy", "--python-executable", sys.executable]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    print((done.stdout + done.stderr).replace("build/mypy/", "python/"), end="")
    return done.returncode == 0


def layers() -> bool:
    """The order of the folders of src/."""
    return run(sys.executable, ROOT / "scripts" / "check_layers.py")


def device_code() -> bool:
    """What device code must not call."""
    return run(sys.executable, ROOT / "scripts" / "check_device_code.py")


def viewer(fix: bool) -> bool:
    """Formatting, lint and types of the web viewer."""
    return run(ROOT / "scripts" / "node.sh", "format" if fix else "lint")


def tidy_one(source: str) -> tuple[str, bool, str]:
    """clang-tidy on one source file: its name, whether it is clean, what was said."""
    # A build's -Werror would make findings of Clang's own warnings, in the standard library too.
    command = [TOOLS / "clang-tidy", "--quiet", "--warnings-as-errors=*", "--extra-arg=-Wno-error"]
    command += ["-p", TIDY_COMMANDS.parent, source]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    return source, done.returncode == 0, done.stdout if done.stdout.strip() else done.stderr


def tidy_entries() -> list[dict[str, str]]:
    """The build's commands, one a source file, without precompiled headers: each file must include
    what it uses."""
    entries = []
    for entry in json.loads(COMPILE_COMMANDS.read_text(encoding="utf-8")):
        command = re.sub(r"-Winvalid-pch -include \S*/cmake_pch\.hxx ", "", entry["command"])
        unity = Path(entry["file"])
        if unity.parent.name != "Unity":
            entries.append({**entry, "command": command})
            continue
        # Of several sources that the build compiles as one. Clang does not know the warning that
        # GCC is told not to give there.
        command = command.replace(" -Wno-subobject-linkage", "")
        for source in re.findall(r'#include "(.*)"', unity.read_text(encoding="utf-8")):
            own = command.replace(entry["file"], source)
            entries.append({"directory": entry["directory"], "command": own, "file": source})
    return entries


def clang_tidy(sources: Iterable[str]) -> bool:
    """clang-tidy on those of the sources that are compiled, on all cores."""
    if not COMPILE_COMMANDS.is_file():
        print(f"there is no {COMPILE_COMMANDS.relative_to(ROOT)}: run `make build` first")
        return False
    entries = tidy_entries()
    TIDY_COMMANDS.parent.mkdir(parents=True, exist_ok=True)
    TIDY_COMMANDS.write_text(json.dumps(entries, indent=1), encoding="utf-8")
    paths = (Path(entry["directory"], entry["file"]).resolve() for entry in entries)
    compiled = {str(path.relative_to(ROOT)) for path in paths if path.is_relative_to(ROOT)}
    wanted = sorted(compiled & set(sources))
    clean = True
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for source, passed, said in pool.map(tidy_one, wanted):
            if not passed:
                clean = False
                print(f"-- {source}\n{said}")
    print(f"{len(wanted)} files")
    return clean


def main() -> int:
    """Runs the checks and sums them up."""
    parser = argparse.ArgumentParser(description=__doc__)
    tidied_files = parser.add_mutually_exclusive_group()
    tidied_files.add_argument("--all", action="store_true", help="clang-tidy on all files")
    tidied_files.add_argument(
        "--recent",
        action="store_true",
        help="clang-tidy on all but tests that no recent commit changed",
    )
    parser.add_argument("--fix", action="store_true", help="format instead of checking")
    options = parser.parse_args()

    checks: dict[str, Callable[[], bool]] = {
        "clang-format": lambda: clang_format(options.fix),
        "ruff": lambda: ruff(options.fix),
        "viewer": lambda: viewer(options.fix),
    }
    if not options.fix:
        checks["layers"] = layers
        checks["device code"] = device_code
        checks["mypy"] = mypy
        tidied = changed_files()
        if options.all or options.recent:
            tidied = set(cpp_files()) if options.all else recent_files()
        # Only CUDA's compiler reads those, and what tests/simt makes of them GCC's.
        tidied = {path for path in tidied if not path.endswith(".cu")}
        tidied = {path for path in tidied if not path.startswith(SIMT_INCLUDES)}
        checks["clang-tidy"] = lambda: clang_tidy(tidied)

    failed = []
    for name, check in checks.items():
        print(f"== {name}", flush=True)
        started = time.monotonic()
        if not check():
            failed.append(name)
        print(f"   {'failed' if name in failed else 'ok'}, {time.monotonic() - started:.1f} s")
    if failed:
        print(f"lint: failed: {', '.join(failed)}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
