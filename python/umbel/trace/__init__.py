"""Path-traced pictures of meshes and assets."""
