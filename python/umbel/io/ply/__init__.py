"""PLY, read and written."""
