"""Fixtures of the tests of structures."""

from __future__ import annotations

import pytest

import umbel


@pytest.fixture(scope="module")
def blob() -> umbel.Mesh:
    """1,280 triangles."""
    return umbel.shapes.blob(3)


@pytest.fixture(scope="module")
def bvh(blob: umbel.Mesh) -> umbel.Bvh:
    """A hierarchy over it."""
    return umbel.Bvh(blob)
