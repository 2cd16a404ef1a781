"""Files that are refused with a message of use."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from umbel import Error


@contextmanager
def refused(says: str, file: str) -> Iterator[None]:
    """What is inside fails with an `umbel.Error` that matches `says` and names the file."""
    with pytest.raises(Error, match=says) as caught:
        yield
    assert file in str(caught.value)
