"""Building assets of meshes that do not fit into memory."""
