"""Clusters of triangles, of still meshes and of meshes that change every frame."""
