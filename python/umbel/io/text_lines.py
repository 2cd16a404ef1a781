"""Words of a text by number, and the lines that they are in, for messages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass
class Words:
    """Where the words of a text begin and end: runs of characters above blank space."""

    text: NDArray[np.uint8]
    starts: NDArray[np.int64]
    ends: NDArray[np.int64]

    @staticmethod
    def of(data: bytes) -> Words:
        text = np.frombuffer(data, np.uint8)
        edges = np.flatnonzero(np.diff(text > 32, prepend=False, append=False))
        return Words(text, edges[::2], edges[1::2])

    def __len__(self) -> int:
        return len(self.starts)

    def are(self, chosen: Any, word: bytes) -> NDArray[np.bool_]:
        """Whether each of the chosen words is this one."""
        starts = self.starts[chosen]
        same: NDArray[np.bool_] = self.ends[chosen] - starts == len(word)
        last = len(self.text) - 1
        for k, letter in enumerate(word):
            same &= self.text[np.minimum(starts + k, last)] == letter
        return same

    def word(self, index: int) -> str:
        """A word as messages show it."""
        shown = self.text[self.starts[index] : self.ends[index]][:40].tobytes()
        return repr(shown.decode("utf-8", "replace"))


def line_at(data: bytes, offset: int) -> int:
    """The number of the line, from 1, that a byte is in."""
    ends = b"\n" if b"\n" in data else b"\r"
    return data.count(ends, 0, offset) + 1
