"""Clusters of meshes that change every frame, hierarchies of triangles with their queries, and cuts
of levels of detail, on a CUDA device.

Takes arrays of CuPy, PyTorch, Numba, or anything with `__cuda_array_interface__` or DLPack, without
copying them, and puts its work into the current stream of their package; nothing waits. Arrays of
NumPy are copied to the device and back. Needs the
library umbel_cuda_c, which `make cuda` builds: its path is UMBEL_CUDA_LIBRARY, or it lies in the
package's folder.
"""

from umbel.cuda.bvh import Bvh
from umbel.cuda.calls import library_path
from umbel.cuda.cluster_bvh import ClusterBvh
from umbel.cuda.frame_clusters import FrameClusters
from umbel.cuda.select import Selection, Selector, view_words

__all__ = [
    "Bvh",
    "ClusterBvh",
    "FrameClusters",
    "Selection",
    "Selector",
    "library_path",
    "view_words",
]
