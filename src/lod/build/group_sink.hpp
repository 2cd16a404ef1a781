// Where finished groups go.
#pragma once

#include <cstdint>
#include <span>

#include "lod/dag/cluster_set.hpp"
#include "umbel/lod/build.hpp"

namespace umbel::lod {

/// A group of pending clusters that has been simplified, or is a root.
struct NewGroup {
  std::span<const uint32_t> members;  ///< of the pending clusters
  uint32_t level;
  SimplifyMethod method;
  LimitingFactor limiting_factor;
  float error;
  Sphere sphere;
};

/// Gets the groups of one level after the other, each level's in their order.
class GroupSink {
 public:
  GroupSink() = default;
  GroupSink(const GroupSink&) = delete;
  GroupSink& operator=(const GroupSink&) = delete;
  virtual ~GroupSink() = default;

  virtual void add_group(const NewGroup& group) = 0;
  /// Takes the clusters of the groups that were added since the last call, while they are there.
  virtual void finish_level(const ClusterSet& pending) = 0;
};

}  // namespace umbel::lod
