// lod::Grouper: groups of neighbouring clusters, and the positions that they share.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "lod/build/clusterise.hpp"
#include "lod/build/group.hpp"
#include "umbel/mesh.hpp"

namespace umbel::lod {
namespace {

struct Scene {
  Source source;
  ClusterSet clusters;

  explicit Scene(const Mesh& mesh) {
    source = make_source(mesh.view(), {});
    std::vector<Sphere> spheres;
    clusterise_source(source, config(), clusters, spheres);
  }

  static Config config() {
    Config config;
    config.max_triangles = 32;
    config.min_group = 6;
    config.max_group = 10;
    return config;
  }

  // 1 where clusters of two groups use a position.
  std::vector<uint8_t> shared(const Clusters& groups) const {
    std::vector<uint32_t> group_at(source.mesh.positions.size(), kNone);
    std::vector<uint8_t> result(source.mesh.positions.size(), 0);
    for (uint32_t g = 0; g < groups.ranges.size(); ++g)
      for (uint32_t i = 0; i < groups.ranges[g].count; ++i)
        for (uint32_t v : clusters.cluster_vertices(groups.items[groups.ranges[g].offset + i])) {
          const uint32_t p = source.position_ids[v];
          if (group_at[p] != kNone && group_at[p] != g) result[p] = 1;
          group_at[p] = g;
        }
    return result;
  }
};

/// Two halves with vertices of their own along the seam between them.
Mesh with_seam() {
  Mesh mesh = shapes::terrain(64, 64, 3);
  mesh.materials.resize(mesh.triangles.size(), 0);
  std::fill(mesh.materials.begin() + mesh.triangles.size() / 2, mesh.materials.end(), 1u);
  return mesh;
}

TEST(Grouper, groups_have_every_cluster_once_and_keep_the_limits) {
  for (const Mesh& mesh : {shapes::blob(5, 3), with_seam(), shapes::soup(500, 2)}) {
    const Scene scene(mesh);
    Grouper grouper(scene.source);
    grouper.grow();
    const std::vector<uint8_t> locked(scene.source.mesh.positions.size(), 0);
    Clusters groups = grouper.group(scene.clusters, locked, Scene::config());
    ASSERT_GT(groups.ranges.size(), 1u);
    for (const Range& range : groups.ranges) {
      EXPECT_LE(range.count, Scene::config().max_group);
      EXPECT_GE(range.count, 1u);
    }
    std::sort(groups.items.begin(), groups.items.end());
    std::vector<uint32_t> all(scene.clusters.size());
    std::iota(all.begin(), all.end(), 0u);
    EXPECT_EQ(groups.items, all);
  }
}

TEST(Grouper, locks_what_two_groups_share_and_frees_the_rest) {
  for (const Mesh& mesh : {shapes::blob(5, 3), with_seam()}) {
    const Scene scene(mesh);
    Grouper grouper(scene.source);
    grouper.grow();
    std::vector<uint8_t> locked(scene.source.mesh.positions.size(), 0);
    const Clusters first = grouper.group(scene.clusters, locked, Scene::config());
    grouper.lock_borders(first, locked);
    EXPECT_EQ(locked, scene.shared(first));
    EXPECT_GT(std::count(locked.begin(), locked.end(), 1), 0);
    const Clusters second = grouper.group(scene.clusters, locked, Scene::config());
    grouper.lock_borders(second, locked);
    EXPECT_EQ(locked, scene.shared(second));
  }
}

TEST(Grouper, borders_of_the_last_round_tend_to_lie_inside) {
  const Scene scene(shapes::blob(6, 3));
  Grouper grouper(scene.source);
  grouper.grow();
  std::vector<uint8_t> locked(scene.source.mesh.positions.size(), 0);
  const auto locked_again = [&](std::vector<uint8_t> seen) {
    const Clusters groups = grouper.group(scene.clusters, seen, Scene::config());
    const std::vector<uint8_t> now = scene.shared(groups);
    size_t again = 0;
    for (size_t p = 0; p < now.size(); ++p) again += now[p] && locked[p];
    return again;
  };
  grouper.lock_borders(grouper.group(scene.clusters, locked, Scene::config()), locked);
  EXPECT_LT(2 * locked_again(locked), locked_again(std::vector<uint8_t>(locked.size(), 0)));
}

TEST(Grouper, what_is_prepared_ahead_gives_the_same_groups) {
  const Scene scene(with_seam());
  Grouper grouper(scene.source), prepared(scene.source);
  grouper.grow();
  prepared.grow();
  const std::vector<uint8_t> locked(scene.source.mesh.positions.size(), 0);
  prepared.prepare(scene.clusters);
  for (int round = 0; round < 2; ++round) {
    const Clusters a = grouper.group(scene.clusters, locked, Scene::config());
    const Clusters b = prepared.group(scene.clusters, locked, Scene::config());
    EXPECT_EQ(a.items, b.items);
    EXPECT_TRUE(std::ranges::equal(a.ranges, b.ranges));
  }
}

}  // namespace
}  // namespace umbel::lod
