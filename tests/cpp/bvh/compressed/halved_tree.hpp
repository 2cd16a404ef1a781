// Compact trees made by halving, apart from what the library makes them with.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>
#include <vector>

#include "base/math.hpp"
#include "bvh/compressed/compact_traverse.hpp"
#include "umbel/mesh.hpp"

namespace umbel::cuda::testing {

/// Leaves of 1 to 8 triangles and nodes of 2 to 8 children, in slots by chance.
class HalvedTree {
 public:
  explicit HalvedTree(const MeshView& mesh, uint32_t seed = 1) : mesh_(mesh), random_(seed) {
    std::vector<uint32_t> all(mesh.triangles.size());
    for (uint32_t i = 0; i < all.size(); ++i) all[i] = i;
    info_.bounds = Aabb{};
    for (const uint32_t i : all) extend(info_.bounds, box(i));
    if (!all.empty()) {
      nodes_.emplace_back();
      fill(0, all);
    }
    info_.nodes = static_cast<uint32_t>(nodes_.size());
    info_.triangles = static_cast<uint32_t>(triangles_.size());
  }

  bvh::CompactTree view() const { return {nodes_.data(), triangles_.data(), &info_}; }

 private:
  using Items = std::vector<uint32_t>;

  Aabb box(uint32_t triangle) const {
    Aabb result;
    for (const uint32_t v : mesh_.triangles[triangle])
      if (is_finite(mesh_.positions[v])) extend(result, mesh_.positions[v]);
    return result;
  }

  /// Halves parts of more than a leaf until there are eight, or none is left to halve.
  std::vector<Items> parts_of(Items items) {
    std::vector<Items> parts{std::move(items)};
    const uint32_t leaf = 1 + random_() % 8;
    while (parts.size() < 8) {
      const auto largest =
          std::max_element(parts.begin(), parts.end(),
                           [](const Items& a, const Items& b) { return a.size() < b.size(); });
      if (largest->size() <= leaf && parts.size() > 1) break;
      if (largest->size() < 2) break;
      Aabb bounds;
      for (const uint32_t i : *largest) extend(bounds, box(i));
      const Vec3 size = bounds.max - bounds.min;
      const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
      const auto key = [&](uint32_t i) {
        const Vec3 c = center(box(i));
        return axis == 0 ? c.x : axis == 1 ? c.y : c.z;
      };
      std::stable_sort(largest->begin(), largest->end(),
                       [&](uint32_t a, uint32_t b) { return key(a) < key(b); });
      const auto middle = largest->begin() + static_cast<ptrdiff_t>(largest->size() / 2);
      Items second(middle, largest->end());
      largest->erase(middle, largest->end());
      parts.push_back(std::move(second));
    }
    return parts;
  }

  void fill(uint32_t place, const Items& items) {
    std::vector<Items> slots = parts_of(items);
    slots.resize(8);
    std::shuffle(slots.begin(), slots.end(), random_);
    bvh::CompactNode node{};
    Aabb all, boxes[8];
    for (uint32_t s = 0; s < 8; ++s) {
      for (const uint32_t i : slots[s]) extend(boxes[s], box(i));
      extend(all, boxes[s]);
    }
    node.origin = all.min;
    for (uint32_t k = 0; k < 3; ++k) set_planes(node, k, all, boxes);
    node.first_child = static_cast<uint32_t>(nodes_.size());
    node.first_triangle = static_cast<uint32_t>(triangles_.size());
    for (uint32_t s = 0; s < 8; ++s) {
      if (slots[s].size() > 8) {
        node.meta[s] = bvh::CompactNode::kInner;
        node.inner |= static_cast<uint8_t>(1u << s);
        nodes_.emplace_back();
        continue;
      }
      node.meta[s] = static_cast<uint8_t>(slots[s].size());
      for (const uint32_t i : slots[s]) {
        const Triangle& t = mesh_.triangles[i];
        triangles_.push_back(
            {mesh_.positions[t[0]], i, mesh_.positions[t[1]], 0, mesh_.positions[t[2]], 0});
      }
    }
    uint32_t child = node.first_child;
    for (uint32_t s = 0; s < 8; ++s)
      if (node.inner >> s & 1) fill(child++, slots[s]);
    nodes_[place] = node;
  }

  static void set_planes(bvh::CompactNode& node, uint32_t k, const Aabb& all, const Aabb* boxes) {
    const auto along = [k](const Vec3& v) { return k == 0 ? v.x : k == 1 ? v.y : v.z; };
    const float origin = along(all.min);
    uint32_t exponent = 27;
    const auto plane = [&](uint32_t q) {
      return bvh::compact_plane(origin, bvh::compact_cell(static_cast<uint8_t>(exponent)), q);
    };
    while (exponent < 254 && plane(255) < along(all.max)) ++exponent;
    node.exponent[k] = static_cast<uint8_t>(exponent);
    for (uint32_t s = 0; s < 8; ++s) {
      if (is_empty(boxes[s])) continue;
      uint32_t low = 255, high = 0;
      while (low > 0 && plane(low) > along(boxes[s].min)) --low;
      while (high < 255 && plane(high) < along(boxes[s].max)) ++high;
      node.low[k][s] = static_cast<uint8_t>(low);
      node.high[k][s] = static_cast<uint8_t>(high);
    }
  }

  MeshView mesh_;
  std::mt19937 random_;
  std::vector<bvh::CompactNode> nodes_;
  std::vector<bvh::CompactTriangle> triangles_;
  bvh::CompactInfo info_{};
};

}  // namespace umbel::cuda::testing
