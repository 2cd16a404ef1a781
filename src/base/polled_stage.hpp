// A stage of one long piece of parallel work, which is still cancelled soon.
#pragma once

#include <chrono>
#include <functional>
#include <string_view>

#include "base/poll.hpp"
#include "base/progress.hpp"

namespace umbel {

/// Reports the beginning of a stage and, as long as it lives, the same again a few times a second
/// from within the parallel loops that its thread begins: the callback can end them. Not for work
/// whose threads wait for each other.
class PolledStage {
 public:
  PolledStage(Progress& progress, double fraction, std::string_view stage)
      : poll_([=, this, &progress] {
          const auto now = std::chrono::steady_clock::now();
          if (now - last_ < std::chrono::milliseconds(20)) return;
          last_ = now;
          progress.report(fraction, stage);
        }),
        scope_(poll_) {
    progress.report(fraction, stage);
  }
  PolledStage(const PolledStage&) = delete;
  PolledStage& operator=(const PolledStage&) = delete;

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
  std::function<void()> poll_;
  PollScope scope_;
};

}  // namespace umbel
