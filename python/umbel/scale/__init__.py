"""Building assets of meshes that do not fit into memory, on one machine or many."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from umbel.scale.executor import Executor, Result, Task, perform
    from umbel.scale.on_dask import Dask
    from umbel.scale.on_ray import Ray

__all__ = ["Dask", "Executor", "Ray", "Result", "Task", "perform"]

_HOME = {"Dask": "on_dask", "Ray": "on_ray"}


def __getattr__(name: str) -> object:
    # Imported when used: the command line asks this package for little else than memory.
    if name not in __all__:
        raise AttributeError(f"module 'umbel.scale' has no attribute {name!r}")
    return getattr(import_module(f"umbel.scale.{_HOME.get(name, 'executor')}"), name)
