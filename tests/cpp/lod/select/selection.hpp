// Selection by the device's functions, on the processor.
#pragma once

#include <algorithm>
#include <vector>

#include "lod/select/select_queue.hpp"

namespace umbel::cuda::testing {

/// A mesh's tables as a device has them, with room for any cut.
struct Mesh {
  const lod::Tables& tables;
  std::span<const ClusterBounds> normal_cones{};

  DeviceTables view() const {
    uint32_t layers = 0;
    for (std::vector<uint32_t> layer(tables.nodes.empty() ? 0 : 1, 0); !layer.empty(); ++layers) {
      std::vector<uint32_t> next;
      for (const uint32_t n : layer)
        for (uint32_t k = 0; k < tables.nodes[n].children.count; ++k)
          next.push_back(tables.nodes[n].children.offset + k);
      layer = next;
    }
    return {tables.nodes.data(),
            tables.groups.data(),
            tables.clusters.data(),
            normal_cones.empty() ? nullptr : normal_cones.data(),
            uint32_t(tables.groups.size()),
            layers};
  }
};

struct Pages {
  std::vector<uint32_t> of_group;
  std::vector<uint8_t> resident;
  std::vector<uint32_t> states = std::vector<uint32_t>(of_group.size(), 77);

  DevicePages view() {
    return {of_group.data(), resident.data(), states.data(), uint32_t(resident.size())};
  }
};

struct Selection {
  lod::InstanceCuts cuts;
  SelectionCounts counts{};
  std::vector<float> urgencies;
  std::vector<uint32_t> requests;
};

/// Room for whatever instances can show of a mesh.
inline SelectionRoom all_room(const lod::Tables& tables, size_t instances) {
  return {uint32_t(tables.nodes.size() * instances), uint32_t(tables.groups.size() * instances),
          uint32_t(tables.clusters.size() * instances)};
}

inline Selection selected(const Mesh& mesh, const lod::View& view,
                          std::span<const lod::Plane> planes, std::span<const Transform> instances,
                          const SelectionRoom& room, Pages* pages = nullptr) {
  CpuExec exec;
  Selection s;
  const size_t page_count = pages ? pages->resident.size() : 0;
  // What is not written would be seen.
  s.cuts.offsets.assign(instances.size() + 1, 12345);
  s.cuts.clusters.assign(room.clusters, 54321);
  s.urgencies.assign(page_count, -1);
  s.requests.assign(page_count, 99999);
  const DeviceTables tables = mesh.view();
  DevicePages there;
  DeviceFeedback feedback;
  if (pages) {
    there = pages->view();
    mark_groups(exec, tables, mesh.tables.levels.data(), uint32_t(mesh.tables.levels.size()),
                there);
    feedback = {s.urgencies.data(), s.requests.data()};
  }
  select_by_queue(
      exec, tables,
      {&view, planes.data(), uint32_t(planes.size()), instances.data(), uint32_t(instances.size())},
      there, room, {s.cuts.offsets.data(), s.cuts.clusters.data(), &s.counts}, feedback);
  s.cuts.clusters.resize(s.cuts.offsets.back());
  s.requests.resize(s.counts.requests);
  return s;
}

}  // namespace umbel::cuda::testing
