// Connected components of a group: which may go, and which come back.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/math.hpp"
#include "lod/simplify/candidate.hpp"
#include "lod/simplify/group_mesh.hpp"

namespace umbel::lod {

class GroupComponents {
 public:
  struct Component {
    bool fixed = false;  ///< another group touches it
    Aabb box;            ///< scaled
    float radius() const { return 0.5f * length(box.max - box.min); }
  };

  explicit GroupComponents(GroupMesh& group) : group_(group) {}

  /// Whenever another group has been gathered.
  void reset() { is_known_ = false; }
  /// Finds the components, unless they are known; before all that follows.
  void find();
  bool is_known() const { return is_known_; }

  std::span<const Component> all() const { return components_; }
  std::span<const uint32_t> of_positions() const { return of_positions_; }
  /// Of triangles of the group's vertices.
  uint32_t of(const Triangle& t) const { return of_positions_[group_.position_of[t[0]]]; }
  /// Of vertices: component and material in one number.
  std::span<const uint64_t> with_materials() const { return with_materials_; }

  /// Whether one of them has more than half the triangles.
  bool has_main() const;

  /// How far each component is from the rest at most, infinite where another group touches it.
  /// Empty where the others make too little room.
  std::vector<float> removable_radii() const;

  /// Removes the smallest components that no other group touches, never the last one.
  Candidate prune(const Candidate& from, size_t target) const;

  /// Puts back the largest components that are gone, as they were, where that lowers the error much
  /// at a small cost. Returns the radius of the largest that stays away: whatever the quadrics of a
  /// thin or flat one say, it was nowhere nearer to what is left than that.
  float restore(size_t most_triangles, std::vector<Triangle>& triangles) const;

  /// Puts back, as they were, the components that have no triangle left at a position that the
  /// caller holds; whether there were any.
  bool restore_held(std::vector<Triangle>& triangles);

 private:
  GroupMesh& group_;
  bool is_known_ = false;
  std::vector<uint32_t> of_positions_;
  std::vector<uint64_t> with_materials_;  // of vertices
  std::vector<Component> components_;
};

}  // namespace umbel::lod
