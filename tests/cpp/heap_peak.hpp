// How many bytes of the heap a piece of work needs at its peak, counted by operator new.
#pragma once

#include <cstddef>

namespace umbel::testing {

/// From its making on; one at a time.
class HeapPeak {
 public:
  /// Whether bytes can be counted here.
  static bool counts();
  HeapPeak();
  /// Most bytes that were in use at once, above those at the beginning.
  size_t bytes() const;

 private:
  size_t before_;
};

}  // namespace umbel::testing
