// What budgets need of an instance: at which error or threshold of the scene a group is good
// enough.
#pragma once

#include <vector>

#include "umbel/lod/select.hpp"

namespace umbel::lod {

/// One instance, and what turns the scene's errors or thresholds into its own.
struct Seen {
  View view;
  std::vector<Plane> planes;
  double factor;
};

/// The scene as one instance sees it; without a transform, as it is.
Seen see(const View& view, const Culling& culling);
Seen see(const View& view, const Culling& culling, const Transform& transform);

/// The least error or threshold of the scene at which a group need not be refined.
float turning_point(const Group& group, const Seen& seen);

/// Throws kInvalidArgument for what no budget can be met with.
void check_budget(const Tables& tables, const View& view, const Costs& costs,
                  const Culling& culling);

}  // namespace umbel::lod
