// Work that all threads do, but whose results are placed one after the other, such as parts of an
// array whose sizes are not known before they are made.
#pragma once

#include <tbb/parallel_pipeline.h>

#include <cstddef>
#include <mutex>
#include <vector>

#include "base/parallel.hpp"

namespace umbel {

/// For each number in [0, count), with a `Scratch` that serves one number at a time and is used
/// again: make(number, scratch) by any thread, then place(number, scratch) after that of the number
/// before, then finish(number, scratch) by any thread.
template <typename Scratch, typename Make, typename Place, typename Finish>
void in_order(size_t count, const Make& make, const Place& place, const Finish& finish) {
  const size_t threads = usable_threads();
  if (threads == 1 || count < 2) {
    Scratch scratch;
    for (size_t i = 0; i < count; ++i) {
      make(i, scratch);
      place(i, scratch);
      finish(i, scratch);
    }
    return;
  }
  struct Job {
    size_t number;
    Scratch* scratch;
  };
  const size_t at_once = 2 * threads;
  std::vector<Scratch> all(at_once);
  std::vector<Scratch*> unused;
  for (Scratch& scratch : all) unused.push_back(&scratch);
  std::mutex mutex;
  size_t next = 0;
  const auto take = [&](tbb::flow_control& control) -> Job {
    if (next == count) {
      control.stop();
      return {};
    }
    const std::lock_guard lock(mutex);
    Scratch* scratch = unused.back();
    unused.pop_back();
    return {next++, scratch};
  };
  const auto made = [&](Job job) {
    make(job.number, *job.scratch);
    return job;
  };
  const auto placed = [&](Job job) {
    place(job.number, *job.scratch);
    return job;
  };
  const auto finished = [&](Job job) {
    finish(job.number, *job.scratch);
    const std::lock_guard lock(mutex);
    unused.push_back(job.scratch);
  };
  using tbb::filter_mode, tbb::make_filter;
  tbb::parallel_pipeline(at_once, make_filter<void, Job>(filter_mode::serial_in_order, take) &
                                      make_filter<Job, Job>(filter_mode::parallel, made) &
                                      make_filter<Job, Job>(filter_mode::serial_in_order, placed) &
                                      make_filter<Job, void>(filter_mode::parallel, finished));
}

}  // namespace umbel
