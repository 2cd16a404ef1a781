// How functions refuse arguments.
#pragma once

#include <string>

#include "umbel/types.hpp"

namespace umbel {

/// Throws kInvalidArgument.
[[noreturn]] inline void refuse(const std::string& sentence) {
  throw Error(ErrorCode::kInvalidArgument, sentence);
}

inline void require(bool holds, const std::string& sentence) {
  if (!holds) refuse(sentence);
}

}  // namespace umbel
