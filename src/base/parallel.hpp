// The one way to run in parallel. Work is numbered by position and results are stored by that
// number, so nothing depends on which thread finishes first.
//
// oneTBB's headers take as long to compile as most files of the library, so only parallel.cpp
// includes them for what is here; a loop reaches it by a pointer to a function that runs a range.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>

#include "umbel/types.hpp"

namespace umbel {

/// Runs `work` with at most `threads` threads (0: all cores) for every parallel loop inside it.
void with_threads(uint32_t threads, const std::function<void()>& work);

/// How many threads a parallel loop that begins here may have.
size_t usable_threads();

namespace detail {

/// A function object without its type: calls it for [begin, end).
struct RangeBody {
  const void* body;
  void (*run)(const void* body, size_t begin, size_t end);
};
void run_ranges(size_t count, size_t grain, RangeBody body);

/// A function object without its type.
struct Task {
  const void* body;
  void (*run)(const void* body);
};
void run_tasks(Task first, Task second);

template <typename Body>
Task task_of(const Body& body) {
  return {&body, [](const void* erased) { (*static_cast<const Body*>(erased))(); }};
}

}  // namespace detail

/// Calls body(i) for i in [0, count), in chunks of at least `grain`.
template <typename Body>
void parallel_for(size_t count, size_t grain, const Body& body) {
  const auto run = [](const void* erased, size_t begin, size_t end) {
    const Body& body_of_range = *static_cast<const Body*>(erased);
    for (size_t i = begin; i != end; ++i) body_of_range(i);
  };
#if defined(__clang_analyzer__)
  grain = count;  // it would not see what the body writes behind the pointer
#endif
  if (count <= grain) return run(&body, 0, count);
  detail::run_ranges(count, grain, {&body, run});
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

/// Calls first() and second(), at the same time where there is a thread for it.
template <typename First, typename Second>
void parallel_invoke(const First& first, const Second& second) {
  detail::run_tasks(detail::task_of(first), detail::task_of(second));
}

}  // namespace umbel
