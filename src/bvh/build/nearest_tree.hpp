// Finds for a box the one, among boxes in spatial order, with which it makes the smallest union.
//
// Eight neighbouring boxes make a group, eight groups the next, and so on up. Of a group only the
// innermost sides are kept: the greatest of the low corners and the least of the high ones. Every
// union with a box of the group encloses the union with that, whose area therefore bounds the
// search from below, and tighter than the group's own box would.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "base/big_vector.hpp"
#include "base/parallel.hpp"
#include "bvh/tree/nearest_area.hpp"

namespace umbel::bvh {

class NearestTree {
 public:
  struct Neighbor {
    float area = std::numeric_limits<float>::infinity();
    uint32_t key = kNone;  ///< of neighbours as near, the least counts; a pair has one key
    uint32_t slot = kNone;
    bool beats(const Neighbor& o) const { return area < o.area || (area == o.area && key < o.key); }
  };

  /// Allocates slots [0, size), empty for now.
  void resize(uint32_t size) {
    for (; !levels_.empty() && levels_.back().groups == 0; levels_.pop_back()) {
    }
    size_ = size;
    uint32_t depth = 0;
    for (uint32_t groups = (size + 7) / 8;; groups = (groups + 7) / 8, ++depth) {
      if (levels_.size() == depth) levels_.emplace_back();
      levels_[depth].resize(groups);
      if (groups == 1) break;
    }
    levels_.resize(depth + 1);
  }
  uint32_t size() const { return size_; }

  Aabb box(uint32_t slot) const { return levels_[0].columns().get(slot); }
  void put(uint32_t slot, const Aabb& box) const { levels_[0].columns().put(slot, box); }
  void move(uint32_t to, uint32_t from) const { levels_[0].columns().copy(to, from); }
  /// Writes a box that is no other's neighbour.
  void clear(uint32_t slot) const {
    for (float* column : levels_[0].columns().column) column[slot] = kFar;
  }

  /// After slots were written: the groups, all of them or those above one slot.
  void update() {
    for (uint32_t slot = size_; slot % 8 != 0; ++slot) clear(slot);
    for (size_t level = 1; level < levels_.size(); ++level) {
      const uint32_t used = levels_[level - 1].groups;
      parallel_for(used, 1024, [&](size_t i) { update_group(level, static_cast<uint32_t>(i)); });
      for (uint32_t i = used; i % 8 != 0; ++i)
        for (float* column : levels_[level].columns().column) column[i] = kFar;
    }
  }
  void update_above(uint32_t slot) {
    for (size_t level = 1; level < levels_.size(); ++level) update_group(level, slot >>= 3);
  }

  float united_area(uint32_t a, uint32_t b) const {
    return united_areas(SplatBox(levels_[0].columns(), a), levels_[0].columns(), b)[0];
  }
  static uint32_t key_of(uint32_t a, uint32_t b) { return a ^ b; }

  /// The best of `known` and all other slots' boxes.
  Neighbor nearest(uint32_t slot, Neighbor known) const {
    Search search{*this, SplatBox(levels_[0].columns(), slot), slot, known};
    search.visit_slots(slot >> 3);
    for (size_t level = 1; level < levels_.size(); ++level)
      search.visit_groups(level, slot >> (3 * level + 3), slot >> (3 * level));
    return search.best;
  }

 private:
  // Far below any coordinate, and its square is still a number.
  static constexpr float kFar = -1e18f;

  /// Eight boxes a group, in one array for each of their six numbers.
  struct Level {
    uint32_t groups = 0;
    BigVector<float> values;
    size_t stride = 0;

    void resize(uint32_t count) {
      groups = count;
      // Only ever smaller than at first: what is there stays.
      if (stride < size_t{count} * 8) {
        stride = size_t{count} * 8;
        // Four boxes are read at once, and that from any slot on.
        values.resize(stride * 6 + 3);
      }
    }
    BoxColumns columns() const {
      auto* v = const_cast<float*>(values.data());
      return {{v, v + stride, v + 2 * stride, v + 3 * stride, v + 4 * stride, v + 5 * stride}};
    }
  };

  struct Search {
    const NearestTree& tree;
    SplatBox box;
    uint32_t slot;
    Neighbor best;

    void visit_slots(uint32_t group) {
      alignas(16) float areas[8];
      areas_of(0, group, areas);
      for (uint32_t i = 0; i < 8; ++i) {
        const uint32_t other = group * 8 + i;
        const Neighbor candidate{areas[i], key_of(slot, other), other};
        if (other != slot && candidate.beats(best)) best = candidate;
      }
    }

    /// Visits the members of a group on a level above the slots, except one, the nearest first.
    void visit_groups(size_t level, uint32_t group, uint32_t but) {
      struct Member {
        float area;
        uint32_t index;
      };
      alignas(16) float areas[8];
      areas_of(level, group, areas);
      Member members[8];
      uint32_t count = 0;
      for (uint32_t i = 0; i < 8; ++i) {
        const uint32_t index = group * 8 + i;
        if (index == but || !may_beat(areas[i], level, index)) continue;
        uint32_t at = count++;
        for (; at > 0 && members[at - 1].area > areas[i]; --at) members[at] = members[at - 1];
        members[at] = {areas[i], index};
      }
      for (uint32_t i = 0; i < count; ++i) {
        if (!may_beat(members[i].area, level, members[i].index)) continue;
        if (level == 1)
          visit_slots(members[i].index);
        else
          visit_groups(level - 1, members[i].index, kNone);
      }
    }

    bool may_beat(float area, size_t level, uint32_t index) const {
      if (area != best.area) return area < best.area;
      const auto shift = static_cast<uint32_t>(3 * level);
      return (((slot >> shift) ^ index) << shift) < best.key;
    }

    void areas_of(size_t level, uint32_t group, float* areas) const {
      const BoxColumns boxes = tree.levels_[level].columns();
      const Float4 low = united_areas(box, boxes, size_t{group} * 8);
      const Float4 high = united_areas(box, boxes, size_t{group} * 8 + 4);
      std::memcpy(areas, &low, sizeof low);
      std::memcpy(areas + 4, &high, sizeof high);
    }
  };

  /// A member of a level above the slots from the group below.
  void update_group(size_t level, uint32_t index) {
    const BoxColumns from = levels_[level - 1].columns(), to = levels_[level].columns();
    for (int c = 0; c < 6; ++c) {
      const float* v = from.column[c] + size_t{index} * 8;
      to.column[c][index] = *std::max_element(v, v + 8);
    }
  }

  std::vector<Level> levels_;  ///< the slots, groups of them, groups of groups ...
  uint32_t size_ = 0;
};

}  // namespace umbel::bvh
