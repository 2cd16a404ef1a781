#include "base/parallel.hpp"

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include <algorithm>
#include <utility>

#include "base/poll.hpp"

namespace umbel {
namespace {

thread_local const std::function<void()>* current_poll = nullptr;

// Inside a loop that another thread has ended by an exception, loops end early too, and what
// follows must not use what they have not made. oneTBB keeps the first exception.
void throw_if_cancelled() {
  if (tbb::is_current_task_group_canceling()) throw Error(ErrorCode::kCancelled, "cancelled");
}

}  // namespace

PollScope::PollScope(const std::function<void()>& poll)
    : before_(std::exchange(current_poll, &poll)) {}
PollScope::~PollScope() { current_poll = before_; }

void poll() {
  if (current_poll) (*current_poll)();
}

void with_threads(uint32_t threads, const std::function<void()>& work) {
  if (threads == 0) {
    work();
    return;
  }
  // oneTBB has no more workers than this for anyone; asked for more, it prints a warning, and
  // makes room for all of them, however many.
  using tbb::global_control;
  const size_t most = global_control::active_value(global_control::max_allowed_parallelism);
  tbb::task_arena arena(static_cast<int>(std::min<size_t>(threads, std::max<size_t>(most, 1))));
  arena.execute(work);
}

size_t usable_threads() { return static_cast<size_t>(tbb::this_task_arena::max_concurrency()); }

void detail::run_ranges(size_t count, size_t grain, RangeBody body) {
  tbb::parallel_for(tbb::blocked_range<size_t>(0, count, grain),
                    [body, grain](const tbb::blocked_range<size_t>& range) {
                      // A range may be long, and another thread may have thrown: a cancelled build
                      // ends soon.
                      for (size_t begin = range.begin(); begin != range.end();) {
                        if (tbb::is_current_task_group_canceling()) return;
                        poll();
                        const size_t end = begin + std::min(grain, range.end() - begin);
                        body.run(body.body, begin, end);
                        begin = end;
                      }
                    });
  throw_if_cancelled();
}

void detail::run_tasks(Task first, Task second) {
  poll();
  tbb::parallel_invoke([first] { first.run(first.body); }, [second] { second.run(second.body); });
  throw_if_cancelled();
}

}  // namespace umbel
