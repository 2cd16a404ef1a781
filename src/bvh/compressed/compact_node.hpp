// Reading and writing the nodes of compact_bvh.hpp, on processors and devices.
#pragma once

#include <bit>
#include <cstdint>
#include <limits>

#include "base/exec.hpp"
#include "base/math.hpp"
#include "umbel/compact_bvh.hpp"

namespace umbel::bvh {

/// The grid of one axis of a node, which reaches from `low` to `high`.
class CompactAxis {
 public:
  static constexpr uint32_t kMost = 255;  ///< the last plane
  /// Those smaller could vanish in products.
  static constexpr uint32_t kLeastExponent = 27;
  static constexpr uint32_t kMostExponent = 254;

  UMBEL_HOST_DEVICE CompactAxis(float low, float high) : origin_(low) {
    // Halved, so that no difference overflows. Its bits without those of the mantissa are the power
    // of two below it, of which a cell is at least the 2^7th part.
    const float extent = high * 0.5f - low * 0.5f;
    const uint32_t power = std::bit_cast<uint32_t>(extent) >> 23 & 0xffu;
    exponent_ = power > kLeastExponent + 7 ? power - 7 : kLeastExponent;
    while (exponent_ < kMostExponent && position(kMost) < high) ++exponent_;
    cells_in_half_ = 2 / cell(exponent_);
  }
  UMBEL_HOST_DEVICE CompactAxis(float origin, uint8_t exponent)
      : origin_(origin), exponent_(exponent) {}

  UMBEL_HOST_DEVICE static float cell(uint32_t exponent) {
    return std::bit_cast<float>(exponent << 23);
  }
  UMBEL_HOST_DEVICE uint8_t exponent() const { return static_cast<uint8_t>(exponent_); }

  /// Where a plane is. Always finite.
  UMBEL_HOST_DEVICE float position(uint32_t plane) const {
    const float at = origin_ + static_cast<float>(plane) * cell(exponent_);
    const float most = std::numeric_limits<float>::max();
    return at < most ? at : most;
  }
  /// The last plane that is not above x.
  UMBEL_HOST_DEVICE uint8_t below(float x) const {
    uint32_t plane = near(x);
    while (plane > 0 && position(plane) > x) --plane;
    return static_cast<uint8_t>(plane);
  }
  /// The first plane that is not below x.
  UMBEL_HOST_DEVICE uint8_t above(float x) const {
    uint32_t plane = near(x);
    while (plane < kMost && position(plane) < x) ++plane;
    return static_cast<uint8_t>(plane);
  }

 private:
  UMBEL_HOST_DEVICE uint32_t near(float x) const {
    const float cells = (x * 0.5f - origin_ * 0.5f) * cells_in_half_;
    return static_cast<uint32_t>(cells < static_cast<float>(kMost) ? cells
                                                                   : static_cast<float>(kMost));
  }

  float origin_;
  uint32_t exponent_;
  float cells_in_half_ = 0;
};

/// A box that holds all below the slot, and may be a little larger.
UMBEL_HOST_DEVICE inline Aabb compact_box(const CompactNode& node, uint32_t slot) {
  const CompactAxis x(node.origin.x, node.exponent[0]), y(node.origin.y, node.exponent[1]),
      z(node.origin.z, node.exponent[2]);
  return {
      {x.position(node.low[0][slot]), y.position(node.low[1][slot]), z.position(node.low[2][slot])},
      {x.position(node.high[0][slot]), y.position(node.high[1][slot]),
       z.position(node.high[2][slot])}};
}

UMBEL_HOST_DEVICE inline bool is_compact_leaf(uint8_t meta) {
  return meta != 0 && meta != CompactNode::kInner;
}
/// The node in a slot that has one.
UMBEL_HOST_DEVICE inline uint32_t compact_child(const CompactNode& node, uint32_t slot) {
  uint32_t before = 0;
  for (uint32_t s = 0; s < slot; ++s) before += node.meta[s] == CompactNode::kInner;
  return node.first_child + before;
}
/// The first triangle of a leaf in a slot.
UMBEL_HOST_DEVICE inline uint32_t compact_leaf(const CompactNode& node, uint32_t slot) {
  uint32_t before = 0;
  for (uint32_t s = 0; s < slot; ++s) before += is_compact_leaf(node.meta[s]) ? node.meta[s] : 0;
  return node.first_triangle + before;
}

/// The grid of a node around a box, which may be empty.
class CompactGrid {
 public:
  UMBEL_HOST_DEVICE explicit CompactGrid(const Aabb& all)
      : origin_(is_empty(all) ? Vec3{0, 0, 0} : all.min),
        axes_{axis(all, origin_.x, all.max.x), axis(all, origin_.y, all.max.y),
              axis(all, origin_.z, all.max.z)} {}

  UMBEL_HOST_DEVICE void write(CompactNode& node) const {
    node.origin = origin_;
    for (uint32_t k = 0; k < 3; ++k) node.exponent[k] = axes_[k].exponent();
  }
  /// The box of a slot, which may be empty.
  UMBEL_HOST_DEVICE void write(CompactNode& node, uint32_t slot, const Aabb& box) const {
    const bool is_there = !is_empty(box);
    const float lows[3] = {box.min.x, box.min.y, box.min.z},
                highs[3] = {box.max.x, box.max.y, box.max.z};
    UMBEL_UNROLL
    for (uint32_t k = 0; k < 3; ++k) {
      node.low[k][slot] = is_there ? axes_[k].below(lows[k]) : uint8_t{0};
      node.high[k][slot] = is_there ? axes_[k].above(highs[k]) : uint8_t{0};
    }
  }

 private:
  UMBEL_HOST_DEVICE static CompactAxis axis(const Aabb& all, float low, float high) {
    return {low, is_empty(all) ? 0 : high};
  }

  Vec3 origin_;
  CompactAxis axes_[3];
};

}  // namespace umbel::bvh
