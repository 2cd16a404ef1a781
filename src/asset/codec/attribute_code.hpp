// How the values of one attribute are coded in one cluster: what the encoder chooses and writes,
// and the decoder reads, before the values.
#pragma once

#include <algorithm>
#include <array>

#include "asset/codec/normal_prediction.hpp"
#include "asset/codec/remainder_code.hpp"
#include "asset/codec/vertex_decoding.hpp"

namespace umbel::asset {

/// What the twin of a vertex tells of its values.
enum class TwinRule : uint8_t {
  kNothing = 0,
  kAll = 1,    ///< every vertex that has a twin has its values
  kFlags = 2,  ///< a bit says whether it has
};

struct AttributeCode {
  TwinRule twins = TwinRule::kNothing;
  bool is_geometric = false;  ///< normals: predicted by the triangles
  uint32_t shift = 0;
  bool is_mapped = false;    ///< texture coordinates: predicted by positions
  bool is_mirrored = false;  ///< by a map that is mirrored
  bool has_starts = false;   ///< vertices that start a region have codes of their own
  bool has_kinds = false;    ///< kinds of codes follow the parameters; else they are Rice codes
  /// By component: of usual vertices, and of those that start a region.
  std::array<std::array<RemainderCode, kMaxComponents>, 2> codes;
};

/// A vertex that no active edge led to: the one before is all that predicts it.
inline bool starts_region(const Predictors& predictors) { return predictors.a() == predictors.b(); }

inline bool may_be_geometric(const AttributeFormat& format) {
  return format.attribute == kNormals && format.set == 0 && format.coding == Coding::kOctahedral;
}

inline bool may_be_mapped(const AttributeFormat& format, std::span<const ComponentRange> ranges) {
  return format.attribute == kUvs && format.coding == Coding::kGrid && format.is_smooth == 0 &&
         ranges.size() == 2 && are_small(ranges);
}

/// Whether the values of a group differ at all; where they do not, nothing is stored.
inline bool is_stored(std::span<const ComponentRange> ranges) {
  return std::ranges::any_of(ranges, [](const ComponentRange& range) { return range.bits > 0; });
}
/// Whether a component has remainders.
inline bool is_coded(const AttributeCode& code, const ComponentRange& range) {
  return range.bits > 0 || code.is_geometric;
}

}  // namespace umbel::asset
