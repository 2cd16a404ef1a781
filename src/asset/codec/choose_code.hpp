// Chooses the code that is shortest for some remainders.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "asset/codec/remainder_code.hpp"

namespace umbel::asset {

struct CodeChoice {
  RemainderCode code;
  uint64_t bits;  ///< of all remainders
};

/// The shortest of some kinds.
struct CodeChoices {
  CodeChoice rice;  ///< of Rice codes
  CodeChoice any;   ///< of all
};

/// Reusable; not thread-safe.
class CodeChooser {
 public:
  CodeChoices choose(std::span<const uint32_t> remainders);

 private:
  std::vector<uint32_t> others_;  // than 0
};

}  // namespace umbel::asset
