// Keeps the groups of a unit as they are finished.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "lod/build/group_sink.hpp"
#include "lod/build/unit.hpp"
#include "scale/exits.hpp"

namespace umbel::scale {

class PartsWriter final : public lod::GroupSink {
 public:
  void add_group(const lod::NewGroup& group) override {
    parts_.groups.push_back({static_cast<uint32_t>(group.members.size()), group.level, group.method,
                             group.limiting_factor, group.sphere, group.error});
    members_.insert(members_.end(), group.members.begin(), group.members.end());
  }

  void finish_level(const lod::ClusterSet& pending) override {
    for (const uint32_t c : std::exchange(members_, {}))
      parts_.clusters.append(pending.cluster_vertices(c), pending.cluster_corners(c),
                             pending.generating_group[c], pending.material[c], pending.boxes[c]);
  }

  /// With the vertices that the clusters have indices of, and the ids of the unit's generators.
  Parts take(const Mesh& vertices, const std::vector<uint32_t>& materials,
             const std::vector<Generator>& generators) {
    parts_.vertices = vertices;
    parts_.materials = materials;
    for (uint32_t& g : parts_.clusters.generating_group)
      parts_.generators.push_back(g == kNone ? kNoGenerator : generators[g].id);
    return std::move(parts_);
  }

 private:
  Parts parts_;
  std::vector<uint32_t> members_;
};

}  // namespace umbel::scale
