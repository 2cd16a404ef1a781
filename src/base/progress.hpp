// Progress and cancellation for long builds.
#pragma once

#include <algorithm>
#include <string_view>

#include "umbel/types.hpp"

namespace umbel {

/// Reports to the caller's callback; throws kCancelled when it asks to stop. Called from the
/// thread that called the build, never from workers.
class Progress {
 public:
  explicit Progress(const BuildOptions& options) : options_(options) {}

  void report(double fraction, std::string_view stage) {
    if (!options_.progress) return;
    highest_ = std::max(highest_, static_cast<float>(std::clamp(fraction, 0.0, 1.0)));
    if (!options_.progress(highest_, stage))
      throw Error(ErrorCode::kCancelled, "cancelled (" + std::string(stage) + ")");
  }

 private:
  const BuildOptions& options_;
  float highest_ = 0.0f;
};

}  // namespace umbel
