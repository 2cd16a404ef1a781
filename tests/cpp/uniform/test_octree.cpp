#include "bvh/same_answers.hpp"
#include "kdtree/meshes.hpp"
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
  for (const NamedMesh& named : hard_meshes()) {
    SCOPED_TRACE(named.name);
    const MeshView mesh = named.mesh.view();
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
      std::vector<uint32_t> listed;
      nodes.visit_runs(link, [&](uint32_t run) {
        data.for_each_triangle(run, [&](const LeafTriangle& t) { listed.push_back(t.primitive); });
      });
      ASSERT_TRUE(std::is_sorted(listed.begin(), listed.end()));
      for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
        const Triangle& c = mesh.triangles[t];
        const bool touches = touches_box(link.cell, mesh.positions[c[0]], mesh.positions[c[1]],
                                         mesh.positions[c[2]]);
        if (touches) {
          ASSERT_TRUE(std::binary_search(listed.begin(), listed.end(), t)) << "triangle " << t;
        }
      }
    }
    EXPECT_EQ(tree.statistics().leaves, leaves);
    EXPECT_EQ(tree.statistics().references, data.reference_count);
    EXPECT_EQ(tree.statistics().nodes, leaves + (leaves - 1) / 7);
  }
}

TEST(Octree, answers_are_those_of_the_hierarchy_in_every_form) {
  for (const NamedMesh& named : hard_meshes()) {
    SCOPED_TRACE(named.name);
    const MeshView mesh = named.mesh.view();
    const Bvh bvh = Bvh::build(mesh);
    const std::vector<Ray> rays = adversarial_rays(mesh, 350, 4);
    for (const Simd simd : {Simd::kPortable, Simd::kAuto})
      for (const bool compact : {false, true}) {
        OctreeConfig config;
        config.simd = simd, config.compact = compact;
        expect_same_rays(Octree::build(mesh, config), bvh, rays);
      }
    expect_same_shapes(Octree::build(mesh), bvh, mesh, 100);
  }
}

TEST(Octree, hits_equal_brute_force_and_masks_and_sizes_change_nothing) {
  const Mesh ball = shapes::blob(3, 2);
  std::vector<uint32_t> masks(ball.triangles.size());
  for (uint32_t i = 0; i < masks.size(); ++i) masks[i] = 1 + i % 3;
  for (const Mesh& mesh : {ball, transformed(ball, 1e-12f), transformed(ball, 1e12f),
                           transformed(ball, 1, {1000, -3000, 500})}) {
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
  const NamedMesh meshes[] = {{"concentric", concentric(4000)},
                              {"identical", identical(10000)},
                              {"needles", needles(4000)},
                              {"fan", shapes::fan(10000)},
                              {"on a line", on_a_line(5000)}};
  for (const NamedMesh& named : meshes) {
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
  bool is_any = false;
  for (const char* name :
       {"nasty_synth_all_degenerate.ply", "nasty_mpi_180.ply", "nasty_office_chair_7k.ply",
        "nasty_synth_t_junctions.ply", "nasty_synth_dragon_tiny.ply",
        "nasty_synth_dragon_scale_1e15.ply", "nasty_synth_same_centroid_20k.ply",
        "nasty_synth_dragon_ecef_f32.ply"}) {
    const std::optional<Mesh> mesh = read_mesh(name);
    if (!mesh) continue;
    is_any = true;
    SCOPED_TRACE(name);
    const Bvh bvh = Bvh::build(mesh->view());
    const Octree tree = Octree::build(mesh->view());
    for (const Ray& ray : adversarial_rays(mesh->view(), 700, 8))
      ASSERT_EQ(tree.intersect(ray), bvh.intersect(ray));
  }
  if (!is_any) GTEST_SKIP() << "no meshes in " << data_folder();
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
