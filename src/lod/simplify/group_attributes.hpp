// The attributes that weigh in the error of a group's simplification.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lod/dag/source.hpp"
#include "umbel/lod/build.hpp"

namespace umbel::lod {

/// Joints and their weights become one column for each joint: how much it moves a vertex.
class GroupAttributes {
 public:
  GroupAttributes(const Source& source, const Config& config) : source_(source), config_(config) {}

  void gather(std::span<const uint32_t> vertices);

  std::span<const float> weights() const { return weights_; }  ///< of attributes
  std::span<const float> values() const { return values_; }    ///< weights().size() a vertex

 private:
  template <typename Value>
  void add_columns(float weight, uint32_t count, const Value& value);
  void gather_extras();
  void gather_skin();

  const Source& source_;
  const Config& config_;
  std::span<const uint32_t> vertices_;
  std::vector<float> weights_, values_;
  std::vector<float> columns_;  // attributes, one after the other
};

}  // namespace umbel::lod
