// Command lines of benchmarks: options, and files.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "ply_reader.hpp"

namespace bench {

/// A switch, a text, or what takes a number, which is at least 1.
struct Option {
  std::string name;
  std::variant<bool*, std::string*, std::function<void(uint64_t)>> to;
};

/// Sets options; returns the words that are none: files. Ends the program where one has no value,
/// or does not exist.
inline std::vector<std::string> read_arguments(int count, char** words,
                                               const std::vector<Option>& options,
                                               const char* needs_files = nullptr) {
  std::vector<std::string> files;
  for (int i = 1; i < count; ++i) {
    const std::string word = words[i];
    if (!word.starts_with("--")) {
      files.push_back(word);
      continue;
    }
    std::string known;
    const Option* option = nullptr;
    for (const Option& o : options) {
      known += (known.empty() ? "" : ", ") + o.name;
      if (o.name == word) option = &o;
    }
    if (!option) fail(word, ("is not an option; there are " + known).c_str());
    if (bool* const* on = std::get_if<bool*>(&option->to)) {
      **on = true;
      continue;
    }
    if (++i == count) fail(word, "needs a value");
    if (std::string* const* text = std::get_if<std::string*>(&option->to))
      **text = words[i];
    else
      std::get<2>(option->to)(std::max(1ull, std::strtoull(words[i], nullptr, 10)));
  }
  if (needs_files && files.empty()) {
    std::fprintf(stderr, "usage: %s %s\n", words[0], needs_files);
    std::exit(2);
  }
  return files;
}

}  // namespace bench
