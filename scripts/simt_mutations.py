"""Leaves out each barrier, fence and release of the device's code in turn, and shows which tests
notice it.

    scripts/simt_mutations.py [--seeds 4] [--only PART_OF_A_PLACE,...] [-o TABLE.md]

Nothing is compiled again: the emulated device (tests/simt) passes over a place if it is told the
place's address. Build the programs with `make simt` first. The exit status is 1 if
something is left out and nobody notices.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from dataclasses import dataclass, field
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
    return [
        test for test in tests if "OnDevice" in test and not test.startswith(("AnySize", "Larger"))
    ]


def place_of(library: Path, address: str) -> str | None:
    """Where the code asks to wait: in device_team.cuh only what is not asked for by a caller. None
    where a test asks."""
    lines = subprocess.run(
        ["addr2line", "-i", "-e", library, address], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    for line in lines:
        frame = line.split(" ")[0]
        if "/tests/simt/" in frame:
            continue
        if "/src/" not in frame:
            return None
        place = frame.split("/src/", 1)[1]
        # A team's sync() and an arrival stand for their callers.
        if not is_line(place, "sync() const") and "base/exec.hpp" not in place:
            return place
    return None


def is_line(place: str, text: str) -> bool:
    path, line = place.rsplit(":", 1)
    return text in (ROOT / "src" / path).read_text().splitlines()[int(line) - 1]


@dataclass
class Site:
    """A place that waits: where it is in one program, and the tests that get there."""

    program: Path
    addresses: set[str] = field(default_factory=set)
    tests: dict[str, float] = field(default_factory=dict)
    """With how long they take."""


def find_sites(program: Path, library: Path, tests: list[str]) -> dict[tuple[str, str], Site]:
    """The sites of each place and kind of waiting."""
    sites: dict[tuple[str, str], Site] = {}
    places: dict[str, str | None] = {}
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
                place = places[address]
                if place is None:
                    continue
                site = sites.setdefault((place, kind), Site(program))
                site.addresses.add(address)
                site.tests[test] = time.monotonic() - start
    return sites


def notice(site: Site, seeds: int) -> tuple[str, str] | None:
    for seed in range(1, seeds + 1):
        for test, seconds in sorted(site.tests.items(), key=lambda pair: pair[1]):
            # A test that goes on for ten times its own time does not end.
            limit = max(30, 10 * seconds)
            skipped = ",".join(sorted(site.addresses))
            status = run(site.program, test, seed, limit, SIMT_SKIP=skipped)
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
    # The executor's tests have their kernels in themselves.
    executor = options.build / "umbel_simt_exec_tests_tsan"
    algorithms = options.build / "umbel_simt_tests_tsan"
    sites: dict[tuple[str, str], list[Site]] = defaultdict(list)
    for program, library in (
        (executor, executor),
        (algorithms, options.build / "libumbel_simt_tsan.so"),
    ):
        for at, site in find_sites(program, library, tests_of(program)).items():
            sites[at].append(site)
    rows = ["| left out | where | noticed as | by |", "|---|---|---|---|"]
    print("\n".join(rows), flush=True)
    missed = 0
    for place, kind in sorted(sites):
        if not any(part in place for part in options.only.split(",")):
            continue
        found = (notice(site, options.seeds) for site in sites[place, kind])
        noticed = next((one for one in found if one), None)
        how, by = noticed or ("**nothing**", "")
        missed += noticed is None
        rows.append(f"| {kind} | {place} | {how} | {by} |")
        print(rows[-1], flush=True)
    if options.output:
        options.output.write_text("\n".join(rows) + "\n")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
