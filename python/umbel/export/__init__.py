"""Assets for other viewers: 3D Tiles, and glTF with levels."""
