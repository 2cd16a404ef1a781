// The one way to run in parallel. Work is numbered by position and results are stored by that
// number, so nothing depends on which thread finishes first.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <cstddef>
#include <functional>

#include "umbel/types.hpp"

namespace umbel {

/// Runs `work` with at most `threads` threads (0: all cores) for every parallel loop inside it.
void with_threads(uint32_t threads, const std::function<void()>& work);

/// Calls body(i) for i in [0, count), in chunks of at least `grain`.
template <typename Body>
void parallel_for(size_t count, size_t grain, const Body& body) {
  if (count <= grain) {
    for (size_t i = 0; i < count; ++i) body(i);
    return;
  }
  tbb::parallel_for(tbb::blocked_range<size_t>(0, count, grain),
                    [&](const tbb::blocked_range<size_t>& range) {
                      for (size_t i = range.begin(); i != range.end(); ++i) body(i);
                    });
}

/// Calls body(begin, end) for chunks of exactly `chunk` (the last may be smaller). The chunks do
/// not depend on the number of threads, so reductions over them are deterministic.
template <typename Body>
void parallel_chunks(size_t count, size_t chunk, const Body& body) {
  parallel_for((count + chunk - 1) / chunk, 1, [&](size_t i) {
    const size_t begin = i * chunk;
    body(begin, std::min(begin + chunk, count));
  });
}

}  // namespace umbel
