"""Builds a continuous-LOD asset from a mesh, verifies it, and reads cuts of several sizes."""

import sys

import umbel

source = sys.argv[1] if len(sys.argv) > 1 else umbel.shapes.blob(6)
path = sys.argv[2] if len(sys.argv) > 2 else "mesh.umbel"
lod = umbel.build_lod(source)
print(lod, "from", lod.report["input_triangles"], "triangles")
lod.save(path)

report = umbel.verify(path)
print("verified:", report.ok, "with", report.cuts, "cuts")

asset = umbel.Asset(path)
for budget in (50_000, 5_000, 500):
    cut = asset.cut(triangles=budget)
    mesh = asset.mesh(cut)
    error = asset.tables.cut_error(cut)
    print(f"at most {budget}: {len(mesh.triangles)} triangles, error {error:.3g}")

camera = umbel.Camera(position=(0, 0, 20), fov_y=1.0, height=1080, pixel_error=1.0)
print("from 20 away:", asset.tables.cut_triangles(asset.cut(camera=camera)), "triangles")
