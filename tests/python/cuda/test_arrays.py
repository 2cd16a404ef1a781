"""What other packages' device arrays are taken for. None of this touches a device."""

from __future__ import annotations

import sys
import types

import numpy as np
import pytest

import umbel
from umbel import cuda
from umbel.cuda import calls as cuda_calls
from umbel.cuda.arrays import device_array


class Interface:
    """An array as CuPy, PyTorch and Numba show theirs."""

    def __init__(self, shape, typestr="<f4", strides=None, data=4096):
        self.__cuda_array_interface__ = {
            "shape": shape,
            "typestr": typestr,
            "strides": strides,
            "data": (data, False),
            "version": 3,
        }


class Lent:
    """An array of the processor that says by DLPack that it is on a device."""

    def __init__(self, array):
        self.array = array
        self.stream = None

    def __dlpack_device__(self):
        return (2, 0)

    def __dlpack__(self, stream=None):
        self.stream = stream
        return self.array.__dlpack__()


def test_interfaces_give_address_shape_and_stride():
    found = device_array(Interface((7, 3)), "positions", ("f4",), 3)
    assert (found.pointer, found.shape, found.strides) == (4096, (7, 3), (12, 4))
    found = device_array(Interface((7, 3), strides=(32, 4)), "positions", ("f4",), 3)
    assert found.strides == (32, 4)


def test_dlpack_gives_address_shape_and_stride():
    array = np.arange(40, dtype=np.float32).reshape(8, 5)[:, 1:4]
    lent = Lent(array)
    found = device_array(lent, "positions", ("f4",), 3, stream=77)
    assert (found.pointer, found.shape, found.strides) == (array.ctypes.data, (8, 3), (20, 4))
    assert lent.stream == 77
    device_array(lent, "positions", ("f4",), 3)
    assert lent.stream == 1
    integers = np.zeros((4, 3), np.int32)
    assert device_array(Lent(integers), "triangles", ("u4", "i4"), 3).kind == "i4"


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((4, 2), np.float32), r"must have the shape \(n, 3\), not \(4, 2\)"),
        (np.zeros((4, 3), np.float64), "must have elements of f4, not f8"),
        ([1, 2, 3], "must be an array of NumPy, or one on a CUDA device .* not list"),
        (Interface((4, 2)), r"must have the shape \(n, 3\), not \(4, 2\)"),
        (Interface((12,)), r"must have the shape \(n, 3\), not \(12,\)"),
        (Interface((4, 3), "<f8"), "must have elements of f4, not f8"),
        (Interface((4, 3), strides=(4, 16)), "must have contiguous rows"),
    ],
)
def test_mistakes_are_named(array, message):
    with pytest.raises(umbel.Error, match=message):
        device_array(array, "positions", ("f4",), 3)


@pytest.mark.parametrize("name", ["cupy", "torch", "numba"])
def test_arrays_are_made_by_the_package_of_the_positions(monkeypatch, name):
    """By what each package calls it; None stands for the array."""
    made = []

    def make(shape, dtype, **more):
        made.append((shape, dtype, more))

    package = types.ModuleType(name)
    package.float32 = "a type"
    package.empty = make
    package.cuda = types.SimpleNamespace(device_array=make)
    monkeypatch.setitem(sys.modules, name, package)
    array = type("Array", (Interface,), {"__module__": f"{name}.of.arrays", "device": "cuda:1"})
    cuda_calls.maker(array((3, 3)))((5, 2), "float32")
    expected = {"torch": ("a type", {"device": "cuda:1"})}.get(name, ("float32", {}))
    assert made == [((5, 2), *expected)]


def test_packages_that_make_no_arrays_are_asked_for_a_function():
    with pytest.raises(umbel.Error, match="give `empty`"):
        cuda_calls.maker(Interface((3, 3)))


def test_values_come_to_the_host_as_each_package_copies_them():
    values = np.arange(2)
    numpy_of = types.SimpleNamespace(numpy=lambda: values)
    for array in (
        types.SimpleNamespace(get=lambda: values),
        types.SimpleNamespace(copy_to_host=lambda: values),
        types.SimpleNamespace(cpu=lambda: numpy_of),
    ):
        assert cuda_calls.on_host(array) is values


def test_a_missing_library_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("UMBEL_CUDA_LIBRARY", str(tmp_path / "none.so"))
    with pytest.raises(umbel.Error, match=r"none\.so cannot be loaded.*make cuda"):
        cuda.FrameClusters(
            Interface((3, 3)), Interface((1, 3), "<u4"), empty=lambda shape, dtype: None
        )
