// Progress of work that many threads do together: all count, and the thread that called the build
// reports.
#pragma once

#include <algorithm>
#include <atomic>
#include <exception>
#include <string_view>
#include <thread>

#include "base/progress.hpp"

namespace umbel {

class SharedProgress {
 public:
  enum class OnCancel {
    /// The exception is kept until `finish`, and threads ask `is_stopped` for what to skip: for
    /// parts that are joined, of which oneTBB would leave out some without a word to the others.
    kStop,
    /// `add` throws, and oneTBB starts nothing more: for work whose result nobody sees then.
    kThrow,
  };

  /// Reports fractions between `from` and `to` of `stage` as `work` of it is done. Made by the
  /// thread that called the build.
  SharedProgress(Progress& progress, std::string_view stage, double from, double to, uint64_t work,
                 OnCancel on_cancel = OnCancel::kStop)
      : progress_(progress),
        stage_(stage),
        from_(from),
        scale_((to - from) / double(std::max<uint64_t>(work, 1))),
        on_cancel_(on_cancel) {}

  /// Whether what is left should be skipped.
  bool is_stopped() const { return stopped_.load(std::memory_order_relaxed); }

  void add(uint64_t done) {
    const uint64_t all = done_.fetch_add(done, std::memory_order_relaxed) + done;
    if (is_stopped() || std::this_thread::get_id() != caller_) return;
    try {
      progress_.report(from_ + scale_ * double(all), stage_);
    } catch (...) {
      if (on_cancel_ == OnCancel::kThrow) throw;
      cancellation_ = std::current_exception();
      stopped_ = true;
    }
  }

  /// Throws what the caller's callback asked for, once no thread works any more.
  void finish() const {
    if (cancellation_) std::rethrow_exception(cancellation_);
  }

 private:
  Progress& progress_;
  std::string_view stage_;
  double from_, scale_;
  OnCancel on_cancel_;
  const std::thread::id caller_ = std::this_thread::get_id();
  std::atomic<uint64_t> done_{0};
  std::atomic<bool> stopped_{false};
  std::exception_ptr cancellation_;
};

}  // namespace umbel
