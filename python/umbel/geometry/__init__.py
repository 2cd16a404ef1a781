"""Meshes, their cleaning, their place in the world, and the arrays that callers give."""
