// The first place where something holds, searched in parallel.
#pragma once

#include <atomic>
#include <cstddef>

#include "base/parallel.hpp"

namespace umbel {

/// The lowest i in [0, count) with holds(i), or count; the same for any number of threads.
template <typename Holds>
size_t first_where(size_t count, size_t chunk, const Holds& holds) {
  std::atomic<size_t> first{count};
  parallel_chunks(count, chunk, [&](size_t begin, size_t end) {
    if (begin > first.load(std::memory_order_relaxed)) return;
    for (size_t i = begin; i < end; ++i) {
      if (!holds(i)) continue;
      size_t seen = first.load(std::memory_order_relaxed);
      while (i < seen && !first.compare_exchange_weak(seen, i)) {
      }
      return;
    }
  });
  return first;
}

}  // namespace umbel
