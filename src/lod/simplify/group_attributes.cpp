#include "lod/simplify/group_attributes.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <type_traits>
#include <utility>

namespace umbel::lod {
namespace {

// As many as meshoptimizer takes.
constexpr size_t kMostColumns = 32;
// Joints of a group with a column of their own; the others share the last.
constexpr size_t kMostJoints = 12;

struct Influence {
  uint32_t vertex;
  uint32_t joint;
  float weight;
};

std::span<const float> extra_of(const Mesh& mesh, uint32_t vertex) {
  const size_t width = extra_width(mesh.extras);
  return std::span(mesh.extra_values).subspan(vertex * width, width);
}

// Of all sets.
std::vector<Influence> influences_of(const Mesh& mesh, std::span<const uint32_t> vertices) {
  std::vector<Influence> influences;
  for (uint32_t i = 0; i < vertices.size(); ++i) {
    const std::span<const float> values = extra_of(mesh, vertices[i]);
    uint32_t joints_at = 0;
    for (const Extra& joints : mesh.extras) {
      uint32_t weights_at = 0;
      for (const Extra& weights : mesh.extras) {
        const bool match =
            joints.kind == ExtraKind::kJoints && weights == Extra{ExtraKind::kWeights, joints.set};
        for (uint32_t k = 0; match && k < extra_width(weights.kind); ++k)
          if (values[weights_at + k] != 0.0f)
            influences.push_back(
                {i, static_cast<uint32_t>(values[joints_at + k]), values[weights_at + k]});
        weights_at += extra_width(weights.kind);
      }
      joints_at += extra_width(joints.kind);
    }
  }
  return influences;
}

// For each joint its column: those that move most have one of their own.
std::vector<std::pair<uint32_t, uint32_t>> joint_columns(std::span<const Influence> influences,
                                                         size_t most) {
  std::vector<Influence> totals(influences.begin(), influences.end());
  std::stable_sort(totals.begin(), totals.end(),
                   [](const Influence& a, const Influence& b) { return a.joint < b.joint; });
  std::vector<std::pair<float, uint32_t>> joints;  // how much, which
  for (const Influence& influence : totals) {
    if (joints.empty() || joints.back().second != influence.joint)
      joints.push_back({0.0f, influence.joint});
    joints.back().first += influence.weight;
  }
  std::stable_sort(joints.begin(), joints.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<std::pair<uint32_t, uint32_t>> columns;
  for (size_t i = 0; i < joints.size(); ++i)
    columns.push_back({joints[i].second, static_cast<uint32_t>(std::min(i, most - 1))});
  std::sort(columns.begin(), columns.end());
  return columns;
}

}  // namespace

// `value(vertex of the source, column)`.
template <typename Value>
void GroupAttributes::add_columns(float weight, uint32_t count, const Value& value) {
  for (uint32_t k = 0; k < count; ++k) {
    weights_.push_back(weight);
    for (uint32_t v : vertices_) columns_.push_back(value(v, k));
  }
}

void GroupAttributes::gather(std::span<const uint32_t> vertices) {
  vertices_ = vertices;
  weights_.clear();
  columns_.clear();
  values_.clear();
  if (!config_.attributes) return;
  const Mesh& mesh = source_.mesh;
  const auto component = [](const auto& stream) {
    using Vector = typename std::decay_t<decltype(stream)>::value_type;
    return [&stream](uint32_t v, uint32_t k) {
      return std::bit_cast<std::array<float, sizeof(Vector) / sizeof(float)>>(stream[v])[k];
    };
  };
  // What refitting changes comes first.
  if (!mesh.normals.empty()) add_columns(config_.normal_weight, 3, component(mesh.normals));
  if (!mesh.uvs.empty()) add_columns(config_.uv_weight, 2, component(mesh.uvs));
  if (!mesh.colors.empty()) add_columns(config_.color_weight, 4, component(mesh.colors));
  if (!mesh.tangents.empty() && config_.tangent_weight > 0.0f)
    add_columns(config_.tangent_weight, 3, component(mesh.tangents));
  gather_extras();
  const size_t count = vertices_.size(), width = weights_.size();
  values_.resize(count * width);
  for (size_t k = 0; k < width; ++k)
    for (size_t v = 0; v < count; ++v) values_[v * width + k] = columns_[k * count + v];
}

void GroupAttributes::gather_extras() {
  const Mesh& mesh = source_.mesh;
  uint32_t at = 0;
  bool skin = false;
  for (const Extra& extra : mesh.extras) {
    if (extra.kind == ExtraKind::kUvs && weights_.size() + 2 <= kMostColumns)
      add_columns(config_.uv_weight, 2,
                  [&](uint32_t v, uint32_t k) { return extra_of(mesh, v)[at + k]; });
    skin |= extra.kind == ExtraKind::kWeights;
    at += extra_width(extra.kind);
  }
  if (skin && config_.skin_weight > 0.0f) gather_skin();
}

void GroupAttributes::gather_skin() {
  const size_t most = std::min(kMostJoints, kMostColumns - weights_.size());
  if (most == 0) return;
  const std::vector<Influence> influences = influences_of(source_.mesh, vertices_);
  const auto columns = joint_columns(influences, most);
  const size_t first = columns_.size(), width = std::min(columns.size(), most);
  weights_.insert(weights_.end(), width, config_.skin_weight);
  columns_.resize(first + width * vertices_.size(), 0.0f);
  for (const Influence& influence : influences) {
    const auto column =
        std::lower_bound(columns.begin(), columns.end(), std::pair{influence.joint, uint32_t{0}});
    columns_[first + column->second * vertices_.size() + influence.vertex] += influence.weight;
  }
}

}  // namespace umbel::lod
