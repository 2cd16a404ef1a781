// How much memory a piece of work takes.
#pragma once

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <string>

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace bench {

/// A line of /proc/self/status, in KiB; 0 where there is no such file.
inline double status_kib(const char* key) {
  std::ifstream file("/proc/self/status");
  for (std::string line; std::getline(file, line);)
    if (line.rfind(key, 0) == 0) return std::strtod(line.c_str() + std::strlen(key), nullptr);
  return 0;
}

/// Memory that `work` needs at its peak, above what the process has already.
inline double peak_mib(const std::function<void()>& work) {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
  std::ofstream("/proc/self/clear_refs") << "5";  // sets the peak to what is resident now
  const double before = status_kib("VmRSS:");
  work();
  return (status_kib("VmHWM:") - before) / 1024;
}

}  // namespace bench
