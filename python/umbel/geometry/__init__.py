"""Meshes, their cleaning, their origins, and the arrays that callers give."""
