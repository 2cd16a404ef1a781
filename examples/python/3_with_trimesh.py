"""Levels of detail of a trimesh mesh, and a cut as a trimesh mesh."""

import trimesh

import umbel

scan = trimesh.creation.icosphere(subdivisions=6)
lod = umbel.build_lod(scan)
coarse = lod.mesh(lod.cut(triangles=2_000))
back = trimesh.Trimesh(coarse.vertices, coarse.triangles)
print(f"{len(scan.faces)} faces became {len(back.faces)}; watertight: {back.is_watertight}")
