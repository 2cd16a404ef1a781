#pragma once

#include <cub_calls.hpp>

namespace cub {

struct DeviceSelect {
  template <typename In, typename Out, typename Count, typename Keep>
  static cudaError_t If(void* scratch, size_t& bytes, In in, Out out, Count* count, int64_t n,
                        Keep keep, cudaStream_t stream) {
    return umbel::simt::cub_call(scratch, bytes, 700 + umbel::simt::some_of(n), stream, [=] {
      Count kept = 0;
      for (size_t i = 0; i < size_t(n); ++i) {
        const auto value = in[i];
        if (keep(value)) out[kept++] = value;
      }
      *count = kept;
    });
  }
};

}  // namespace cub
