"""Poses of a glTF asset's animations: the mesh as it is at points in time.

A pose is read as the rest pose is, by the same reader, with the animated nodes moved to where the
animation has them; so skins, morph targets and moving nodes all take part.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error
from umbel.geometry.mesh import Mesh
from umbel.io.folder import Folder
from umbel.io.gltf.buffers import Buffers, parse_container
from umbel.io.gltf.reader import check_header, read_root
from umbel.io.gltf.schema import check_schema

Json = dict[str, Any]
_SIZES = {"translation": 3, "rotation": 4, "scale": 3}


def read_poses(data: bytes, where: str, folder: Folder | None, rate: float) -> Iterator[Mesh]:
    """The mesh at every 1/rate seconds of every animation, its beginning and its end among them."""
    root, binary = parse_container(data, where)
    check_schema(root, where)
    check_header(root, where)
    buffers = Buffers(root, binary, where, folder)
    for index, animation in enumerate(root.get("animations") or []):
        name = f"animations[{index}]"
        try:
            channels = _channels(animation, buffers, name)
        except (AttributeError, LookupError, TypeError, ValueError) as error:
            raise Error(f"{where}: {name} is corrupt: {error}") from error
        if not channels:
            continue
        begin = min(float(times[0]) for _, _, times, _, _ in channels)
        end = max(float(times[-1]) for _, _, times, _, _ in channels)
        steps = max(int(np.ceil((end - begin) * rate)), 1)
        for time in np.linspace(begin, end, steps + 1):
            posed = copy.deepcopy(root)
            for node, path, times, values, mode in channels:
                posed["nodes"][node].pop("matrix", None)
                posed["nodes"][node][path] = _at(time, path, times, values, mode)
            yield read_root(posed, binary, where, folder, warn=False).flatten()


def _channels(animation: Json, buffers: Buffers, name: str) -> list[tuple[Any, ...]]:
    """(node, path, times, values, mode) of each channel that moves a node."""
    found = []
    for number, channel in enumerate(animation.get("channels") or []):
        what = f"{name}.channels[{number}]"
        target = channel.get("target") or {}
        path = target.get("path")
        if "node" not in target or path not in (*_SIZES, "weights"):
            continue
        buffers.item("nodes", target["node"], what)
        samplers = animation.get("samplers") or []
        if not isinstance(channel.get("sampler"), int) or not 0 <= channel["sampler"] < len(
            samplers
        ):
            raise Error(f"{buffers.where}: {what} has no sampler")
        sampler = samplers[channel["sampler"]]
        mode = sampler.get("interpolation", "LINEAR")
        times = buffers.floats(sampler.get("input"), what).reshape(-1).astype(np.float64)
        values = buffers.floats(sampler.get("output"), what).astype(np.float64)
        keys = len(times) * (3 if mode == "CUBICSPLINE" else 1)
        if not len(times) or not np.isfinite(times).all() or (np.diff(times) < 0).any():
            raise Error(f"{buffers.where}: {what} has times that do not ascend")
        if values.size % keys or (path in _SIZES and values.size != keys * _SIZES[path]):
            raise Error(f"{buffers.where}: {what} has {values.size} values for {len(times)} times")
        found.append((target["node"], path, times, values.reshape(keys, -1), mode))
    return found


def _at(
    time: float, path: str, times: NDArray[Any], values: NDArray[Any], mode: str
) -> list[float]:
    after = int(np.clip(np.searchsorted(times, time, side="right"), 1, max(len(times) - 1, 1)))
    before = after - 1
    after = min(after, len(times) - 1)
    span = times[after] - times[before]
    part = float(np.clip((time - times[before]) / span, 0, 1)) if span > 0 else 0.0
    if mode == "CUBICSPLINE":
        parts = values.reshape(len(times), 3, -1)
        (_, a, leaving), (arriving, b, _) = parts[before], parts[after]
        p2, p3 = part * part, part**3
        value = (2 * p3 - 3 * p2 + 1) * a + (p3 - 2 * p2 + part) * span * leaving
        value = value + (3 * p2 - 2 * p3) * b + (p3 - p2) * span * arriving
    elif mode == "STEP":
        value = values[after if part >= 1 else before]
    elif path == "rotation":
        value = _turned(values[before], values[after], part)
    else:
        value = (1 - part) * values[before] + part * values[after]
    return [float(x) for x in value]


def _turned(a: NDArray[Any], b: NDArray[Any], part: float) -> NDArray[Any]:
    """Between two unit quaternions by the shorter way, at constant speed."""
    cosine = float(a @ b)
    if cosine < 0:
        b, cosine = -b, -cosine
    angle = np.arccos(min(cosine, 1.0))
    if angle < 1e-6:
        return (1 - part) * a + part * b
    mixed = np.sin((1 - part) * angle) * a + np.sin(part * angle) * b
    return np.asarray(mixed / np.sin(angle))
