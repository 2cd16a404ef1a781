// Structs of a caller that knows more fields than the library does.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>

namespace umbel::testing {

template <typename Config>
struct Newer {
  Config known;
  uint32_t fresh[4];
};

/// As an _init_sized function of the C interface leaves it.
template <typename Config>
Newer<Config> newer(void (*init_sized)(Config*, size_t)) {
  Newer<Config> config;
  init_sized(&config.known, sizeof config);
  EXPECT_EQ(config.known.struct_size, sizeof config);
  for (const uint32_t fresh : config.fresh) EXPECT_EQ(fresh, 0u);
  return config;
}

}  // namespace umbel::testing
