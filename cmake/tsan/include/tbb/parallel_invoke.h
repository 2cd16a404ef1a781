// See plain_threads.h.
#pragma once

#include "plain_threads.h"

namespace tbb {

template <typename... Functions>
void parallel_invoke(const Functions&... functions) {
  const std::function<void()> calls[] = {std::function<void()>(std::cref(functions))...};
  plain_threads::run(sizeof...(functions), [&](size_t i) { calls[i](); });
}

}  // namespace tbb
