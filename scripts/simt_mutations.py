"""Leaves out each barrier, fence and release of the device's code in turn, and shows which tests
notice it.

    scripts/simt_mutations.py [--seeds 4] [--only PART_OF_A_PLACE,...] [-o TABLE.md]

Nothing is compiled again: the emulated device (tests/simt) passes over a place if it is told the
place's address. Build umbel_simt_tests_tsan with `make simt` first. The exit status is 1 if
something is left out and nobody notices.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
HOW = {66: "a race", 70: "threads that wait in vain", 1: "other bytes", 124: "no end"}


def run(program: Path, test: str, seed: int, limit: float = 300, **variables: str) -> int:
    """The exit status of one test with one seed; 124 if it runs longer than `limit` seconds."""
    environment = {**os.environ, "FIRST_SEED": str(seed), "SEEDS": "1", **variables}
    try:
        return subprocess.run(
            [program, f"--gtest_filter={test}"],
            env=environment,
            capture_output=True,
            check=False,
            timeout=limit,
        ).returncode
    except subprocess.TimeoutExpired:
        return 124


def tests_of(program: Path) -> list[str]:
    listed = subprocess.run(
        [program, "--gtest_list_tests"], capture_output=True, text=True, check=True
    ).stdout
    tests, suite = [], ""
    for line in listed.splitlines():
        if line.startswith("  "):
            tests.append(suite + line.strip())
        elif line.endswith("."):
            suite = line
    return [test for test in tests if "OnDevice" in test and not test.startswith("Larger")]


def place_of(library: Path, address: str) -> str:
    """Where the code asks to wait: in device_team.cuh only what is not asked for by a caller."""
    lines = subprocess.run(
        ["addr2line", "-i", "-e", library, address], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    frames = [Path(line.split(" ")[0]) for line in lines]
    inner = [str(f).split("/src/", 1)[1] for f in frames if "/src/" in str(f)]
    kept = inner or [str(frames[-1])]
    # A team's sync() and an arrival stand for their callers.
    while len(kept) > 1 and (is_line(kept[0], "sync() const") or "base/exec.hpp" in kept[0]):
        kept.pop(0)
    return kept[0]


def is_line(place: str, text: str) -> bool:
    path, line = place.rsplit(":", 1)
    return text in (ROOT / "src" / path).read_text().splitlines()[int(line) - 1]


def find_sites(
    program: Path, library: Path, tests: list[str]
) -> tuple[dict[tuple[str, str], set[str]], dict[tuple[str, str], list[tuple[float, str]]]]:
    """The addresses of each place, and the tests that get there with how long they take."""
    addresses: dict[tuple[str, str], set[str]] = defaultdict(set)
    reached: dict[tuple[str, str], dict[str, float]] = defaultdict(dict)
    places: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        for test in tests:
            path, start = Path(folder) / "sites", time.monotonic()
            path.unlink(missing_ok=True)
            status = run(program, test, 1, SIMT_SITES=str(path))
            if status != 0:
                sys.exit(f"{test} fails by itself: {status}")
            for line in path.read_text().splitlines() if path.exists() else []:
                kind, address = line.split()
                if address not in places:
                    places[address] = place_of(library, address)
                site = (places[address], kind)
                addresses[site].add(address)
                reached[site][test] = time.monotonic() - start
    return addresses, {
        site: sorted((seconds, test) for test, seconds in by.items())
        for site, by in reached.items()
    }


def notice(
    program: Path, skipped: set[str], tests: list[tuple[float, str]], seeds: int
) -> tuple[str, str] | None:
    for seed in range(1, seeds + 1):
        for seconds, test in tests:
            # A test that goes on for ten times its own time does not end.
            limit = max(30, 10 * seconds)
            status = run(program, test, seed, limit, SIMT_SKIP=",".join(sorted(skipped)))
            if status != 0:
                return HOW.get(status, f"status {status}"), f"{test}, seed {seed}"
    return None


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "release")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--only", default="", help="parts of places (path:line), with commas")
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    program = options.build / "umbel_simt_tests_tsan"
    library = options.build / "libumbel_simt_tsan.so"
    addresses, reached = find_sites(program, library, tests_of(program))
    rows = ["| left out | where | noticed as | by |", "|---|---|---|---|"]
    print("\n".join(rows), flush=True)
    missed = 0
    for place, kind in sorted(addresses):
        if not any(part in place for part in options.only.split(",")):
            continue
        site = (place, kind)
        noticed = notice(program, addresses[site], reached[site], options.seeds)
        how, by = noticed or ("**nothing**", "")
        missed += noticed is None
        rows.append(f"| {kind} | {place} | {how} | {by} |")
        print(rows[-1], flush=True)
    if options.output:
        options.output.write_text("\n".join(rows) + "\n")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
