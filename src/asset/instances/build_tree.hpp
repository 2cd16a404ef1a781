// Builds the tree of an asset's instances: by medians, up to eight children a node and up to 512
// placements a page.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "umbel/asset.hpp"

namespace umbel::asset {

/// Of a page. A node's stand-ins are an eighth of what is in its page.
inline constexpr uint32_t kMostPlacements = 512, kMembers = 8;

class InstanceTree {
 public:
  /// `meshes` says the box and the coarsest error of each mesh. There is at least one
  /// instance, and they must outlive this. Throws kInvalidArgument for one that floats cannot
  /// place.
  InstanceTree(std::span<const Instance> instances, std::span<const InstancedMesh> meshes);
  ~InstanceTree();

  const std::vector<InstanceNode>& nodes() const;  ///< breadth first
  const std::vector<Instance>& top() const;        ///< the root's stand-ins
  std::vector<Instance> placements(uint32_t node) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace umbel::asset
