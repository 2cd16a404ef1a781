// Connected components that may be removed as a whole, in their turn among the collapses: the cost
// is shared out among the collapses whose place the removal takes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lod/simplify/collapse/collapse_mesh.hpp"

namespace umbel::lod {

class RemovableComponents {
 public:
  explicit RemovableComponents(const CollapseMesh& mesh) : mesh_(mesh) {}

  /// Of positions, their component; of components, how far one is from the rest at most, infinite
  /// for those that stay. Empty: none may go. Whenever the mesh has been loaded.
  void load(std::span<const uint32_t> component_of, std::span<const float> radii);

  size_t count() const { return radii_.size(); }
  bool is_removable(uint32_t component) const;
  float radius(uint32_t component) const { return radii_[component]; }
  /// Its place among the ranks of collapses, by the triangles when last counted.
  float rank(uint32_t component) const;
  /// Its triangles as loaded, removed ones too.
  std::span<const uint32_t> triangles(uint32_t component) const {
    return std::span(triangles_)
        .subspan(offsets_[component], offsets_[component + 1] - offsets_[component]);
  }
  /// Counts the triangles that are left. Returns whether there are as many as last time.
  bool recount(uint32_t component);
  uint32_t triangles_left(uint32_t component) const { return left_[component]; }

 private:
  const CollapseMesh& mesh_;
  std::span<const float> radii_;
  std::vector<float> areas_;                   // of components, before any collapse
  std::vector<uint32_t> left_;                 // of components: triangles when last counted
  std::vector<uint32_t> offsets_, triangles_;  // of components: their triangles
};

}  // namespace umbel::lod
