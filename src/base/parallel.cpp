#include "base/parallel.hpp"

#include <tbb/task_arena.h>

namespace umbel {

void with_threads(uint32_t threads, const std::function<void()>& work) {
  if (threads == 0) {
    work();
    return;
  }
  tbb::task_arena arena(static_cast<int>(threads));
  arena.execute(work);
}

}  // namespace umbel
