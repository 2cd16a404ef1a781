// The full sweep for a few primitives, all of them in the nearest cache.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "bvh/build/emitter.hpp"

namespace umbel::bvh {

class SmallSweep {
 public:
  static constexpr uint32_t kMost = 32;

  SmallSweep(std::span<const Aabb> boxes, Emitter& out) : all_boxes_(boxes), out_(out) {}

  /// Builds node `slot`, at `depth`, of the primitives `ids()[0 .. count)`, at most kMost.
  BuiltSubtree build(uint32_t count, uint32_t slot, uint32_t depth);
  uint32_t* ids() { return ids_.data(); }

 private:
  struct Choice {
    uint32_t axis, position;
    float left_area, right_area;
  };

  /// `centers` holds the doubled centres.
  void sort(uint32_t count, const Box4& centers);
  BuiltSubtree split(uint32_t begin, uint32_t count, uint32_t slot, uint32_t depth);
  BuiltSubtree single(uint32_t own, uint32_t slot);
  BuiltSubtree pair(uint32_t a, uint32_t b, uint32_t slot);
  BuiltSubtree three(uint32_t begin, uint32_t slot);
  Choice cheapest(uint32_t begin, uint32_t count);
  void partition(uint32_t begin, uint32_t count, const Choice& choice);

  std::span<const Aabb> all_boxes_;
  Emitter& out_;
  Float4 pad_{};
  std::array<Box4, kMost> boxes_;
  std::array<float, kMost> areas_;
  std::array<Float4, kMost> right_areas_;
  std::array<uint32_t, kMost> ids_;
  std::array<std::array<uint8_t, kMost>, 3> orders_;
};

}  // namespace umbel::bvh
