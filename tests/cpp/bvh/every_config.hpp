// Every kind of hierarchy that rays and shapes can be asked of.
#pragma once

#include <vector>

#include "umbel/triangle_bvh.hpp"

namespace umbel::testing {

/// Every builder, width and layout, with the builders' own settings as they are by default.
inline std::vector<BvhConfig> every_config() {
  std::vector<BvhConfig> configs;
  for (const bvh::Builder builder : bvh::builders())
    for (const uint32_t width : {2u, 4u, 8u})
      for (const bool compact : {false, true}) {
        BvhConfig& config = configs.emplace_back();
        config.tree = bvh::Config{};
        config.tree.builder = builder;
        config.width = width, config.compact = compact;
      }
  return configs;
}

}  // namespace umbel::testing
