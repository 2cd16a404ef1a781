// The few functions of oneTBB that Umbel calls, on plain threads, for the thread sanitizer.
//
// The sanitizer sees only what it has compiled, and an installed oneTBB is not: it would report
// every task as a race with whoever spawned it. Threads made and joined here are seen, so what
// is reported in a build with this folder before oneTBB's own is Umbel's. Slow, and meant to be.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace tbb::plain_threads {

/// Threads that a loop may use, its caller's included.
inline thread_local int limit = 4;
/// Threads that all loops together have started, so that nested loops do not start thousands.
inline std::atomic<int> started{0};
constexpr int kMostStarted = 8;

/// Calls work(i) for i in [0, count) on several threads, and throws what the first to fail threw.
inline void run(size_t count, const std::function<void(size_t)>& work) {
  std::atomic<size_t> next{0};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto take = [&] {
    for (size_t i = next++; i < count; i = next++) {
      try {
        work(i);
      } catch (...) {
        next = count;
        const std::lock_guard lock(failure_mutex);
        if (!failure) failure = std::current_exception();
      }
    }
  };
  std::vector<std::thread> helpers;
  const size_t wanted = std::min<size_t>(count, static_cast<size_t>(limit));
  for (size_t i = 1; i < wanted; ++i) {
    if (++started > kMostStarted) {
      --started;
      break;
    }
    helpers.emplace_back([&, inherited = limit] {
      limit = inherited;
      take();
      --started;
    });
  }
  take();
  for (std::thread& helper : helpers) helper.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace tbb::plain_threads
