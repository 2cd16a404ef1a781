"""Umbel: triangle meshes as clusters, acceleration structures and continuous levels of detail.

Every name is imported when it is first used, so `import umbel` itself costs nothing.

    mesh = umbel.load("dragon.ply")
    lod = umbel.build_lod(mesh)
    lod.save("dragon.umbel")

    asset = umbel.Asset("dragon.umbel")
    coarse = asset.mesh(asset.cut(triangles=10_000))
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from . import bvh as bvh
    from . import shapes as shapes
    from .asset import Asset as Asset
    from .bvh import Bvh as Bvh
    from .bvh import Bvh2 as Bvh2
    from .bvh import KaryTree as KaryTree
    from .bvh import build_bvh2 as build_bvh2
    from .bvh import build_kary as build_kary
    from .camera import Camera as Camera
    from .camera import angular_error as angular_error
    from .camera import pixel_error as pixel_error
    from .cluster import ClusterBounds as ClusterBounds
    from .cluster import Clusters as Clusters
    from .cluster import Meshlets as Meshlets
    from .cluster import build_clusters as build_clusters
    from .cluster import cluster_bounds as cluster_bounds
    from .cluster import cluster_mesh as cluster_mesh
    from .cluster import order_clusters as order_clusters
    from .colors import cluster_colors as cluster_colors
    from .colors import colored_clusters as colored_clusters
    from .deform import deforming_tables as deforming_tables
    from .drift import Drift as Drift
    from .drift import RebuildPolicy as RebuildPolicy
    from .errors import Cancelled as Cancelled
    from .errors import Error as Error
    from .errors import LoadWarning as LoadWarning
    from .frame_clusters import FrameClusters as FrameClusters
    from .io import load as load
    from .io import load_scene as load_scene
    from .io import save as save
    from .kdtree import KdTree as KdTree
    from .lod import Lod as Lod
    from .lod import build_lod as build_lod
    from .lod import save_asset as save_asset
    from .look import Environment as Environment
    from .mesh import Material as Material
    from .mesh import Mesh as Mesh
    from .origin import localize as localize
    from .picture import save_picture as save_picture
    from .picture import tone_map as tone_map
    from .proof import VerifyReport as VerifyReport
    from .proof import verify as verify
    from .repair import drop_invalid as drop_invalid
    from .repair import snap as snap
    from .repair import validate as validate
    from .repair import weld as weld
    from .scene_lod import SceneLod as SceneLod
    from .scene_lod import build_scene as build_scene
    from .stream import Residency as Residency
    from .tables import Tables as Tables
    from .trace import Film as Film
    from .trace import Renderer as Renderer
    from .trace import render as render
    from .trimesh_ray import trimesh_rays as trimesh_rays
    from .uniform import IntervalHierarchy as IntervalHierarchy
    from .uniform import TwoLevelGrid as TwoLevelGrid
    from .viewer import View as View
    from .viewer import export_viewer as export_viewer
    from .viewer import view as view

_HOME = {
    "Asset": "asset",
    "Bvh": "bvh",
    "Bvh2": "bvh",
    "KaryTree": "bvh",
    "build_bvh2": "bvh",
    "build_kary": "bvh",
    "Camera": "camera",
    "angular_error": "camera",
    "pixel_error": "camera",
    "ClusterBounds": "cluster",
    "Clusters": "cluster",
    "Meshlets": "cluster",
    "build_clusters": "cluster",
    "cluster_bounds": "cluster",
    "cluster_mesh": "cluster",
    "order_clusters": "cluster",
    "cluster_colors": "colors",
    "colored_clusters": "colors",
    "Cancelled": "errors",
    "Error": "errors",
    "LoadWarning": "errors",
    "Drift": "drift",
    "FrameClusters": "frame_clusters",
    "RebuildPolicy": "drift",
    "load": "io",
    "load_scene": "io",
    "save": "io",
    "KdTree": "kdtree",
    "Lod": "lod",
    "build_lod": "lod",
    "deforming_tables": "deform",
    "save_asset": "lod",
    "SceneLod": "scene_lod",
    "build_scene": "scene_lod",
    "Environment": "look",
    "Material": "mesh",
    "Mesh": "mesh",
    "localize": "origin",
    "drop_invalid": "repair",
    "snap": "repair",
    "validate": "repair",
    "weld": "repair",
    "Residency": "stream",
    "Tables": "tables",
    "save_picture": "picture",
    "tone_map": "picture",
    "Film": "trace",
    "Renderer": "trace",
    "render": "trace",
    "trimesh_rays": "trimesh_ray",
    "View": "viewer",
    "export_viewer": "viewer",
    "view": "viewer",
    "IntervalHierarchy": "uniform",
    "TwoLevelGrid": "uniform",
    "VerifyReport": "proof",
    "verify": "proof",
}
_MODULES = {"bvh", "shapes"}

__all__ = sorted(_HOME) + sorted(_MODULES)

if TYPE_CHECKING:
    __version__: str


def __getattr__(name: str) -> Any:
    value: Any
    if name == "__version__":
        value = import_module("._umbel", __name__).version()
    elif name in _HOME:
        value = getattr(import_module(f".{_HOME[name]}", __name__), name)
    elif name in _MODULES:
        value = import_module(f".{name}", __name__)
    else:
        raise AttributeError(f"module 'umbel' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))
