// The border between C++ and C: what every exported function runs inside.
#pragma once

#include <string>

#include "umbel/umbel_base.h"

namespace umbel::capi {

/// Thrown where an output array is too small.
struct CapacityError {
  std::string sentence;
};

/// Turns the exception that is being handled into a result and this thread's last sentence.
umbel_result report_exception() noexcept;

/// Runs `work` and reports whatever it throws. A template, since std::function may have to
/// allocate.
template <typename Work>
umbel_result guard(const Work& work) noexcept {
  try {
    work();
    return UMBEL_OK;
  } catch (...) {
    return report_exception();
  }
}

}  // namespace umbel::capi
