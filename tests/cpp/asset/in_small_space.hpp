// A limit on the size of files stands in for a full disk; the write fails in the same place.
#pragma once

#if defined(__unix__)

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <functional>

namespace umbel::testing {

/// Runs `works` in a process whose files may have so many bytes; whether it returned true.
inline bool in_small_space(rlim_t bytes, const std::function<bool()>& works) {
  const pid_t child = ::fork();
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{bytes, bytes};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    ::_exit(works() ? 0 : 1);
  }
  int status = 0;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace umbel::testing

#endif
