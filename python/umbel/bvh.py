"""The public names of bounding volume hierarchies, beside `umbel.Bvh` itself."""

from umbel.accel.bvh import Bvh as Bvh
from umbel.accel.bvh import Refit as Refit
from umbel.accel.dynamic_tree import DynamicTree as DynamicTree
from umbel.accel.rays import Hits as Hits
from umbel.accel.tree_options import PRESETS as PRESETS
from umbel.accel.tree_options import TreeOptions as TreeOptions
from umbel.accel.tree_options import builders as builders
from umbel.accel.trees import KARY_NODE as KARY_NODE
from umbel.accel.trees import NODE as NODE
from umbel.accel.trees import Bvh2 as Bvh2
from umbel.accel.trees import KaryTree as KaryTree
from umbel.accel.trees import build_bvh2 as build_bvh2
from umbel.accel.trees import build_kary as build_kary
from umbel.accel.trees import kmeans_times as kmeans_times
