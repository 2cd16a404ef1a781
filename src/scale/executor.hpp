// Who runs the tasks of a tier. Data go through the work folder, never through the executor: it
// gets a task's name and gives back whether it is done. So a cluster's scheduler can be one.
#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "scale/tiers.hpp"

namespace umbel::scale {

struct TaskResult {
  Task task;
  std::string error;  ///< a sentence, or empty where the task is done
  ErrorCode code = ErrorCode::kUnsupported;
};

class Executor {
 public:
  virtual ~Executor() = default;
  /// Tasks that may be under way at once.
  virtual size_t slots() const = 0;
  virtual void submit(const Task& task) = 0;
  /// One that has ended, or nothing after so long.
  virtual std::optional<TaskResult> wait(std::chrono::milliseconds most) = 0;
};

/// Runs all tasks and returns when all are done. `poll` is called now and then with how many are,
/// and may throw. Throws the first task's error that there is, once no more are under way.
void run_all(Executor& executor, std::span<const Task> tasks,
             const std::function<void(size_t done)>& poll);

/// Tasks in this process, one after the other.
std::unique_ptr<Executor> make_local_executor(std::filesystem::path work);

/// Tasks in processes of their own, `workers` at a time: `command` with the work folder, the tier
/// and the unit appended, which must call run_task, and end with 0, or write one sentence to
/// standard error and end with another status. One that is killed is started again, twice, alone at
/// last. They end with this process.
std::unique_ptr<Executor> make_process_executor(std::filesystem::path work,
                                                std::vector<std::string> command, size_t workers);

/// What such a process calls first: it ends when the one that started it does, and leaves Ctrl-C
/// to that.
void begin_worker();

}  // namespace umbel::scale
