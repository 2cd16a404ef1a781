// See plain_threads.h.
#pragma once

#include <any>
#include <condition_variable>
#include <iterator>
#include <type_traits>

#include "plain_threads.h"

namespace tbb {

enum class filter_mode { parallel, serial_in_order };

class flow_control {
 public:
  void stop() { stopped = true; }
  bool stopped = false;
};

namespace plain_threads {
/// What a filter does.
struct Stage {
  filter_mode mode;
  std::function<std::any(std::any, flow_control&)> call;
};
}  // namespace plain_threads

template <typename Input, typename Output>
struct filter {
  std::vector<plain_threads::Stage> stages;

  template <typename Last>
  filter<Input, Last> operator&(const filter<Output, Last>& next) const {
    filter<Input, Last> both{stages};
    std::copy(next.stages.begin(), next.stages.end(), std::back_inserter(both.stages));
    return both;
  }
};

template <typename Input, typename Output, typename Body>
filter<Input, Output> make_filter(filter_mode mode, const Body& body) {
  const auto call = [body](std::any given, flow_control& control) -> std::any {
    if constexpr (std::is_void_v<Input>)
      return body(control);
    else if constexpr (std::is_void_v<Output>)
      return body(std::any_cast<Input>(given)), std::any();
    else
      return body(std::any_cast<Input>(given));
  };
  return {{{mode, call}}};
}

/// The first stage is taken to be serial. A thread takes an item through all stages; once one
/// fails, those that wait for their turn give up.
inline void parallel_pipeline(size_t at_once, const filter<void, void>& pipeline) {
  const std::vector<plain_threads::Stage>& stages = pipeline.stages;
  std::mutex mutex;
  std::condition_variable moved;
  std::vector<size_t> turns(stages.size());  // of serial stages: whose turn it is
  flow_control control;
  bool failed = false;
  const auto take_one = [&] {
    std::unique_lock lock(mutex);
    if (control.stopped || failed) return false;
    std::any item = stages[0].call({}, control);
    if (control.stopped) return false;
    const size_t number = turns[0]++;
    for (size_t i = 1; i < stages.size(); ++i) {
      const bool serial = stages[i].mode == filter_mode::serial_in_order;
      if (serial) moved.wait(lock, [&] { return failed || turns[i] == number; });
      if (failed) return false;
      lock.unlock();
      item = stages[i].call(std::move(item), control);
      lock.lock();
      if (serial) ++turns[i];
      moved.notify_all();
    }
    return true;
  };
  const auto take_all = [&](size_t) {
    try {
      while (take_one()) {
      }
    } catch (...) {
      const std::lock_guard lock(mutex);
      failed = true;
      moved.notify_all();
      throw;
    }
  };
  plain_threads::run(std::min(at_once, static_cast<size_t>(plain_threads::limit)), take_all);
}

}  // namespace tbb
