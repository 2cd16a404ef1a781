// Times on the processor, and the arguments of programs that measure.
#pragma once

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "clocks.hpp"

namespace bench {

/// Milliseconds of one thread of the processor; works take turns, after a warm-up.
inline std::vector<double> processor_milliseconds(const std::vector<std::function<void()>>& works,
                                                  int runs) {
  std::vector<std::vector<double>> times(works.size());
  for (int run = -1; run < runs; ++run)
    for (size_t k = 0; k < works.size(); ++k) {
      const double start = thread_seconds();
      works[k]();
      if (run >= 0) times[k].push_back(1e3 * (thread_seconds() - start));
    }
  std::vector<double> medians;
  for (const auto& of_work : times) medians.push_back(median(of_work));
  return medians;
}

/// `--name value` as often as one likes, and meshes.
class Arguments {
 public:
  Arguments(int argc, char** argv) {
    for (int i = 1; i < argc; ++i) {
      const std::string argument = argv[i];
      if (argument.starts_with("--") && i + 1 < argc)
        options_.emplace_back(argument.substr(2), argv[++i]);
      else
        meshes_.push_back(argument);
    }
  }

  const std::vector<std::string>& meshes() const { return meshes_; }
  std::vector<std::string> all(const std::string& name) const {
    std::vector<std::string> values;
    for (const auto& [option, value] : options_)
      if (option == name) values.push_back(value);
    return values;
  }
  /// The last one given, from `least` on.
  int number(const std::string& name, int otherwise, int least) const {
    const std::vector<std::string> values = all(name);
    if (values.empty()) return otherwise;
    return std::max(least, static_cast<int>(std::strtol(values.back().c_str(), nullptr, 10)));
  }

 private:
  std::vector<std::pair<std::string, std::string>> options_;
  std::vector<std::string> meshes_;
};

/// The body of a program `name`: run(arguments) gives its status.
template <typename Run>
int run_program(const char* name, int argc, char** argv, const Run& run) try {
  return run(Arguments(argc, argv));
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s: %s\n", name, error.what());
  return 1;
}

}  // namespace bench
