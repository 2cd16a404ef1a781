// lod::Grouper: groups of neighbouring clusters, and the positions that they share.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "base/math.hpp"
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

/// Groups that `config` makes of the clusters of a mesh, none of whose positions is locked.
Clusters grouped(const Scene& scene, const Config& config) {
  Grouper grouper(scene.source);
  grouper.grow();
  const std::vector<uint8_t> locked(scene.source.mesh.positions.size(), 0);
  return grouper.group(scene.clusters, locked, config);
}

TEST(Grouper, rounds_of_other_clusters_before_change_nothing) {
  Scene scene(with_seam());
  const Clusters alone = grouped(scene, Scene::config());
  Config finer = Scene::config();
  finer.max_triangles = 8;
  ClusterSet more;
  std::vector<Sphere> spheres;
  clusterise_source(scene.source, finer, more, spheres);
  ASSERT_GT(more.size(), 3 * scene.clusters.size());
  const std::vector<uint8_t> locked(scene.source.mesh.positions.size(), 0);
  Grouper grouper(scene.source);
  grouper.grow();
  for (int round = 0; round < 3; ++round) {
    const Clusters after = grouper.group(scene.clusters, locked, Scene::config());
    EXPECT_EQ(after.items, alone.items);
    EXPECT_TRUE(std::ranges::equal(after.ranges, alone.ranges));
    grouper.group(more, locked, Scene::config());
  }
}

Config small_groups() {
  Config config;
  config.min_group = 4;
  config.max_group = 16;
  return config;
}

double mean_count(const Clusters& groups) {
  return double(groups.items.size()) / double(groups.ranges.size());
}

/// The area that is common to the boxes of two groups, over all pairs, as a part of all area.
double overlap(const Scene& scene, const Clusters& groups) {
  std::vector<Aabb> boxes;
  double common = 0, area = 0;
  for (const Range& range : groups.ranges) {
    Aabb box;
    for (uint32_t i = 0; i < range.count; ++i)
      extend(box, scene.clusters.boxes[groups.items[range.offset + i]]);
    for (const Aabb& other : boxes)
      common += half_area({max(box.min, other.min), min(box.max, other.max)});
    boxes.push_back(box);
    area += half_area(box);
  }
  return common / area;
}

// Triangles of a soup share nothing: what clusters share would decide, and costs be second.
TEST(Grouper, the_higher_the_underfill_cost_the_fuller_are_groups) {
  for (uint32_t seed : {1u, 2u, 3u}) {
    const Scene scene(shapes::soup(20000, seed));
    std::vector<double> counts;
    for (float cost : {0.0f, 0.5f, 1.0f}) {
      Config config = small_groups();
      config.group_underfill_cost = cost;
      counts.push_back(mean_count(grouped(scene, config)));
    }
    EXPECT_LT(counts[0], 11);
    EXPECT_GT(counts[1], 13);
    EXPECT_GT(counts[2], 15.5);
  }
}

TEST(Grouper, an_overlap_cost_makes_groups_overlap_less) {
  for (uint32_t seed : {1u, 2u, 3u}) {
    const Scene scene(shapes::soup(20000, seed));
    Config config = small_groups();
    const double without = overlap(scene, grouped(scene, config));
    config.group_overlap_cost = 1;
    EXPECT_LT(overlap(scene, grouped(scene, config)), 0.97 * without);
  }
}

TEST(Grouper, a_larger_least_size_makes_groups_fuller) {
  for (const Mesh& mesh : {shapes::blob(6, 3), shapes::terrain(160, 160, 2)}) {
    const Scene scene(mesh);
    Config config = small_groups();
    const double small = mean_count(grouped(scene, config));
    config.min_group = 12;
    const Clusters groups = grouped(scene, config);
    EXPECT_GT(mean_count(groups), small + 0.5);
    EXPECT_TRUE(std::ranges::all_of(groups.ranges, [](const Range& r) { return r.count >= 12; }));
  }
}

}  // namespace
}  // namespace umbel::lod
