"""Arrays that nobody should give: of any type, shape, layout and value. Each is taken, or refused
with a sentence of umbel.Error."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import umbel

POSITIONS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5], [0.5, 0.5, 1]], np.float32)
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]], np.uint32)
BOXES = np.concatenate([POSITIONS, POSITIONS + 1], axis=1)
PIXELS = np.ones((4, 5, 3), np.float32)
MATRIX = np.eye(3, 4)
PLANES = np.array([[1, 0, 0, 9], [0, 1, 0, 9], [0, 0, 1, 9]])


def wrong_arrays(good: np.ndarray[Any, Any]) -> Iterator[Any]:
    yield from ("text", 3, float("nan"), [], [[]], [None], [[1, 2, 3], [4, 5]], [["a", "b", "c"]])
    for shape in ((), (0, 3), (3, 0), (3,), (1, 3, 3), (2, 2, 2, 2)):
        yield np.zeros(shape)
    for kind in ("c16", "O", "M8[s]", "?", "f2", "g", ">f4", ">i8", "i1", "u8"):
        yield np.zeros((5, 3), kind)
    yield np.zeros((5, 3), [("a", "f4")])
    for value in (np.nan, np.inf, 1e30, 1e300, -1.0):
        yield np.full(good.shape, value)
        one = good.astype(np.float64)
        one.flat[-1] = value
        yield one
    for whole in (-1, 2**31, 2**32, -(2**63)):
        yield np.full(good.shape, whole, np.int64)
    yield np.full(good.shape, 2**63, np.uint64)
    yield np.broadcast_to(np.float32(1), (1000, 3))
    yield from (good[::-1], good[::2], good[:-1], good.T, np.asfortranarray(good))
    yield from (np.concatenate([good, good]), np.repeat(good, 2, axis=0)[::2], good.tolist())
    unaligned = np.ndarray(good.shape, good.dtype, bytearray(good.nbytes + 1), 1)
    unaligned[...] = good
    yield unaligned
    constant = good.copy()
    constant.flags.writeable = False
    yield constant


def mesh(**streams: Any) -> Callable[[Any], object]:
    """Takes the stream of that name of a mesh through all that reads it."""
    (name,) = streams
    arrays: dict[str, Any] = {"positions": POSITIONS, "triangles": TRIANGLES}
    if name in ("joints", "weights"):
        arrays |= {"joints": np.zeros((5, 4), np.uint32), "weights": np.ones((5, 4), np.float32)}

    def call(values: Any) -> None:
        made = umbel.Mesh(**(arrays | {name: values}))
        umbel.validate(made)
        umbel.weld(made)
        umbel.drop_invalid(made)
        umbel.build_lod(made, max_triangles=4)

    return call


def further_uvs(values: Any) -> None:
    made = umbel.Mesh(POSITIONS, TRIANGLES)
    made.uv_sets = [values]
    umbel.build_lod(made)


def clusters(name: str) -> Callable[[Any], object]:
    """Takes clusters of the caller's own."""
    good = umbel.cluster_mesh((POSITIONS, TRIANGLES), 2)

    def call(values: Any) -> None:
        arrays = {"items": good.items, "ranges": good.ranges, name: values}
        made = umbel.Clusters(arrays["items"], arrays["ranges"], good.segments, dict)
        umbel.order_clusters((POSITIONS, TRIANGLES), made)
        umbel.cluster_bounds((POSITIONS, TRIANGLES), made)

    return call


def connections(place: int) -> Callable[[Any], object]:
    def call(values: Any) -> object:
        given: list[Any] = [[0, 1, 2, 2, 2, 2], [1, 0], [1.0, 1.0]]
        given[place] = values
        return umbel.build_clusters(BOXES, 2, connections=(given[0], given[1], given[2]))

    return call


def lod() -> umbel.Lod:
    return umbel.build_lod(umbel.shapes.blob(2), max_triangles=32, group_size=(3, 6))


def queries(name: str, argument: str) -> Callable[[Any], object]:
    trees = [
        kind(POSITIONS, TRIANGLES)
        for kind in (umbel.Bvh, umbel.KdTree, umbel.IntervalHierarchy, umbel.TwoLevelGrid)
    ]
    rays = {"origins": POSITIONS + np.array([0, 0, 5]), "directions": np.tile([0, 0, -1.0], (5, 1))}
    others = {"overlaps_box": {"low": np.zeros(3), "high": np.ones(3)}}

    def call(values: Any) -> None:
        errors = []
        for tree in trees:
            given = rays if argument in ("origins", "directions", "t_max") else others.get(name, {})
            try:
                getattr(tree, name)(**(given | {argument: values}))
            except umbel.Error as error:
                errors.append(error)
        if errors:
            assert len(errors) == len(trees)
            raise errors[0]

    return call


