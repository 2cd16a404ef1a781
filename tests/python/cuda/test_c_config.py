"""The configuration of umbel_cuda_bvh.h, as callers of several versions have it."""

from __future__ import annotations

import ctypes

import pytest

from helpers.cuda_packages import ON_PROCESSOR

KNOWN = 60
"""The struct's size in this version."""


@pytest.fixture(scope="module")
def library():
    if not ON_PROCESSOR.is_file():
        pytest.skip(f"{ON_PROCESSOR.name} is not built")
    found = ctypes.CDLL(str(ON_PROCESSOR))
    found.umbel_last_error.restype = ctypes.c_char_p
    return found


def made(library, size, builder):
    config = (ctypes.c_uint8 * 100)(*[99] * 100)
    result = library.umbel_cuda_bvh_config_init_sized(config, ctypes.c_size_t(size), builder)
    return result, bytes(config)


def words(config):
    return memoryview(config).cast("I").tolist()


def test_no_byte_beyond_the_callers_struct_is_written(library):
    _, expected = made(library, KNOWN, b"ploc")
    assert words(expected)[:2] == [KNOWN, 3]
    for size in (8, KNOWN - 4, KNOWN, KNOWN + 16):
        result, config = made(library, size, b"ploc")
        assert result == 0
        assert words(config)[0] == size
        assert config[4 : min(size, KNOWN)] == expected[4 : min(size, KNOWN)]
        assert set(config[KNOWN:size]) <= {0} and set(config[size:]) == {99}


def test_a_newer_callers_config_builds(library):
    _, config = made(library, KNOWN + 16, None)
    counts = ctypes.c_uint32(), ctypes.c_uint32()
    given = ctypes.c_uint32(10), config, *map(ctypes.byref, counts)
    assert library.umbel_cuda_bvh_capacity(*given) == 0
    assert counts[1].value == 10


def test_an_unknown_builder_leaves_the_config_as_it_is(library):
    result, config = made(library, KNOWN, b"pluck")
    assert result == 1 and b"pluck" in library.umbel_last_error()
    assert set(config) == {99}
