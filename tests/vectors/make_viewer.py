"""Makes the seeds of the viewer's fuzzer in viewer/.

python make_viewer.py
"""

import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "python"))
sys.path.insert(0, str(ROOT / "viewer" / "tests" / "support"))

from make_textured import all_materials  # noqa: E402

import umbel  # noqa: E402
from helpers.meshes import decorated_blob  # noqa: E402


def main() -> None:
    """Makes them."""
    folder = Path(__file__).parent / "viewer"
    folder.mkdir(exist_ok=True)
    blob = decorated_blob(2)
    umbel.build_lod(blob, max_triangles=16, precision="10bits").save(folder / "compact.umbel")
    umbel.build_lod(blob, max_triangles=16).save(folder / "exact.umbel", exact=True)
    plain = umbel.shapes.blob(3, seed=2)
    umbel.build_lod(plain, max_triangles=32, precision="8bits").save(folder / "plain.umbel")
    corners = blob.positions[blob.triangles]
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    faces /= np.linalg.norm(faces, axis=1, keepdims=True)
    creases = umbel.Mesh(
        corners.reshape(-1, 3),
        np.arange(3 * len(corners), dtype=np.uint32).reshape(-1, 3),
        normals=np.repeat(faces, 3, axis=0).astype(np.float32),
    )
    umbel.build_lod(creases, max_triangles=32, precision="10bits").save(folder / "creases.umbel")
    empty = umbel.Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    umbel.build_lod(empty).save(folder / "empty.umbel")
    all_materials(folder)
    umbel.build_lod(folder / "materials.gltf").save(folder / "materials.umbel")
    (folder / "materials.gltf").unlink()


if __name__ == "__main__":
    main()
