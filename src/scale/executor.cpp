#include "scale/executor.hpp"

#include <deque>
#include <utility>

#include "scale/run_task.hpp"

namespace umbel::scale {
namespace {

class LocalExecutor final : public Executor {
 public:
  explicit LocalExecutor(std::filesystem::path work) : work_(std::move(work)) {}
  size_t slots() const override { return 1; }
  void submit(const Task& task) override { waiting_.push_back(task); }
  std::optional<TaskResult> wait(std::chrono::milliseconds /*most*/) override {
    if (waiting_.empty()) return std::nullopt;
    TaskResult result{waiting_.front(), {}, {}};
    waiting_.pop_front();
    run_task(work_, result.task);
    return result;
  }

 private:
  std::filesystem::path work_;
  std::deque<Task> waiting_;
};

}  // namespace

std::unique_ptr<Executor> make_local_executor(std::filesystem::path work) {
  return std::make_unique<LocalExecutor>(std::move(work));
}

void run_all(Executor& executor, std::span<const Task> tasks,
             const std::function<void(size_t done)>& poll) {
  constexpr std::chrono::milliseconds kPatience{50};
  size_t next = 0, under_way = 0, done = 0;
  std::optional<TaskResult> failed;
  while (done < tasks.size()) {
    while (!failed && next < tasks.size() && under_way < executor.slots()) {
      executor.submit(tasks[next++]);
      ++under_way;
    }
    if (under_way == 0) break;
    poll(done);
    const std::optional<TaskResult> result = executor.wait(kPatience);
    if (!result) continue;
    --under_way;
    ++done;
    if (!result->error.empty() && !failed) failed = result;
  }
  if (failed) throw Error(failed->code, failed->error);
  poll(done);
}

}  // namespace umbel::scale
