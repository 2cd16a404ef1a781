"""What kernels of umbel::cuda take, by their machine code: a table for bench/results.

    scripts/cuda_kernels.py [--objects FOLDER] [--earlier FOLDER] [-o FILE]

Reads the objects of src/cuda that `CUDA_ARCHS=90 make cuda` leaves, and with `--earlier` those of
another build to compare with. Needs `cuobjdump` and `nvdisasm` on the PATH, which CUDA's toolkit
and the wheels `nvidia-cuda-cuobjdump` and `nvidia-cuda-nvdisasm` have, and `c++filt`. Instructions
are counted as they stand in the code, however often they run:

atomics: atomic operations on global memory (ATOM, ATOMG, RED)
fences: MEMBAR
invalidations: of the first-level cache (CCTL.IVALL)
loads, stores: of global memory (LD, LDG, ST, STG)
blocks: those that a multiprocessor of compute capability 9.0 holds at a time
"""

from __future__ import annotations

import argparse
import re
import subprocess
from pathlib import Path

# A multiprocessor of compute capability 9.0: CUDA C++ Programming Guide, "Compute Capabilities".
REGISTERS, SHARED, THREADS, BLOCKS = 65536, 233472, 2048, 32
RESERVED_SHARED = 1024  # of each block, by the system

COUNTED = {
    "atomics": re.compile(r"\b(ATOM|ATOMG|RED)\b(?!S)"),
    "fences": re.compile(r"\bMEMBAR\b"),
    "invalidations": re.compile(r"\bCCTL\.IVALL\b"),
    "loads": re.compile(r"\b(LD|LDG)\b"),
    "stores": re.compile(r"\b(ST|STG)\b"),
}
HEAD = ["threads", "registers", "shared B", "local B", "blocks", *COUNTED]


def output_of(*command: str) -> str:
    """What a command prints."""
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def short(names: list[str]) -> list[str]:
    """Names as one reads them: what a kernel runs, without namespaces, executor and parameters."""
    demangled = subprocess.run(
        ["c++filt"], input="\n".join(names), check=True, capture_output=True, text=True
    ).stdout.splitlines()
    result = []
    for name in demangled:
        name = re.sub(r"^void umbel::cuda::detail::", "", name)
        # The kernel's template argument ends where its brackets close.
        depth = 0
        for at, letter in enumerate(name):
            depth += (letter == "<") - (letter == ">")
            if letter == ">" and depth == 0:
                name = name[: at + 1]
                break
        lambda_number = re.search(r"\{lambda\([^)]*\)#(\d+)\}>$", name)
        name = re.sub(r"\((?:[^()]|\([^()]*\))*\)(?=::\{lambda).*", "", name)
        name = re.sub(r"\b(?:umbel|cuda|bvh|cluster|lod|detail|base)::", "", name)
        name = re.sub(r"CudaExec(, )?|, CudaExec|<>", "", name)
        name = re.sub(r", >|>+$", "", name.replace(", >", ">"))
        kind, _, body = name.partition("<")
        body += "" if body.count("<") <= body.count(">") else ">"
        number = f" #{lambda_number[1]}" if lambda_number else ""
        result.append(f"{kind}: {body.strip()}{number}")
    return result


def blocks(threads: int, registers: int, shared: int) -> int:
    """How many blocks a multiprocessor holds at a time."""
    warps = -(-threads // 32)
    a_warp = -(-registers * 32 // 256) * 256
    by_registers = (REGISTERS // 4 // a_warp * 4) // warps
    by_shared = SHARED // (-(-(shared + RESERVED_SHARED) // 128) * 128)
    return min(BLOCKS, THREADS // threads, by_registers, by_shared)


def kernels_of(path: Path) -> dict[str, list[int]]:
    """By mangled name, the columns of HEAD."""
    used = {}
    pattern = r"Function (\S+):\s+REG:(\d+) STACK:(\d+) SHARED:(\d+)"
    for name, *numbers in re.findall(pattern, output_of("cuobjdump", "-res-usage", str(path))):
        used[name] = [int(n) for n in numbers]
    bounds = dict(
        re.findall(
            r"\.entry (\w+)\((?:[^)]*)\)\s*\.maxntid (\d+)",
            output_of("cuobjdump", "-ptx", str(path)),
        )
    )
    found = {}
    for text in output_of("cuobjdump", "-sass", str(path)).split("Function : ")[1:]:
        name = text.split(maxsplit=1)[0]
        if "umbel" not in name or "cub" in name[:12] or name not in used:
            continue
        registers, local, shared = used[name]
        threads = int(bounds.get(name, 256))
        counts = [len(pattern.findall(text)) for pattern in COUNTED.values()]
        # What the system reserves is in the number, too.
        shared = max(0, shared - RESERVED_SHARED)
        found[name] = [
            *(threads, registers, shared, local),
            blocks(threads, registers, shared),
            *counts,
        ]
    return found


def table(objects: Path) -> str:
    """All kernels of a build."""
    lines = ["| kernel | " + " | ".join(HEAD) + " |", "|---" + "|--:" * len(HEAD) + "|"]
    paths = sorted(objects.glob("*.cu.o"))
    if not paths:
        raise SystemExit(f"no objects in {objects}: run CUDA_ARCHS=90 make cuda")
    for path in paths:
        found = kernels_of(path)
        for name, numbers in sorted(zip(short(list(found)), found.values(), strict=True)):
            lines.append(f"| `{name}` | " + " | ".join(map(str, numbers)) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Reads, and prints or writes the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    folder = Path("build/release/CMakeFiles/umbel_cuda.dir/src/cuda")
    parser.add_argument("--objects", type=Path, default=folder)
    parser.add_argument("--earlier", type=Path)
    parser.add_argument("-o", "--output", type=Path)
    args = parser.parse_args()
    text = (
        "# Kernels by their machine code\n\n"
        "`scripts/cuda_kernels.py`, compute capability 9.0. Instructions are counted as they stand "
        f"in the code, however often they run. Nothing here is a time.\n\n{table(args.objects)}"
    )
    if args.earlier is not None:
        text += f"\n## The earlier ones\n\n{table(args.earlier)}"
    if args.output is None:
        print(text, end="")
    else:
        args.output.write_text(text)


if __name__ == "__main__":
    main()
