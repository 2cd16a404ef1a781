// Measures the most heap that a piece of work uses, and makes single allocations fail. Both replace
// operator new, which sanitizers do too: there neither works.
#pragma once

#include <cstddef>
#include <new>

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

/// While it lives, one allocation of this thread fails: the first, or that after `others`. One at a
/// time.
class FailingAllocation {
 public:
  /// Whether one can be made to fail here.
  static bool works() { return HeapPeak::counts(); }
  explicit FailingAllocation(size_t others);
  ~FailingAllocation();
  FailingAllocation(const FailingAllocation&) = delete;
  FailingAllocation& operator=(const FailingAllocation&) = delete;
  /// Whether there were so many.
  bool has_failed() const;
};

/// Calls work() again and again, each time with a later allocation that fails, and after each
/// failure check(), until all goes well.
template <typename Work, typename Check>
void fail_each_allocation(const Work& work, const Check& check) {
  for (size_t others = 0;; ++others) {
    bool done = false;
    {
      const FailingAllocation failing(others);
      try {
        work();
        done = !failing.has_failed();
      } catch (const std::bad_alloc&) {
        done = false;
      }
    }
    if (done) return;
    check();
  }
}

}  // namespace umbel::testing
