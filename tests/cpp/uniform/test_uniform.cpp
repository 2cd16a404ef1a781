#include <array>
#include <cstring>

#include "bvh/real_meshes.hpp"
#include "bvh/same_answers.hpp"
#include "kdtree/meshes.hpp"
#include "uniform/grid_data.hpp"
#include "uniform/interval_data.hpp"
#include "uniform/meshes.hpp"

namespace umbel {
namespace {

using namespace testing;
using uniform::GridConfig;
using uniform::IntervalConfig;
using uniform::IntervalHierarchy;
using uniform::TwoLevelGrid;

constexpr Simd kSimds[] = {Simd::kPortable, Simd::kAuto};

GridConfig grid_config(Simd simd, bool compact) {
  GridConfig config;
  config.simd = simd, config.compact = compact;
  return config;
}
IntervalConfig interval_config(Simd simd, bool compact) {
  IntervalConfig config;
  config.simd = simd, config.compact = compact;
  return config;
}

/// Runs check(structure, name) for both, in every form.
template <typename Check>
void for_structures(const MeshView& mesh, const Check& check) {
  for (const Simd simd : kSimds)
    for (const bool compact : {false, true}) {
      check(TwoLevelGrid::build(mesh, grid_config(simd, compact)), "grid");
      check(IntervalHierarchy::build(mesh, interval_config(simd, compact)), "intervals");
    }
}

TEST(Uniform, hits_are_those_of_the_hierarchy) {
  for (const NamedMesh& named : hard_meshes()) {
    const MeshView mesh = named.mesh.view();
    const Bvh bvh = Bvh::build(mesh);
    const std::vector<Ray> rays = adversarial_rays(mesh, 350, 4);
    for_structures(mesh, [&](const TriangleQueries& structure, const char* name) {
      SCOPED_TRACE(named.name + ", " + name);
      expect_same_rays(structure, bvh, rays);
    });
  }
}

TEST(Uniform, hits_equal_brute_force) {
  for (const NamedMesh& named : hard_meshes()) {
    const MeshView mesh = named.mesh.view();
    const std::vector<Ray> rays = adversarial_rays(mesh, 140, 9);
    const TwoLevelGrid grid = TwoLevelGrid::build(mesh);
    const IntervalHierarchy intervals = IntervalHierarchy::build(mesh);
    for (const Ray& ray : rays) {
      const Truth truth = trace_all(mesh, ray);
      EXPECT_TRUE(is_right(mesh, ray, truth, grid.intersect(ray))) << named.name;
      EXPECT_TRUE(is_right(mesh, ray, truth, intervals.intersect(ray))) << named.name;
    }
  }
}

/// Rays in the planes between cells, along them and through where they cross.
TEST(Uniform, rays_in_planes_of_the_grid_miss_nothing) {
  const Mesh mesh = boxes(6);
  const Bvh bvh = Bvh::build(mesh.view());
  const TwoLevelGrid grid = TwoLevelGrid::build(mesh.view());
  const IntervalHierarchy intervals = IntervalHierarchy::build(mesh.view());
  std::vector<Ray> rays;
  for (int x = 0; x <= 24; ++x)
    for (int y = 0; y <= 24; ++y)
      for (const Vec3& d : {Vec3{1, 0, 0}, Vec3{0, -1, 0}, Vec3{0, 0, 1}, Vec3{1, 1, 0},
                            Vec3{-1, 1, 0}, Vec3{1, -0.0f, 0.25f}})
        rays.push_back({{float(x) / 4, float(y) / 4, 0.25f}, 0, d});
  expect_same_rays(grid, bvh, rays);
  expect_same_rays(intervals, bvh, rays);
}

TEST(Uniform, masks_intervals_and_sizes_are_those_of_the_hierarchy) {
  const std::vector<Mesh> balls = balls_of_all_sizes();
  const std::vector<uint32_t> masks = mixed_masks(balls[0]);
  for (const Mesh& mesh : balls) {
    const Bvh bvh = Bvh::build(mesh.view(), {}, masks);
    const TwoLevelGrid grid = TwoLevelGrid::build(mesh.view(), {}, masks);
    const IntervalHierarchy intervals = IntervalHierarchy::build(mesh.view(), {}, masks);
    for (Ray ray : adversarial_rays(mesh.view(), 700, 5)) {
      const Hit hit = bvh.intersect(ray, {2});
      ASSERT_EQ(grid.intersect(ray, {2}), hit);
      ASSERT_EQ(intervals.intersect(ray, {2}), hit);
      if (!hit.hit()) continue;
      ray.t_max = hit.t * 0.999f;
      ASSERT_EQ(grid.occluded(ray), bvh.occluded(ray));
      ASSERT_EQ(intervals.occluded(ray), bvh.occluded(ray));
      ray.t_min = hit.t * 0.5f, ray.t_max = hit.t * 2;
      ASSERT_EQ(grid.intersect(ray), bvh.intersect(ray));
      ASSERT_EQ(intervals.intersect(ray), bvh.intersect(ray));
    }
  }
}

TEST(Uniform, distances_and_overlaps_are_those_of_the_hierarchy) {
  for (const NamedMesh& named : hard_meshes()) {
    const MeshView mesh = named.mesh.view();
    const Bvh bvh = Bvh::build(mesh);
    SCOPED_TRACE(named.name);
    expect_same_shapes(TwoLevelGrid::build(mesh), bvh, mesh, 100);
    expect_same_shapes(IntervalHierarchy::build(mesh), bvh, mesh, 100);
  }
}

template <typename Structure>
const LeafStore& store_of(const Structure& structure) {
  struct Peek : Structure {
    static const LeafStore& of(const Structure& s) { return *(s.*(&Peek::store_)); }
  };
  return Peek::of(structure);
}

TEST(Uniform, same_bytes_for_any_number_of_threads) {
  const Mesh meshes[] = {shapes::blob(5, 2), boxes(45)};
  for (const Mesh& mesh : meshes) {
    const TwoLevelGrid grid =
        TwoLevelGrid::build(mesh.view(), {}, {}, {.progress = {}, .threads = 1});
    const IntervalHierarchy tree =
        IntervalHierarchy::build(mesh.view(), {}, {}, {.progress = {}, .threads = 1});
    const auto& g = static_cast<const GridData&>(store_of(grid));
    const auto& t = static_cast<const IntervalData&>(store_of(tree));
    for (const uint32_t threads : {2u, 5u, 0u}) {
      const TwoLevelGrid grid_again =
          TwoLevelGrid::build(mesh.view(), {}, {}, {.progress = {}, .threads = threads});
      const IntervalHierarchy tree_again =
          IntervalHierarchy::build(mesh.view(), {}, {}, {.progress = {}, .threads = threads});
      const auto& g2 = static_cast<const GridData&>(store_of(grid_again));
      const auto& t2 = static_cast<const IntervalData&>(store_of(tree_again));
      EXPECT_TRUE(g.leaves == g2.leaves && g.tops.size() == g2.tops.size() &&
                  g.cells.size() == g2.cells.size());
      EXPECT_EQ(std::memcmp(g.cells.data(), g2.cells.data(), g.cells.size() * sizeof g.cells[0]),
                0);
      EXPECT_TRUE(t.leaves == t2.leaves && t.nodes.size() == t2.nodes.size());
      EXPECT_EQ(std::memcmp(t.nodes.data(), t2.nodes.data(), t.nodes.size() * sizeof t.nodes[0]),
                0);
    }
  }
}

TEST(Uniform, stays_within_its_bounds_on_what_never_comes_apart) {
  for (const NamedMesh& named : inseparable_meshes()) {
    SCOPED_TRACE(named.name);
    const auto count = static_cast<uint32_t>(named.mesh.triangles.size());
    for (const float most : {1.0f, 3.0f, 16.0f}) {
      GridConfig config;
      config.max_references = most;
      EXPECT_LE(double(TwoLevelGrid::build(named.mesh.view(), config).statistics().references),
                double(most) * count);
    }
    const uniform::Statistics s = IntervalHierarchy::build(named.mesh.view()).statistics();
    EXPECT_EQ(s.references, count);
    EXPECT_LE(s.max_depth, kMaxIntervalDepth);
  }
}

TEST(Uniform, real_meshes_and_nasty_ones) {
  std::vector<const char*> files(std::begin(kNastyFiles), std::end(kNastyFiles));
  files.push_back("conference_331k.ply");
  for_real_meshes(files, [](const char*, const Mesh& mesh) {
    const Bvh bvh = Bvh::build(mesh.view());
    const std::vector<Ray> rays = adversarial_rays(mesh.view(), 700, 8);
    const TwoLevelGrid grid = TwoLevelGrid::build(mesh.view());
    const IntervalHierarchy intervals = IntervalHierarchy::build(mesh.view());
    for (const Ray& ray : rays) {
      const Hit hit = bvh.intersect(ray);
      ASSERT_EQ(grid.intersect(ray), hit);
      ASSERT_EQ(intervals.intersect(ray), hit);
    }
  });
}

TEST(Uniform, nothing_is_hit_without_triangles_and_moves_leave_none) {
  const Ray ray{{0, 0, 0}, 0, {0, 0, 1}};
  EXPECT_FALSE(TwoLevelGrid().intersect(ray).hit());
  EXPECT_FALSE(IntervalHierarchy().intersect(ray).hit());
  const Mesh mesh = shapes::sphere(1);
  TwoLevelGrid grid = TwoLevelGrid::build(mesh.view());
  IntervalHierarchy tree = IntervalHierarchy::build(mesh.view());
  const TwoLevelGrid other_grid = std::move(grid);
  const IntervalHierarchy other_tree = std::move(tree);
  EXPECT_TRUE(other_grid.occluded(ray) && other_tree.occluded(ray));
  EXPECT_FALSE(grid.occluded(ray) || tree.occluded(ray));  // NOLINT(bugprone-use-after-move)
  EXPECT_EQ(TwoLevelGrid::build(MeshView{}).statistics().nodes, 0u);
  EXPECT_EQ(IntervalHierarchy::build(MeshView{}).statistics().nodes, 0u);
}

TEST(Uniform, refuses_what_is_wrong) {
  Mesh mesh = shapes::sphere(1);
  const std::vector<uint32_t> masks(3);
  EXPECT_THROW(TwoLevelGrid::build(mesh.view(), {}, masks), Error);
  EXPECT_THROW(IntervalHierarchy::build(mesh.view(), {}, masks), Error);
  GridConfig grid;
  grid.density = 0;
  EXPECT_THROW(TwoLevelGrid::build(mesh.view(), grid), Error);
  grid = {};
  grid.leaf_density = NAN;
  EXPECT_THROW(TwoLevelGrid::build(mesh.view(), grid), Error);
  grid = {};
  grid.max_references = 65;
  EXPECT_THROW(TwoLevelGrid::build(mesh.view(), grid), Error);
  IntervalConfig intervals;
  intervals.max_leaf_size = 0;
  EXPECT_THROW(IntervalHierarchy::build(mesh.view(), intervals), Error);
  mesh.positions[3].y = NAN;
  EXPECT_THROW(TwoLevelGrid::build(mesh.view()), Error);
  EXPECT_THROW(IntervalHierarchy::build(mesh.view()), Error);
  grid = {};
  grid.invalid = intervals.invalid = bvh::InvalidTriangles::kDrop;
  intervals.max_leaf_size = 4;
  const Ray ray{{0, 0, 0}, 0, {0, 0, 1}};
  EXPECT_EQ(TwoLevelGrid::build(mesh.view(), grid).intersect(ray),
            IntervalHierarchy::build(mesh.view(), intervals).intersect(ray));
  const BuildOptions cancel{.progress = [](float, std::string_view) { return false; },
                            .threads = 0};
  EXPECT_THROW(TwoLevelGrid::build(shapes::sphere(1).view(), {}, {}, cancel), Error);
  EXPECT_THROW(IntervalHierarchy::build(shapes::sphere(1).view(), {}, {}, cancel), Error);
}

/// The fractions that a build reports, in order; it is cancelled from `limit` on.
template <typename Structure>
std::vector<float> fractions_of(float limit, uint32_t threads) {
  static const Mesh mesh = shapes::terrain(200, 200, 3);
  std::vector<float> fractions;
  const auto follow = [&](float fraction, std::string_view) {
    fractions.push_back(fraction);
    return fraction < limit;
  };
  const BuildOptions options{.progress = follow, .threads = threads};
  if (limit > 1)
    Structure::build(mesh.view(), {}, {}, options);
  else
    EXPECT_THROW(Structure::build(mesh.view(), {}, {}, options), Error);
  EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
  return fractions;
}

template <typename Structure>
void expect_progress() {
  for (const uint32_t threads : {1u, 2u}) {
    EXPECT_GT(fractions_of<Structure>(2, threads).size(), 5u);
    EXPECT_EQ(fractions_of<Structure>(2, threads).back(), 1);
    const float last = fractions_of<Structure>(0.3f, threads).back();
    EXPECT_TRUE(last >= 0.3f && last < 1) << last;
  }
}

TEST(Uniform, builds_report_progress_and_stop_halfway) {
  expect_progress<TwoLevelGrid>();
  expect_progress<uniform::Octree>();
  expect_progress<IntervalHierarchy>();
}

}  // namespace
}  // namespace umbel
