#include "lod/simplify/group_attributes.hpp"

#include <algorithm>
#include <cstring>
#include <type_traits>
#include <utility>

namespace umbel::lod {
namespace {

// As many as meshoptimizer takes.
constexpr size_t kMostColumns = 32;
// Joints of a group with a column of their own; the others share the last.
constexpr size_t kMostJoints = 12;

using Influence = GroupAttributes::Influence;

// Where a vertex has a set's joints and their weights among its values.
struct SkinSet {
  uint32_t joints_at, weights_at, count;
};

std::vector<SkinSet> skin_sets(std::span<const Extra> extras) {
  std::vector<SkinSet> sets;
  uint32_t joints_at = 0;
  for (const Extra& joints : extras) {
    uint32_t weights_at = 0;
    for (const Extra& weights : extras) {
      if (joints.kind == ExtraKind::kJoints && weights == Extra{ExtraKind::kWeights, joints.set})
        sets.push_back({joints_at, weights_at, extra_width(weights.kind)});
      weights_at += extra_width(weights.kind);
    }
    joints_at += extra_width(joints.kind);
  }
  return sets;
}

// Of all sets.
std::vector<Influence> influences_of(const Mesh& mesh, std::span<const uint32_t> vertices) {
  const std::vector<SkinSet> sets = skin_sets(mesh.extras);
  const size_t width = extra_width(mesh.extras);
  std::vector<Influence> influences;
  for (uint32_t i = 0; i < vertices.size(); ++i) {
    const float* const values = mesh.extra_values.data() + width * vertices[i];
    for (const SkinSet& set : sets)
      for (uint32_t k = 0; k < set.count; ++k)
        if (values[set.weights_at + k] != 0.0f)
          influences.push_back(
              {i, static_cast<uint32_t>(values[set.joints_at + k]), values[set.weights_at + k]});
  }
  return influences;
}

// For each joint its column: those that move most have one of their own.
std::vector<std::pair<uint32_t, uint32_t>> joint_columns(std::span<const Influence> influences,
                                                         size_t most) {
  std::vector<std::pair<float, uint32_t>> joints;  // how much, which
  const auto place_of = [&](uint32_t joint) {
    return std::lower_bound(joints.begin(), joints.end(), joint,
                            [](const auto& entry, uint32_t j) { return entry.second < j; });
  };
  for (const Influence& influence : influences) {
    auto at = place_of(influence.joint);
    if (at == joints.end() || at->second != influence.joint)
      at = joints.insert(at, {0.0f, influence.joint});
    at->first += influence.weight;
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

void GroupAttributes::gather(std::span<const uint32_t> vertices) {
  weights_.clear();
  values_.clear();
  streams_.clear();
  if (!config_.attributes) return;
  list_streams();
  const Skin skin = find_skin(vertices);
  const size_t count = vertices.size(), width = weights_.size();
  values_.assign(count * width, 0.0f);
  float* column = values_.data();
  for (const Stream& stream : streams_) {
    const auto copy = [&](auto columns) {
      for (size_t v = 0; v < count; ++v)
        std::memcpy(column + width * v, stream.values + size_t{stream.stride} * vertices[v],
                    columns * sizeof(float));
    };
    stream.count == 2   ? copy(std::integral_constant<size_t, 2>())
    : stream.count == 3 ? copy(std::integral_constant<size_t, 3>())
                        : copy(std::integral_constant<size_t, 4>());
    column += stream.count;
  }
  for (const Influence& influence : skin.influences) {
    const auto of_joint = std::lower_bound(skin.columns.begin(), skin.columns.end(),
                                           std::pair{influence.joint, uint32_t{0}});
    column[width * influence.vertex + of_joint->second] += influence.weight;
  }
}

// What refitting changes comes first.
void GroupAttributes::list_streams() {
  const Mesh& mesh = source_.mesh;
  const auto add = [&](const float* values, uint32_t stride, uint32_t count, float weight) {
    streams_.push_back({values, stride, count});
    weights_.insert(weights_.end(), count, weight);
  };
  if (!mesh.normals.empty()) add(&mesh.normals[0].x, 3, 3, config_.normal_weight);
  if (!mesh.uvs.empty()) add(&mesh.uvs[0].x, 2, 2, config_.uv_weight);
  if (!mesh.colors.empty()) add(&mesh.colors[0].x, 4, 4, config_.color_weight);
  if (!mesh.tangents.empty() && config_.tangent_weight > 0.0f)
    add(&mesh.tangents[0].x, 4, 3, config_.tangent_weight);
  uint32_t at = 0;
  for (const Extra& extra : mesh.extras) {
    if (extra.kind == ExtraKind::kUvs && weights_.size() + 2 <= kMostColumns)
      add(mesh.extra_values.data() + at, extra_width(mesh.extras), 2, config_.uv_weight);
    at += extra_width(extra.kind);
  }
}

GroupAttributes::Skin GroupAttributes::find_skin(std::span<const uint32_t> vertices) {
  const auto& extras = source_.mesh.extras;
  const size_t most = std::min(kMostJoints, kMostColumns - weights_.size());
  if (most == 0 || !(config_.skin_weight > 0.0f) ||
      std::none_of(extras.begin(), extras.end(),
                   [](const Extra& extra) { return extra.kind == ExtraKind::kWeights; }))
    return {};
  Skin skin;
  skin.influences = influences_of(source_.mesh, vertices);
  skin.columns = joint_columns(skin.influences, most);
  weights_.insert(weights_.end(), std::min(skin.columns.size(), most), config_.skin_weight);
  return skin;
}

}  // namespace umbel::lod
