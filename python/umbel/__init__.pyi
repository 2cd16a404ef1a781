"""The public names: the one list of them. `umbel/__init__.py` reads it to import each name when it
is first used; editors and type checkers read it too."""

from . import bvh as bvh
from . import cuda as cuda
from . import io as io
from . import shapes as shapes
from .accel.bvh import Bvh as Bvh
from .accel.kdtree import KdTree as KdTree
from .accel.trees import Bvh2 as Bvh2
from .accel.trees import KaryTree as KaryTree
from .accel.trees import build_bvh2 as build_bvh2
from .accel.trees import build_kary as build_kary
from .accel.trimesh_rays import trimesh_rays as trimesh_rays
from .accel.uniform import IntervalHierarchy as IntervalHierarchy
from .accel.uniform import TwoLevelGrid as TwoLevelGrid
from .cluster.area_growth import AreaGrowth as AreaGrowth
from .cluster.area_growth import RebuildPolicy as RebuildPolicy
from .cluster.clusters import ClusterBounds as ClusterBounds
from .cluster.clusters import Clusters as Clusters
from .cluster.clusters import Meshlets as Meshlets
from .cluster.clusters import build_clusters as build_clusters
from .cluster.clusters import cluster_bounds as cluster_bounds
from .cluster.clusters import cluster_mesh as cluster_mesh
from .cluster.clusters import order_clusters as order_clusters
from .cluster.colors import cluster_colors as cluster_colors
from .cluster.colors import colored_clusters as colored_clusters
from .cluster.frame_clusters import FrameClusters as FrameClusters
from .errors import Cancelled as Cancelled
from .errors import Error as Error
from .errors import LoadWarning as LoadWarning
from .geometry.camera import Camera as Camera
from .geometry.camera import angular_error as angular_error
from .geometry.camera import pixel_error as pixel_error
from .geometry.mesh import Material as Material
from .geometry.mesh import Mesh as Mesh
from .geometry.origin import localize as localize
from .geometry.repair import drop_invalid as drop_invalid
from .geometry.repair import snap as snap
from .geometry.repair import validate as validate
from .geometry.repair import weld as weld
from .io import load as load
from .io import load_scene as load_scene
from .io import save as save
from .lod.asset import Asset as Asset
from .lod.build import build_lod as build_lod
from .lod.build_scene import build_scene as build_scene
from .lod.deform import deforming_tables as deforming_tables
from .lod.lod import Lod as Lod
from .lod.residency import Residency as Residency
from .lod.save import save_asset as save_asset
from .lod.scene_lod import SceneLod as SceneLod
from .lod.tables import Tables as Tables
from .lod.verify import VerifyReport as VerifyReport
from .lod.verify import verify as verify
from .trace.denoise import denoise as denoise
from .trace.picture import save_picture as save_picture
from .trace.picture import tone_map as tone_map
from .trace.renderer import Film as Film
from .trace.renderer import Renderer as Renderer
from .trace.renderer import render as render
from .trace.shading import Environment as Environment
from .viewer.view import View as View
from .viewer.view import export_viewer as export_viewer
from .viewer.view import view as view

__version__: str
__all__: list[str]
