// A stage of one long piece of parallel work, which is still cancelled soon.
#pragma once

#include <chrono>
#include <functional>
#include <string_view>

#include "base/poll.hpp"
#include "base/progress.hpp"

namespace umbel {

/// Reports the beginning of a stage and, as long as it lives, the same again every 20 milliseconds
/// from within the parallel loops that its thread begins: the callback can end them. Parallel loops
/// of the callback itself report nothing. Not for work whose threads wait for each other.
class PolledStage {
 public:
  PolledStage(Progress& progress, double fraction, std::string_view stage)
      : poll_([=, this, &progress] {
          if (is_reporting_ || Clock::now() - last_ < std::chrono::milliseconds(20)) return;
          is_reporting_ = true;
          progress.report(fraction, stage);
          is_reporting_ = false;
          last_ = Clock::now();
        }),
        scope_(poll_) {
    progress.report(fraction, stage);
    is_reporting_ = false;
  }
  PolledStage(const PolledStage&) = delete;
  PolledStage& operator=(const PolledStage&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  bool is_reporting_ = true;  ///< the beginning
  Clock::time_point last_ = Clock::now();
  std::function<void()> poll_;
  PollScope scope_;
};

}  // namespace umbel
