// See plain_threads.h.
#pragma once

#include "plain_threads.h"

namespace tbb {

class task_arena {
 public:
  static constexpr int automatic = -1;

  explicit task_arena(int threads = automatic)
      : threads_(threads == automatic ? plain_threads::limit : threads) {}

  template <typename Function>
  auto execute(const Function& function) {
    const Restore restore{plain_threads::limit};
    plain_threads::limit = threads_;
    return function();
  }

  int max_concurrency() const { return threads_; }

 private:
  struct Restore {
    int before;
    ~Restore() { plain_threads::limit = before; }
  };
  int threads_;
};

namespace this_task_arena {
inline int max_concurrency() { return plain_threads::limit; }

/// A thread here never takes up another loop's work while it waits.
template <typename Function>
auto isolate(const Function& function) {
  return function();
}
}  // namespace this_task_arena

}  // namespace tbb
