// What this machine or its driver lacks, told from failures: tests skip with its sentence.
#pragma once

#include <stdexcept>

namespace sample {
struct Unavailable : std::runtime_error {
  using std::runtime_error::runtime_error;
};
}  // namespace sample
