"""What belongs to bounding volume hierarchies, beside `umbel.Bvh` itself."""

from umbel.accel.bvh import KARY_NODE as KARY_NODE
from umbel.accel.bvh import NODE as NODE
from umbel.accel.bvh import PRESETS as PRESETS
from umbel.accel.bvh import Bvh as Bvh
from umbel.accel.bvh import Bvh2 as Bvh2
from umbel.accel.bvh import KaryTree as KaryTree
from umbel.accel.bvh import Refit as Refit
from umbel.accel.bvh import TreeOptions as TreeOptions
from umbel.accel.bvh import build_bvh2 as build_bvh2
from umbel.accel.bvh import build_kary as build_kary
from umbel.accel.bvh import builders as builders
from umbel.accel.bvh import kmeans_times as kmeans_times
from umbel.accel.rays import Hits as Hits
