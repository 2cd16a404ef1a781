"""Checks that code for devices counts bits by base/bit_count.hpp alone.

What CUDA's compiler makes of the standard library's functions, and of GCC's built-in ones for
`long` and for trailing zeros, compiles and gives wrong numbers.
"""

import re
import sys
from pathlib import Path

SOURCES = Path(__file__).resolve().parent.parent / "src"
ITSELF = SOURCES / "base" / "bit_count.hpp"
IS_DEVICE_CODE = re.compile(r"UMBEL_HOST_DEVICE|UMBEL_DEVICE_LAMBDA|__device__")
COUNTS_BITS = re.compile(
    r"std::(popcount|countl_\w+|countr_\w+|bit_width|bit_ceil|bit_floor|has_single_bit)\b"
    r"|__builtin_(clz|ctz|popcount|ffs|parity)"
)


def findings(text: str) -> list[tuple[int, str]]:
    """Lines, by number, that count bits in another way; those of constants may."""
    if not IS_DEVICE_CODE.search(text):
        return []
    return [
        (number, match[0])
        for number, line in enumerate(text.splitlines(), 1)
        if (match := COUNTS_BITS.search(line)) and "constexpr" not in line
    ]


def main() -> int:
    """Prints what is found; 1 if there is anything."""
    found = False
    for path in sorted(SOURCES.rglob("*")):
        if path.suffix not in {".hpp", ".cuh", ".cu"} or path == ITSELF:
            continue
        for number, name in findings(path.read_text(encoding="utf-8")):
            print(f"src/{path.relative_to(SOURCES)}:{number}: {name}: use base/bit_count.hpp")
            found = True
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
