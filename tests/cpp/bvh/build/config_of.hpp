// Configs that differ from the defaults in one setting.
#pragma once

#include "umbel/bvh.hpp"

namespace umbel::bvh {

template <typename Value>
Config config_of(Builder builder, Value Config::* setting, Value value) {
  Config config;
  config.builder = builder;
  config.*setting = value;
  return config;
}

}  // namespace umbel::bvh
