// What fuzzers of the C interface share: failures, and numbers made of the fuzzer's bytes.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "data_provider.hpp"
#include "umbel/umbel.h"

namespace umbel::fuzz {

[[noreturn]] inline void fail(const char* what) {
  std::fprintf(stderr, "fuzz: %s (%s)\n", what, umbel_last_error());
  std::abort();
}

inline void expect(bool ok, const char* what) {
  if (!ok) fail(what);
}

/// True where the call went well; else there must be a sentence, and not about the library itself.
inline bool went_well(umbel_result result) {
  expect(result != UMBEL_ERROR_INTERNAL, "a fault of the library");
  if (result != UMBEL_OK) expect(umbel_last_error()[0] != '\0', "an error without a sentence");
  return result == UMBEL_OK;
}

/// The fuzzer's bytes, the first of which says what the rest is like.
class Input {
 public:
  Input(const uint8_t* data, size_t size) : bytes(data, size), mood_(bytes.integral<uint8_t>()) {}

  bool likes(int bit) const { return mood_ >> bit & 1; }
  /// Positions within what watertightness, and that all trees agree, is promised for.
  bool is_tame() const { return likes(0); }

  uint32_t below(uint32_t end) { return bytes.integral<uint8_t>() % end; }
  /// One in so many.
  bool seldom(uint32_t among) { return below(among) == among - 1; }

  /// On a coarse grid, where corners coincide and triangles lie in planes and on lines; seldom, if
  /// not tame, anything at all.
  float number() {
    const auto kind = bytes.integral<uint8_t>();
    if (is_tame() || kind < 240) return float(kind % 16) / 8 - 1;
    const auto bits = bytes.integral<uint32_t>();
    float value;
    std::memcpy(&value, &bits, sizeof value);
    return value;
  }
  umbel_vec3 point() {
    const float x = number(), y = number();
    return {x, y, number()};
  }

  DataProvider bytes;

 private:
  uint8_t mood_;
};

}  // namespace umbel::fuzz
