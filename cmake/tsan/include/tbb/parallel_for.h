// See plain_threads.h.
#pragma once

#include <tbb/blocked_range.h>

#include "plain_threads.h"

namespace tbb {

template <typename Index, typename Body>
void parallel_for(const blocked_range<Index>& range, const Body& body) {
  const size_t count = range.size();
  // Chunks of at least the grain, and some to each thread.
  const size_t chunk = std::max<size_t>(range.grainsize(), count / 16 + 1);
  plain_threads::run((count + chunk - 1) / chunk, [&](size_t i) {
    const Index begin = range.begin() + static_cast<Index>(i * chunk);
    const Index end = range.begin() + static_cast<Index>(std::min((i + 1) * chunk, count));
    body(blocked_range<Index>(begin, end, range.grainsize()));
  });
}

template <typename Index, typename Body>
void parallel_for(Index first, Index last, const Body& body) {
  parallel_for(blocked_range<Index>(first, last), [&](const blocked_range<Index>& range) {
    for (Index i = range.begin(); i != range.end(); ++i) body(i);
  });
}

}  // namespace tbb
