// Meshes as sources, and all units of one.
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "asset/scratch.hpp"
#include "io/source/mesh_source.hpp"
#include "scale/build_partition.hpp"
#include "scale/route.hpp"
#include "scale/summary.hpp"

namespace umbel::scale::testing {

/// A mesh with everything that routing carries.
inline Mesh rich(Mesh mesh) {
  std::mt19937 random(7);
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    mesh.uvs.push_back({static_cast<float>(v), 0.5f});
    mesh.colors.push_back({0, static_cast<float>(random() % 3), 1, 1});
    mesh.extra_values.push_back(static_cast<float>(v % 5));
    mesh.extra_values.push_back(2.0f);
  }
  mesh.normals.assign(mesh.positions.size(), Vec3{0, 0, 1});
  mesh.extras = {{ExtraKind::kUvs, 1}};
  for (size_t i = 0; i < mesh.triangles.size(); ++i)
    mesh.materials.push_back(static_cast<uint32_t>(random() % 2));
  return mesh;
}

struct Units {
  Partition partition;
  Aabb box;
  std::vector<UnitInput> units;
};

/// All units, routed in shards of that many triangles.
inline Units all_units(const Mesh& mesh, uint64_t capacity, uint64_t shard) {
  const umbel::testing::Scratch scratch;
  const io::MeshSource source(mesh.view(), {0, 0, 0}, "mesh");
  const SourceSummary summary = summarise(source, 0, source.triangles());
  const PointRule rule;
  PartitionConfig config;
  config.capacity = capacity;
  Units all;
  all.box = box_of(summary, rule);
  all.partition = build_partition(source, rule, all.box, config);
  const auto files = route(source, all.partition, {rule, capacity}, scratch / ".", shard);
  for (uint32_t u = 0; u < all.partition.units(); ++u)
    all.units.push_back(read_unit(files, all.partition, source.streams(), all.box, u));
  return all;
}

}  // namespace umbel::scale::testing
