// The traversal of a compact tree (umbel/compact_bvh.hpp), on processors and devices: of each node
// that is visited, the children that were hit wait as one entry of a stack (Ylitie, Karras &
// Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", 2017), so the
// stack has no more entries than the tree has levels.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>

#include "base/bit_count.hpp"
#include "base/host_device.hpp"
#include "umbel/compact_bvh.hpp"

namespace umbel::bvh {

/// A compact tree, wherever its arrays are.
struct CompactTree {
  const CompactNode* nodes;
  const CompactTriangle* triangles;
  const CompactInfo* info;
};

/// Reads whole 16-byte words on a device: arrays are aligned to that.
template <typename T>
UMBEL_HOST_DEVICE inline T load_words(const T* from) {
#if defined(__CUDA_ARCH__)
  static_assert(sizeof(T) % sizeof(uint4) == 0);
  constexpr int kWords = sizeof(T) / sizeof(uint4);
  uint4 words[kWords];
  for (int i = 0; i < kWords; ++i) words[i] = __ldg(reinterpret_cast<const uint4*>(from) + i);
  T value;
  memcpy(&value, words, sizeof(T));
  return value;
#else
  return *from;
#endif
}

/// Eight bytes, one a slot.
UMBEL_HOST_DEVICE inline uint64_t slots_of(const uint8_t bytes[8]) {
  uint64_t word;
  memcpy(&word, bytes, sizeof word);
  return word;
}
UMBEL_HOST_DEVICE inline uint32_t slot_of(uint64_t bytes, uint32_t slot) {
  return uint32_t(bytes >> 8 * slot) & 0xffu;
}

/// Where the triangles of each slot's leaf begin among those of the node, a byte each.
UMBEL_HOST_DEVICE inline uint64_t leaf_starts(uint64_t meta) {
  constexpr uint64_t kEach = 0x0101010101010101u;
  const uint64_t counts = meta & ~(kEach * CompactNode::kInner);
  // Sums of all lower bytes: at most 7 leaves of 8.
  return counts * (kEach << 8);
}

/// Where a plane of a node is along an axis.
UMBEL_HOST_DEVICE inline float compact_cell(uint8_t exponent) {
  return std::bit_cast<float>(uint32_t{exponent} << 23);
}
UMBEL_HOST_DEVICE inline float compact_plane(float origin, float cell, uint32_t plane) {
  const float at = origin + static_cast<float>(plane) * cell;
  constexpr float kMost = std::numeric_limits<float>::max();
  return at < kMost ? at : kMost;
}

/// Children of a node that wait, in the order of (slot ^ first): the lowest bit comes first.
struct CompactGroup {
  uint32_t first_child = 0;
  uint32_t bits = 0;  ///< 0..7: who waits; 8..15: CompactNode::inner; 16..18: first
  float near = 0;     ///< no child is nearer, in whatever the visitor counts

  UMBEL_HOST_DEVICE static CompactGroup of(const CompactNode& node, uint32_t children,
                                           uint32_t first, float near) {
    uint32_t waiting = 0;
    for (uint32_t rest = children & node.inner; rest != 0; rest &= rest - 1)
      waiting |= 1u << (lowest_bit(rest) ^ first);
    return {node.first_child, waiting | uint32_t{node.inner} << 8 | first << 16, near};
  }
  UMBEL_HOST_DEVICE bool is_empty() const { return (bits & 0xffu) == 0; }
  /// Takes the first child out.
  UMBEL_HOST_DEVICE uint32_t take() {
    const uint32_t rank = lowest_bit(bits);
    bits &= bits - 1;
    const uint32_t slot = rank ^ (bits >> 16);
    return first_child + count_bits((bits >> 8 & 0xffu) & ((1u << slot) - 1));
  }
};

/// A traversal that can be taken step by step: a step visits one node. visitor.visit(node) tests
/// the children, does what there is to do at leaves and returns the group of the others;
/// visitor.limit() says beyond what `near` groups are left out.
class CompactTraversal {
 public:
  template <typename Visitor>
  UMBEL_HOST_DEVICE void begin(const CompactTree& tree, Visitor& visitor) {
    depth_ = 0;
    group_ = visitor.visit(load_words(tree.nodes));
  }
  /// False where all is done.
  template <typename Visitor>
  UMBEL_HOST_DEVICE bool step(const CompactTree& tree, Visitor& visitor) {
    while (group_.is_empty() || group_.near > visitor.limit()) {
      if (depth_ == 0) return false;
      group_ = stack_[--depth_];
    }
    const uint32_t node = group_.take();
    if (!group_.is_empty()) stack_[depth_++] = group_;
    group_ = visitor.visit(load_words(tree.nodes + node));
    return true;
  }

 private:
  CompactGroup group_;
  uint32_t depth_ = 0;
  CompactGroup stack_[kMaxCompactDepth];
};

/// Calls take(triangle, position) for the triangles of the leaves among `children`, in the order of
/// (slot ^ first), until it says false.
template <typename Take>
UMBEL_HOST_DEVICE inline void each_triangle(const CompactTree& tree, const CompactNode& node,
                                            uint32_t children, uint32_t first, const Take& take) {
  const uint64_t meta = slots_of(node.meta), starts = leaf_starts(meta);
  for (uint32_t rank = 0; rank < 8; ++rank) {
    const uint32_t slot = rank ^ first;
    if ((children >> slot & 1) == 0 || (node.inner >> slot & 1) != 0) continue;
    const uint32_t begin = node.first_triangle + slot_of(starts, slot);
    const uint32_t count = slot_of(meta, slot);
    for (uint32_t i = begin; i < begin + count; ++i)
      if (!take(load_words(tree.triangles + i), i)) return;
  }
}

}  // namespace umbel::bvh
