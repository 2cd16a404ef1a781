#include "base/parallel.hpp"

#include <tbb/global_control.h>
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

}  // namespace umbel
