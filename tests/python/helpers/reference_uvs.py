"""Texture coordinates by positions, as docs/format.md has them, for reference_codec.py."""

import numpy as np


def signed(value: int) -> int:
    return (value + 2**31) % 2**32 - 2**31


def way(a: list[int], b: list[int]) -> np.ndarray:
    """From a to b in whole numbers of 32 bits, rounded."""
    return np.array([signed(y - x) for x, y in zip(a, b, strict=True)], np.float32)


def dot(a: np.ndarray, b: np.ndarray) -> np.float32:
    x, y, z = a * b
    return (x + y) + z


def predict_uvs(
    rows: list[list[int]], parents: tuple[int, int, int], v: int, closes: bool, mirrored: bool
) -> list[int]:
    """Of vertex v, whose position is in its row; each row ends with the texture coordinates."""
    f, s, t = (v - 2, v - 1, v - 2) if closes else parents
    origin = rows[f]
    x, e, w = (way(origin[:3], rows[other][:3]) for other in (v, s, t))
    with np.errstate(divide="ignore", invalid="ignore"):
        ee, xe, we = dot(e, e), dot(x, e), dot(w, e)
        p, q = xe / ee, we / ee
        h = np.maximum(dot(x, x) - p * xe, np.float32(0))
        k = ee if closes else dot(w, w) - q * we
        z = np.sqrt(h / k)
        i = p + z * q
        sound = ee > 0 and k > 0 and abs(i) <= 4 and z <= 4
    i, j = (i, -z) if sound else (np.float32(1), np.float32(0 if closes else -1))
    start = origin[-2:]
    sigma, tau = way(start, rows[s][-2:]), way(start, rows[t][-2:])
    if closes:
        tau = np.array([-sigma[1], sigma[0]], np.float32) * np.float32(-1 if mirrored else 1)
    moved = np.clip(sigma * i + tau * j, np.float32(-(2**30)), np.float32(2**30))
    moved = np.trunc(moved + np.where(moved < 0, np.float32(-0.5), np.float32(0.5)))
    return [signed(value + int(m)) for value, m in zip(start, moved, strict=True)]
