// The named configurations.
#include <algorithm>
#include <string>

#include "umbel/cluster.hpp"

namespace umbel {

ClusterConfig cluster_preset(std::string_view name, uint32_t max_items) {
  if (max_items == 0)
    throw Error(ErrorCode::kInvalidArgument, "max_items must be at least 1, not 0");
  ClusterConfig config;
  config.max_items = max_items;
  config.min_items = std::max(max_items / 4, 1u);
  // Clusters are as full as those of other builders, at less area.
  config.underfill_cost = 0.3f;
  if (name == "quality") return config;
  if (name == "fast") {
    config.coarse = true;
    config.underfill_cost = 0.4f;  // coarse splits leave clusters less full
    return config;
  }
  if (name == "exact") {
    config.min_items = max_items;
    return config;
  }
  throw Error(ErrorCode::kInvalidArgument, "there is no cluster preset \"" + std::string(name) +
                                               "\"; there are quality, fast and exact");
}

}  // namespace umbel
