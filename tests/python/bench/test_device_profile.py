"""The page of kernels that bench/device_profile.py makes of what Nsight Compute says."""

from __future__ import annotations

import csv
import importlib.util
import sys
from pathlib import Path

BENCH = Path(__file__).resolve().parents[3] / "bench"
CLIMB = (
    "void umbel::run_each<void bvh::radix_merges<umbel::CudaExec>(T1 &)"
    "::[lambda(unsigned long) (instance 2)]>(T1)"
)
TEAM = "void umbel::run_teams<bvh::HplocClimb<bvh::CompactSums>>(unsigned long, T1)"
SORT = "void radix_sort::DeviceRadixSortOnesweepKernel<radix::policy_hub<int>>(T1)"


def load(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCH))
    spec = importlib.util.spec_from_file_location("device_profile", BENCH / "device_profile.py")
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "device_profile", module)
    spec.loader.exec_module(module)
    return module


def test_launches_of_a_kernel_are_added_up(monkeypatch, tmp_path):
    profile = load(monkeypatch)
    file, page = tmp_path / "profile-lbvh.csv", tmp_path / "gpu-some-device-profile.md"
    with file.open("w", newline="") as out:
        out.write("==PROF== Connected to process 5\n")
        writer = csv.writer(out, quoting=csv.QUOTE_ALL)
        writer.writerow(["ID", "Kernel Name", "Metric Name", "Metric Value"])
        for launch, (name, time, busy) in enumerate(
            [(SORT, "1,000", 10), (CLIMB, "6,000", 40), (SORT, "3,000", 50)]
        ):
            writer.writerow([launch, name, "Duration", time])
            writer.writerow([launch, name, "Registers Per Thread", "62"])
            for metric in profile.COLUMNS.values():
                writer.writerow([launch, name, metric, busy])
    profile.main([str(page), str(file)])
    lines = page.read_text().splitlines()
    assert lines[0] == "# some-device-profile"
    assert "## lbvh" in lines
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines if "`" in line]
    assert rows[0] == ["`radix_merges (2)`", "1", "6.0", "60.0"] + ["40.0"] * 6
    assert rows[1] == ["`DeviceRadixSortOnesweepKernel`", "2", "4.0", "40.0"] + ["40.0"] * 6


def test_kernels_are_named_by_what_they_do(monkeypatch):
    profile = load(monkeypatch)
    assert profile.short(TEAM) == "HplocClimb"
    assert profile.short("MergeSort(int)") == "MergeSort"
