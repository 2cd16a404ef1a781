#pragma once

#include <algorithm>
#include <cub_calls.hpp>
#include <utility>
#include <vector>

namespace cub {

template <typename T>
struct DoubleBuffer {
  T* buffers[2];
  int selector = 0;
  DoubleBuffer(T* current, T* other) : buffers{current, other} {}
  T* Current() const { return buffers[selector]; }
};

struct DeviceRadixSort {
  /// The result may be in either buffer, and the other one is rubbish.
  template <typename Key, typename Value>
  static cudaError_t SortPairs(void* scratch, size_t& bytes, DoubleBuffer<Key>& keys,
                               DoubleBuffer<Value>& values, int64_t n, int first, int last,
                               cudaStream_t stream) {
    const auto from_keys = keys;
    const auto from_values = values;
    const int to = scratch ? int(umbel::simt::random_below(2)) : 0;
    if (scratch) keys.selector = values.selector = to;
    return umbel::simt::cub_call(scratch, bytes, 900 + umbel::simt::some_of(n), stream, [=] {
      const Key mask = (last - first < int(sizeof(Key) * 8) ? (Key(1) << (last - first)) : 0) - 1;
      std::vector<std::pair<Key, Value>> pairs;
      for (int64_t i = 0; i < n; ++i)
        pairs.emplace_back(from_keys.Current()[i], from_values.Current()[i]);
      std::stable_sort(pairs.begin(), pairs.end(), [=](const auto& a, const auto& b) {
        return (a.first >> first & mask) < (b.first >> first & mask);
      });
      for (int64_t i = 0; i < n; ++i) {
        from_keys.buffers[to][i] = pairs[size_t(i)].first;
        from_values.buffers[to][i] = pairs[size_t(i)].second;
      }
      memset(from_keys.buffers[1 - to], 0x5e, size_t(n) * sizeof(Key));
      memset(from_values.buffers[1 - to], 0x5e, size_t(n) * sizeof(Value));
    });
  }
};

}  // namespace cub
