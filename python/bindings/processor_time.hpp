// Processor time, which other programs disturb less than the wall clock.
#pragma once

#include <ctime>

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

}  // namespace umbel::python
