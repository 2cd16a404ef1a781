#include "bvh/real_meshes.hpp"
#include "bvh/same_answers.hpp"
#include "kdtree/meshes.hpp"
#include "uniform/cell_lists.hpp"
#include "uniform/meshes.hpp"
#include "uniform/octree_data.hpp"

namespace umbel {
namespace {

using namespace testing;
using uniform::Octree;
using uniform::OctreeConfig;

struct Peek : Octree {
  explicit Peek(Octree&& tree) : Octree(std::move(tree)) {}
  const OctreeData& peek() const { return static_cast<const OctreeData&>(*store_); }
};

TEST(Octree, every_leaf_lists_the_triangles_that_touch_its_cell) {
  for_hard_meshes([](const MeshView& mesh) {
    const Peek tree(Octree::build(mesh));
    const OctreeData& data = tree.peek();
    ASSERT_EQ(data.bounds, bounds(mesh));
    size_t leaves = 0;
    const OctreeNodes nodes(data);
    std::vector<OctreeNodes::Link> stack{nodes.root()};
    while (!stack.empty()) {
      const OctreeNodes::Link link = stack.back();
      stack.pop_back();
      if (!nodes.is_leaf(link)) {
        stack.insert(stack.end(), {nodes.below(link), nodes.above(link)});
        continue;
      }
      ++leaves;
      expect_lists_what_touches(nodes, link, data, mesh);
    }
    EXPECT_EQ(tree.statistics().leaves, leaves);
    EXPECT_EQ(tree.statistics().references, data.reference_count);
    EXPECT_EQ(tree.statistics().nodes, leaves + (leaves - 1) / 7);
  });
}

TEST(Octree, answers_are_those_of_the_hierarchy_in_every_form) {
  for_hard_meshes([](const MeshView& mesh) {
    const Bvh bvh = Bvh::build(mesh);
    const std::vector<Ray> rays = adversarial_rays(mesh, 350, 4);
    for (const Simd simd : {Simd::kPortable, Simd::kAuto})
      for (const bool compact : {false, true}) {
        OctreeConfig config;
        config.simd = simd, config.compact = compact;
        expect_same_rays(Octree::build(mesh, config), bvh, rays);
      }
    expect_same_shapes(Octree::build(mesh), bvh, mesh, 100);
  });
}

TEST(Octree, hits_equal_brute_force_and_masks_and_sizes_change_nothing) {
  const std::vector<Mesh> balls = balls_of_all_sizes();
  const std::vector<uint32_t> masks = mixed_masks(balls[0]);
  for (const Mesh& mesh : balls) {
    const Bvh bvh = Bvh::build(mesh.view()), masked = Bvh::build(mesh.view(), {}, masks);
    const Octree tree = Octree::build(mesh.view());
    const Octree masked_tree = Octree::build(mesh.view(), {}, masks);
    for (const Ray& ray : adversarial_rays(mesh.view(), 350, 5)) {
      ASSERT_EQ(tree.intersect(ray), bvh.intersect(ray));
      ASSERT_EQ(masked_tree.intersect(ray, {2}), masked.intersect(ray, {2}));
    }
  }
  for (const NamedMesh& named : hard_meshes()) {
    const MeshView mesh = named.mesh.view();
    const Octree tree = Octree::build(mesh);
    for (const Ray& ray : adversarial_rays(mesh, 140, 9))
      EXPECT_TRUE(is_right(mesh, ray, trace_all(mesh, ray), tree.intersect(ray))) << named.name;
  }
}

TEST(Octree, rays_in_planes_between_cells_miss_nothing) {
  const Mesh mesh = boxes(6);
  const Bvh bvh = Bvh::build(mesh.view());
  std::vector<Ray> rays;
  for (int x = 0; x <= 24; ++x)
    for (int y = 0; y <= 24; ++y)
      for (const Vec3& d : {Vec3{1, 0, 0}, Vec3{0, -1, 0}, Vec3{0, 0, 1}, Vec3{1, 1, 0},
                            Vec3{-1, 1, 0}, Vec3{1, -0.0f, 0.25f}})
        rays.push_back({{float(x) / 4, float(y) / 4, 0.375f}, 0, d});
  expect_same_rays(Octree::build(mesh.view()), bvh, rays);
}

TEST(Octree, the_same_bytes_for_any_number_of_threads) {
  for (const Mesh& mesh : {shapes::blob(5, 2), boxes(45)}) {
    const Peek one(Octree::build(mesh.view(), {}, {}, {.progress = {}, .threads = 1}));
    for (const uint32_t threads : {2u, 5u, 0u}) {
      const Peek again(Octree::build(mesh.view(), {}, {}, {.progress = {}, .threads = threads}));
      const OctreeData &a = one.peek(), &b = again.peek();
      EXPECT_EQ(a.leaves, b.leaves);
      ASSERT_EQ(a.nodes.size(), b.nodes.size());
      for (size_t i = 0; i < a.nodes.size(); ++i) {
        ASSERT_EQ(a.nodes[i].children, b.nodes[i].children);
        if (a.nodes[i].is_leaf()) {
          ASSERT_EQ(a.nodes[i].list, b.nodes[i].list);
        } else {
          ASSERT_EQ(a.nodes[i].middle, b.nodes[i].middle);
        }
      }
    }
  }
}

TEST(Octree, stays_within_its_bounds_on_what_never_comes_apart) {
  for (const NamedMesh& named : inseparable_meshes()) {
    SCOPED_TRACE(named.name);
    for (const float most : {1.0f, 3.0f, 16.0f}) {
      OctreeConfig config;
      config.max_references = most;
      const uniform::Statistics s = Octree::build(named.mesh.view(), config).statistics();
      EXPECT_LE(double(s.references), double(most) * double(named.mesh.triangles.size()));
      EXPECT_LE(s.max_depth, kMaxOctreeDepth);
    }
  }
}

TEST(Octree, real_meshes_and_nasty_ones) {
  for_real_meshes(kNastyFiles, [](const char*, const Mesh& mesh) {
    const Bvh bvh = Bvh::build(mesh.view());
    const Octree tree = Octree::build(mesh.view());
    for (const Ray& ray : adversarial_rays(mesh.view(), 700, 8))
      ASSERT_EQ(tree.intersect(ray), bvh.intersect(ray));
  });
}

TEST(Octree, is_empty_without_triangles_and_refuses_what_is_wrong) {
  const Ray ray{{0, 0, 0}, 0, {0, 0, 1}};
  EXPECT_FALSE(Octree().intersect(ray).hit());
  EXPECT_EQ(Octree::build(MeshView{}).statistics().nodes, 0u);
  Mesh mesh = shapes::sphere(1);
  Octree tree = Octree::build(mesh.view());
  const Octree other = std::move(tree);
  EXPECT_TRUE(other.occluded(ray));
  EXPECT_FALSE(tree.occluded(ray));  // NOLINT(bugprone-use-after-move)
  OctreeConfig config;
  config.max_leaf_size = 0;
  EXPECT_THROW(Octree::build(mesh.view(), config), Error);
  config = {};
  config.max_depth = 21;
  EXPECT_THROW(Octree::build(mesh.view(), config), Error);
  config = {};
  config.max_references = NAN;
  EXPECT_THROW(Octree::build(mesh.view(), config), Error);
  mesh.positions[3].y = NAN;
  EXPECT_THROW(Octree::build(mesh.view()), Error);
  config = {};
  config.invalid = bvh::InvalidTriangles::kDrop;
  EXPECT_TRUE(Octree::build(mesh.view(), config).occluded(ray));
}

}  // namespace
}  // namespace umbel
