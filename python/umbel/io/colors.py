"""Colours of vertices in formats that do not say what their numbers mean."""

from __future__ import annotations

#: Floats with a larger one among them are bytes. Blended and lit colours may be above 1 a little.
MOST_BRIGHT = 2.0
