"""The web viewer: serving it on this machine and exporting it for a static host."""
