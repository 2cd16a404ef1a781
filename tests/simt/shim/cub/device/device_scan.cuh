#pragma once

#include <cub_calls.hpp>
#include <utility>
#include <vector>

namespace cub {

struct DeviceScan {
  /// Tiles are read one after another, but may be written later.
  template <typename In, typename T>
  static cudaError_t ExclusiveSum(void* scratch, size_t& bytes, In in, T* out, int64_t n,
                                  cudaStream_t stream) {
    return umbel::simt::cub_call(scratch, bytes, 500 + umbel::simt::some_of(n), stream, [=] {
      std::vector<std::pair<size_t, T>> late;
      const auto write = [&] {
        for (const auto& [i, value] : late) out[i] = value;
        late.clear();
      };
      T sum = 0;
      for (size_t i = 0; i < size_t(n);) {
        const size_t end = i + umbel::simt::tile_length(size_t(n) - i);
        for (; i < end; ++i) {
          const T value = in[i];
          late.emplace_back(i, sum);
          sum = T(sum + value);
        }
        if (umbel::simt::random_below(2)) write();
      }
      write();
    });
  }
};

}  // namespace cub