CASES: dict[str, tuple[Callable[[], Callable[[Any], object]], Any]] = {
    "positions": (lambda: mesh(positions=0), POSITIONS),
    "triangles": (lambda: mesh(triangles=0), TRIANGLES),
    "normals": (lambda: mesh(normals=0), POSITIONS),
    "tangents": (lambda: mesh(tangents=0), np.ones((5, 4))),
    "uvs": (lambda: mesh(uvs=0), np.ones((5, 2))),
    "colors": (lambda: mesh(colors=0), np.ones((5, 4))),
    "material_ids": (lambda: mesh(material_ids=0), np.zeros(6, np.uint32)),
    "joints": (lambda: mesh(joints=0), np.zeros((5, 4), np.uint32)),
    "weights": (lambda: mesh(weights=0), np.ones((5, 4))),
    "uv_sets": (lambda: further_uvs, np.ones((5, 2))),
    "boxes": (lambda: lambda v: umbel.build_clusters(v, 2), BOXES),
    "centroids": (lambda: lambda v: umbel.build_clusters(BOXES, 2, centroids=v), POSITIONS),
    "segments": (
        lambda: lambda v: umbel.build_clusters(BOXES, 2, segments=v),
        np.array([[0, 3], [3, 2]], np.uint32),
    ),
    "item_vertices": (lambda: lambda v: umbel.build_clusters(BOXES, 2, item_vertices=v), TRIANGLES),
    "connections: offsets": (lambda: connections(0), np.array([0, 1, 2, 2, 2, 2])),
    "connections: targets": (lambda: connections(1), np.array([1, 0])),
    "connections: weights": (lambda: connections(2), np.array([1.0, 1.0])),
    "items": (lambda: clusters("items"), np.arange(6, dtype=np.uint32)),
    "ranges": (lambda: clusters("ranges"), np.array([[0, 3], [3, 3]], np.uint32)),
    "frames": (lambda: umbel.FrameClusters((POSITIONS, TRIANGLES)).refit, POSITIONS),
    "masks": (lambda: lambda v: umbel.Bvh(POSITIONS, TRIANGLES, masks=v), np.ones(6, np.uint32)),
    "refit": (lambda: umbel.Bvh(POSITIONS, TRIANGLES).refit, POSITIONS),
    "boxes of a tree": (lambda: umbel.build_bvh2, BOXES),
    "origins": (lambda: queries("intersect", "origins"), POSITIONS),
    "directions": (lambda: queries("all_hits", "directions"), POSITIONS),
    "t_max": (lambda: queries("occluded", "t_max"), np.ones(5)),
    "points": (lambda: queries("closest_point", "points"), POSITIONS),
    "points inside": (lambda: queries("contains", "points"), POSITIONS),
    "low": (lambda: queries("overlaps_box", "low"), np.zeros(3)),
    "frustum": (lambda: queries("overlaps_frustum", "planes"), np.ones((6, 4))),
    "cut": (lambda: lod().mesh, np.arange(3, dtype=np.uint32)),
    "triangles of a cut": (lambda: lod().tables.cut_triangles, np.arange(3, dtype=np.uint32)),
    "planes": (lambda: (lambda t: lambda v: t.cut(error=0.1, planes=v))(lod().tables), PLANES),
    "transforms": (
        lambda: (lambda t: lambda v: t.instance_cuts(v, t.view(error=0.1)))(lod().tables),
        np.tile(MATRIX, (3, 1, 1)),
    ),
    "rows of bounds": (lambda: umbel.ClusterBounds.of_rows, np.ones((3, 11))),
    "levels": (
        lambda: (lambda t: lambda v: umbel.Tables.of_arrays(v, t.groups, t.clusters, t.nodes))(
            lod().tables
        ),
        np.array([[0, 3]], np.uint32),
    ),
    "pixels": (lambda: umbel.tone_map, PIXELS),
}


@pytest.mark.parametrize("name", CASES)
def test_any_array_is_taken_or_refused_with_a_sentence(name: str) -> None:
    make, good = CASES[name]
    call = make()
    refused = 0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what NumPy says of NaN and of complex numbers
        for values in wrong_arrays(np.asarray(good)):
            try:
                call(values)
            except umbel.Error as error:
                assert len(str(error)) > 10
                refused += 1
    assert refused > 10


@pytest.mark.parametrize("name", CASES)
def test_masked_values_are_refused(name: str) -> None:
    make, good = CASES[name]
    call = make()
    masked = np.ma.array(good, mask=np.arange(good.size).reshape(good.shape) == 0)
    with pytest.raises(umbel.Error, match="masked"):
        call(masked)


def test_masked_arrays_without_masked_values_are_arrays() -> None:
    mesh = umbel.Mesh(np.ma.array(POSITIONS), np.ma.array(TRIANGLES, mask=False))
    assert np.array_equal(mesh.positions, POSITIONS)


def test_numbers_that_are_none_are_refused_with_a_sentence() -> None:
    wrong: tuple[Any, ...] = (-1, 2**32, 1.5, "2", None)
    for threads in wrong:
        for call in (umbel.validate, umbel.weld, umbel.build_lod, umbel.cluster_mesh, umbel.Bvh):
            with pytest.raises(umbel.Error, match="threads must be"):
                call((POSITIONS, TRIANGLES), threads=threads)
