// A function that is called now and then during long loops, for callers who must look for
// something.
#pragma once

#include <functional>

namespace umbel {

/// While it lives, parallel loops that its thread begins call `poll` on that thread, between parts
/// of their work, and so do pairs of tasks before they begin. What it throws ends the work.
class PollScope {
 public:
  explicit PollScope(const std::function<void()>& poll);
  ~PollScope();
  PollScope(const PollScope&) = delete;
  PollScope& operator=(const PollScope&) = delete;

 private:
  const std::function<void()>* before_;
};

/// Calls the function of this thread's PollScope, if there is one: for long loops on one thread.
void poll();

}  // namespace umbel
