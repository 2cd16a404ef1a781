"""Random numbers that are a function of a place: any part of a mesh can be made without the rest.

Only additions, multiplications and integer operations are used, which every machine rounds alike.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

_SHIFT = np.uint64(32)


def hashed(values: NDArray[np.uint64], seed: int) -> NDArray[np.uint64]:
    """A bijection of 64 bits for each seed: the finaliser of SplitMix64 (Steele, Lea and Flood,
    "Fast Splittable Pseudorandom Number Generators", 2014)."""
    x: NDArray[np.uint64] = values + np.uint64((seed * 0x9E3779B97F4A7C15 + 1) % 2**64)
    x ^= x >> np.uint64(30)
    x *= np.uint64(0xBF58476D1CE4E5B9)
    x ^= x >> np.uint64(27)
    x *= np.uint64(0x94D049BB133111EB)
    x ^= x >> np.uint64(31)
    return x


def unit(bits: NDArray[np.uint64], which: int = 0) -> NDArray[np.float64]:
    """Numbers in [0, 1), multiples of 2^-20, of 20 of the bits; `which` is 0, 1 or 2."""
    part = (bits >> np.uint64(20 * which)) & np.uint64(0xFFFFF)
    values: NDArray[np.float64] = part.astype(np.float64) * 2.0**-20
    return values


def pairs(rows: Any, columns: Any) -> NDArray[np.uint64]:
    """One number for each row and column, which may be arrays that broadcast."""
    out: NDArray[np.uint64] = (rows.astype(np.uint64) << _SHIFT) | columns.astype(np.uint64)
    return out


class Noise:
    """Value noise in octaves on a grid of integers (Perlin's sum of octaves, "An Image
    Synthesizer", 1985, of interpolated random numbers)."""

    def __init__(self, seed: int, octaves: int = 12, roughness: float = 0.55) -> None:
        self._seed = seed
        #: Of each octave, whose cells have 2^octave points a side.
        self._amplitudes = [2.0 ** (octave * (1.0 - roughness) * 2) for octave in range(octaves)]

    def grid(self, rows: tuple[int, int], columns: tuple[int, int]) -> NDArray[np.float64]:
        """All values of rows [a, b) and columns [c, d)."""
        total = np.zeros((rows[1] - rows[0], columns[1] - columns[0]))
        for octave, amplitude in enumerate(self._amplitudes):
            i, u = _cell(np.arange(*rows), octave)
            j, v = _cell(np.arange(*columns), octave)
            corners = self._corner(
                octave,
                np.arange(i[0], i[-1] + 2)[:, None],
                np.arange(j[0], j[-1] + 2)[None, :],
            )
            i, j = i - i[0], j - j[0]
            along = corners[:, j]
            along += v * (corners[:, j + 1] - along)
            values = along[i]
            values += u[:, None] * (along[i + 1] - values)
            values *= amplitude
            total += values
        return total

    def at(self, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.float64]:
        """The same values, of points anywhere."""
        total = np.zeros(len(rows))
        for octave, amplitude in enumerate(self._amplitudes):
            i, u = _cell(rows, octave)
            j, v = _cell(columns, octave)
            values = self._along(octave, i, j, v)
            values += u * (self._along(octave, i + 1, j, v) - values)
            values *= amplitude
            total += values
        return total

    def _along(
        self,
        octave: int,
        i: NDArray[np.int64],
        j: NDArray[np.int64],
        v: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        values = self._corner(octave, i, j)
        values += v * (self._corner(octave, i, j + 1) - values)
        return values

    def _corner(self, octave: int, i: Any, j: Any) -> NDArray[np.float64]:
        return unit(hashed(pairs(i, j), self._seed * 64 + octave)) - 0.5


def _cell(at: NDArray[np.int64], octave: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The cell that each point is in, and how far along it is there, smoothed."""
    size = 1 << octave
    f = (at & (size - 1)).astype(np.float64) / size
    return at >> octave, f * f * (3.0 - 2.0 * f)
