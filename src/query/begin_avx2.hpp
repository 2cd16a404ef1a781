// From here to end_target.hpp, functions are compiled for AVX2 with FMA, whatever the rest of the
// file is compiled for. To be included before the templates that are meant; what these include from
// the standard library stands here, since it is not meant.
#pragma once

#include <immintrin.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <type_traits>

#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2,fma,bmi,bmi2,lzcnt,popcnt"))), \
                             apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2,fma,bmi,bmi2,lzcnt,popcnt")
#endif
// There are fused multiplications and additions. GCC decides on __FMA__ before it sees the pragma.
#define UMBEL_FMA
