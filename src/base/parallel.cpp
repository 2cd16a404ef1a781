#include "base/parallel.hpp"

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

#include <algorithm>

namespace umbel {

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
                    [body](const tbb::blocked_range<size_t>& range) {
                      body.run(body.body, range.begin(), range.end());
                    });
}

void detail::run_tasks(Task first, Task second) {
  tbb::parallel_invoke([first] { first.run(first.body); }, [second] { second.run(second.body); });
}

}  // namespace umbel
