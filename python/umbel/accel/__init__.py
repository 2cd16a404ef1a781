"""Acceleration structures over triangles, and the queries that all of them answer."""
