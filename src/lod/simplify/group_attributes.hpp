// The attributes that weigh in the error of a group's simplification.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "lod/dag/source.hpp"
#include "umbel/lod/build.hpp"

namespace umbel::lod {

/// Joints and their weights become one column for each joint: how much it moves a vertex.
class GroupAttributes {
 public:
  struct Influence {
    uint32_t vertex, joint;
    float weight;
  };

  GroupAttributes(const Source& source, const Config& config) : source_(source), config_(config) {}

  void gather(std::span<const uint32_t> vertices);

  std::span<const float> weights() const { return weights_; }  ///< of attributes
  std::span<const float> values() const { return values_; }    ///< weights().size() a vertex

 private:
  // Columns that follow each other in the source, `stride` values a vertex.
  struct Stream {
    const float* values;
    uint32_t stride, count;
  };
  struct Skin {
    std::vector<Influence> influences;
    std::vector<std::pair<uint32_t, uint32_t>> columns;  // of joints
  };

  void list_streams();
  Skin find_skin(std::span<const uint32_t> vertices);

  const Source& source_;
  const Config& config_;
  std::vector<float> weights_, values_;
  std::vector<Stream> streams_;
};

}  // namespace umbel::lod
