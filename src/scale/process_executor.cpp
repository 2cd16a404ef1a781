#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <map>
#include <thread>
#include <utility>

#include "scale/executor.hpp"
#include "scale/work_folder.hpp"

#if defined(__unix__) || defined(__APPLE__)
#define UMBEL_POSIX_PROCESSES 1
#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>
#if defined(__linux__)
#include <sys/prctl.h>
#endif

extern char** environ;  // NOLINT(readability-redundant-declaration)
#endif

namespace umbel::scale {

#if defined(UMBEL_POSIX_PROCESSES)

namespace {

namespace fs = std::filesystem;

// A process that is killed may have been the largest when memory ran out: it is tried again.
constexpr int kTries = 3;

// A worker ends with this and its error's code.
constexpr int kFirstCode = 10;

class ProcessExecutor final : public Executor {
 public:
  ProcessExecutor(fs::path work, std::vector<std::string> command, size_t workers)
      : work_(std::move(work)), command_(std::move(command)), workers_(workers) {}

  ~ProcessExecutor() override {
    for (const auto& [process, task] : running_) ::kill(process, SIGKILL);
    for (const auto& [process, task] : running_) ::waitpid(process, nullptr, 0);
  }

  size_t slots() const override { return workers_; }

  void submit(const Task& task) override {
    std::vector<std::string> words = command_;
    words.insert(words.end(),
                 {work_.string(), std::to_string(task.tier), std::to_string(task.unit)});
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    const std::string said = error_file(task).string();
    // Otherwise the error would be that of a worker that cannot be started.
    if (!std::ofstream(said))
      throw Error(ErrorCode::kIo,
                  "cannot write " + said + ": " + std::generic_category().message(errno));
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, said.c_str(),
                                     O_WRONLY | O_CREAT | O_TRUNC, 0666);
    posix_spawn_file_actions_adddup2(&actions, STDERR_FILENO, STDOUT_FILENO);
    pid_t process = 0;
    const int error =
        ::posix_spawnp(&process, words[0].c_str(), &actions, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0)
      throw Error(ErrorCode::kIo, "a worker cannot be started: " + words[0] + ": " +
                                      std::generic_category().message(error));
    running_[process] = task;
  }

  std::optional<TaskResult> wait(std::chrono::milliseconds most) override {
    // Most units take seconds; looking more often takes time from them.
    constexpr std::chrono::milliseconds kLongest{25};
    std::chrono::milliseconds step{1};
    for (std::chrono::milliseconds waited{0};;
         waited += step, step = std::min(2 * step, kLongest)) {
      for (const auto& [process, task] : running_) {
        int status = 0;
        const pid_t ended = ::waitpid(process, &status, WNOHANG);
        if (ended == 0 || (ended < 0 && errno != ECHILD)) continue;
        const Task own = task;
        running_.erase(process);
        // Where SIGCHLD is ignored, or somebody else waits for all children, only files tell.
        return finish(own, ended > 0 ? status : status_by_files(own));
      }
      if (waited >= most) return std::nullopt;
      std::this_thread::sleep_for(step);
    }
  }

 private:
  fs::path error_file(const Task& task) const { return unit_file(work_, task, ".said"); }

  // A worker that neither finished nor reported an error was killed.
  int status_by_files(const Task& task) const {
    if (fs::exists(unit_file(work_, task, ".done"))) return 0;
    std::error_code error;
    const bool has_said = fs::file_size(error_file(task), error) > 0 && !error;
    return has_said ? (kFirstCode + static_cast<int>(ErrorCode::kUnsupported)) << 8 : SIGKILL;
  }

  std::optional<TaskResult> finish(const Task& task, int status) {
    const fs::path path = error_file(task);
    std::ifstream file(path, std::ios::binary);
    std::string said{std::istreambuf_iterator<char>(file), {}};
    std::error_code ignored;
    fs::remove(path, ignored);
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return TaskResult{task, {}, {}};
    while (!said.empty() && (said.back() == '\n' || said.back() == '\r')) said.pop_back();
    const std::string name =
        "unit " + std::to_string(task.unit) + " of tier " + std::to_string(task.tier);
    if (WIFSIGNALED(status)) {
      if (++killed_[{task.tier, task.unit}] < kTries) {
        workers_ = std::max<size_t>(1, workers_ / 2);
        submit(task);
        return std::nullopt;
      }
      said = name + " was killed " + std::to_string(kTries) + " times, by signal " +
             std::to_string(WTERMSIG(status)) +
             ": most likely memory ran out; give more, and go on with resume";
      return TaskResult{task, said, ErrorCode::kIo};
    }
    // The last line is the sentence; what is above it is for those who look for a fault.
    const size_t line = said.find_last_of('\n');
    if (line != std::string::npos) said = said.substr(line + 1);
    const ErrorCode code = code_of(WEXITSTATUS(status));
    if (said.empty()) {
      said = name + " could not be built";
      if (code == ErrorCode::kIo)
        said += ", and why could not be written to " + work_.string() +
                ": most likely the disk is full";
    }
    return TaskResult{task, said, code};
  }

  static ErrorCode code_of(int status) {
    const int code = status - kFirstCode;
    const bool is_code = code >= 0 && code <= static_cast<int>(ErrorCode::kDevice);
    return is_code ? static_cast<ErrorCode>(code) : ErrorCode::kUnsupported;
  }

  fs::path work_;
  std::vector<std::string> command_;
  size_t workers_;
  std::map<pid_t, Task> running_;
  std::map<std::pair<uint32_t, uint32_t>, int> killed_;
};

}  // namespace

std::unique_ptr<Executor> make_process_executor(fs::path work, std::vector<std::string> command,
                                                size_t workers) {
  return std::make_unique<ProcessExecutor>(std::move(work), std::move(command), workers);
}

void begin_worker() {
  std::signal(SIGINT, SIG_IGN);
#if defined(__linux__)
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
#endif
}

#else

std::unique_ptr<Executor> make_process_executor(std::filesystem::path work,
                                                std::vector<std::string> /*command*/,
                                                size_t /*workers*/) {
  return make_local_executor(std::move(work));
}

void begin_worker() {}

#endif

}  // namespace umbel::scale
