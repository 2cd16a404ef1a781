// Settings of builders by one name.
#pragma once

#include <string_view>

#include "umbel/bvh.hpp"

namespace umbel::bvh {

/// A builder with its defaults, by its name, or with the settings that its paper names: "kmeans-q1"
/// to "kmeans-q5", "aac-fast", "aac-hq". Throws kInvalidArgument for other names.
UMBEL_API Config builder_preset(std::string_view name);

}  // namespace umbel::bvh
