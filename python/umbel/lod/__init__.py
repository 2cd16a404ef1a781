"""Continuous levels of detail: building, selecting, storing, streaming and verifying them."""
