// What build.cpp and the builders share beside the configuration itself.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>

#include "umbel/bvh.hpp"

namespace umbel::bvh {

/// Nodes are numbered by 32 bits, and each leaf may need two.
inline constexpr size_t kMaxPrimitives = (size_t{1} << 31) - 1;

/// Throws kInvalidArgument, naming the field and its value, if a cost is not positive and finite.
void check_cost(const CostModel& cost);

/// The same of what only measures a tree, which may leave out one kind of visits: a cost may be 0.
void check_measure(const CostModel& cost);

/// Throws kInvalidArgument, naming the field and its value, if one is out of its range, and if
/// `primitives` cannot be told apart within max_depth.
void check_config(const Config& config, size_t primitives);

/// The most that Config::max_depth may be.
inline constexpr uint32_t kDeepest = 255;

/// Levels of a balanced tree with one primitive a leaf.
inline uint32_t balanced_depth(size_t primitives) {
  return primitives < 2 ? 0 : static_cast<uint32_t>(std::bit_width(primitives - 1));
}

/// True if halving reaches single primitives within `levels`.
inline bool fits_depth(size_t primitives, uint32_t levels) {
  return balanced_depth(primitives) <= levels;
}

/// Rebuilds by halving, in the order of the leaves, the subtrees that are too deep. Leaves stay as
/// they are. There must be at most 2^max_depth of them.
void limit_depth(Bvh2& tree, uint32_t max_depth);

}  // namespace umbel::bvh
