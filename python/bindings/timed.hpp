// Seconds of builds: processor time, which other programs disturb less than the wall clock.
#pragma once

#include <chrono>
#include <ctime>

#include "bind.hpp"

namespace umbel::python {

/// Seconds that this thread has worked: the libraries of numbers that Python loads have threads
/// that wait by turning, which the time of the process would count. Where threads have no clock,
/// that of the process.
inline double thread_seconds() {
#ifdef CLOCK_THREAD_CPUTIME_ID
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
#else
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
#endif
}

/// Seconds that `work` took. One thread is timed by the processor time that it used, so that
/// other programs disturb less; several by the clock on the wall.
template <typename Work>
double seconds_of(bool one_thread, const Work& work) {
  const auto wall = std::chrono::steady_clock::now();
  const double processor = thread_seconds();
  work();
  if (one_thread) return thread_seconds() - processor;
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - wall).count();
}

/// Items, ranges and seconds.
using TimedClusters = nb::typed<nb::tuple, Array<uint32_t>, Array<uint32_t>, double>;

}  // namespace umbel::python
