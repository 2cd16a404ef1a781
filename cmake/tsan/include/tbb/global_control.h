// See plain_threads.h.
#pragma once

#include <cstddef>

namespace tbb {

class global_control {
 public:
  enum parameter { max_allowed_parallelism };

  /// More threads than there are cores are welcome here: they meet in more ways.
  static size_t active_value(parameter) { return 64; }
};

}  // namespace tbb
