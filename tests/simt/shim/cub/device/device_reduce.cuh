#pragma once

#include <cub_calls.hpp>
#include <vector>

namespace cub {

struct DeviceReduce {
  /// Tiles in any grouping, and neighbours of their results in any grouping.
  template <typename In, typename Out, typename Op, typename Map, typename T>
  static cudaError_t TransformReduce(void* scratch, size_t& bytes, In in, Out out, int64_t n, Op op,
                                     Map map, T init, cudaStream_t stream) {
    return umbel::simt::cub_call(scratch, bytes, 300 + umbel::simt::some_of(n), stream, [=] {
      std::vector<T> tiles;
      for (size_t i = 0; i < size_t(n);) {
        const size_t end = i + umbel::simt::tile_length(size_t(n) - i);
        T value = map(in[i]);
        for (++i; i < end; ++i) value = op(value, map(in[i]));
        tiles.push_back(value);
      }
      while (tiles.size() > 1) {
        const size_t k = umbel::simt::random_below(uint32_t(tiles.size() - 1));
        tiles[k] = op(tiles[k], tiles[k + 1]);
        tiles.erase(tiles.begin() + std::ptrdiff_t(k) + 1);
      }
      *out = tiles.empty() ? init : op(init, tiles[0]);
    });
  }
};

}  // namespace cub
