#include <gtest/gtest.h>

#include <algorithm>

#include "bvh/oracle.hpp"
#include "kdtree/meshes.hpp"
#include "umbel/kdtree.hpp"

namespace umbel {
namespace {

using namespace testing;
using kdtree::KdTree, kdtree::KdTreeConfig, kdtree::Traversal;

std::string described(const KdTreeConfig& c) {
  return std::string(name(c.tree.builder)) + ", " + std::string(name(c.traversal)) +
         (c.compact ? ", compact" : "") + ", simd " + std::to_string(static_cast<int>(c.simd));
}

std::vector<KdTreeConfig> all_configs() {
  std::vector<KdTreeConfig> all;
  for (const kdtree::Builder builder : {kdtree::Builder::kExact, kdtree::Builder::kBinned})
    for (const Traversal traversal : kTraversals)
      for (const Simd simd : simd_paths())
        for (const bool compact : {false, true}) {
          KdTreeConfig config;
          config.tree.builder = builder;
          config.traversal = traversal;
          config.simd = simd;
          config.compact = compact;
          all.push_back(config);
        }
  return all;
}

/// Rays from the planes of the tree, along them, through where they cross, and the usual ones.
std::vector<Ray> hard_rays(const MeshView& mesh, size_t count, uint32_t seed) {
  std::vector<Ray> rays = adversarial_rays(mesh, count, seed);
  const kdtree::Tree tree = kdtree::build(mesh);
  std::vector<float> planes[3];
  for (const kdtree::Node& node : tree.nodes)
    if (!node.is_leaf()) planes[node.axis()].push_back(node.at);
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(-1, 1);
  const size_t usual = rays.size();
  for (size_t i = 0; i < usual; ++i) {
    Ray ray = rays[i];
    const uint32_t kind = random() % 4;
    for (uint32_t axis = 0; axis < 3; ++axis) {
      if (planes[axis].empty() || (kind != 3 && random() % 2)) continue;
      (&ray.origin.x)[axis] = planes[axis][random() % planes[axis].size()];
      if (kind == 1) (&ray.direction.x)[axis] = random() % 2 ? 0.0f : -0.0f;
      if (kind == 2) (&ray.direction.x)[axis] = 1e-7f * unit(random);
    }
    if (ray.direction.x == 0 && ray.direction.y == 0 && ray.direction.z == 0) ray.direction.x = -1;
    rays.push_back(ray);
  }
  return rays;
}

TEST(KdTreeRays, every_traversal_equals_brute_force) {
  for (const NamedMesh& named : hard_meshes()) {
    const MeshView mesh = named.mesh.view();
    const std::vector<Ray> rays = hard_rays(mesh, 210, 3);
    std::vector<Truth> truths;
    for (const Ray& ray : rays) truths.push_back(trace_all(mesh, ray));
    for (const KdTreeConfig& config : all_configs()) {
      SCOPED_TRACE(named.name + ", " + described(config));
      const KdTree tree = KdTree::build(mesh, config);
      for (size_t i = 0; i < rays.size(); ++i) {
        const Hit hit = tree.intersect(rays[i]);
        EXPECT_TRUE(is_right(mesh, rays[i], truths[i], hit)) << "ray " << i;
        EXPECT_EQ(tree.occluded(rays[i]), hit.hit()) << "ray " << i;
      }
    }
  }
}

/// The same answers bit by bit, whatever the structure: it only decides what is looked at.
TEST(KdTreeRays, hits_are_those_of_the_bvh) {
  for (const NamedMesh& named : hard_meshes()) {
    const MeshView mesh = named.mesh.view();
    const Bvh bvh = Bvh::build(mesh);
    const std::vector<Ray> rays = hard_rays(mesh, 700, 11);
    for (const KdTreeConfig& config : all_configs()) {
      SCOPED_TRACE(named.name + ", " + described(config));
      const KdTree tree = KdTree::build(mesh, config);
      size_t differences = 0;
      for (const Ray& ray : rays) differences += tree.intersect(ray) != bvh.intersect(ray);
      EXPECT_EQ(differences, 0u);
    }
  }
}

TEST(KdTreeRays, closed_meshes_do_not_leak) {
  const Mesh mesh = shapes::blob(3, 4);
  std::mt19937 random(5);
  for (const Traversal traversal : kTraversals) {
    KdTreeConfig config;
    config.traversal = traversal;
    const KdTree tree = KdTree::build(mesh.view(), config);
    for (int i = 0; i < 20000; ++i) {
      // Out from the middle, at a vertex or at a point of an edge.
      const Triangle& t = mesh.triangles[random() % mesh.triangles.size()];
      const Vec3 &a = mesh.positions[t[0]], &b = mesh.positions[t[1]];
      const float s = i % 2 ? 0.0f : float(random() % 1000) / 1000;
      Ray ray;
      ray.direction = {a.x + (b.x - a.x) * s, a.y + (b.y - a.y) * s, a.z + (b.z - a.z) * s};
      ASSERT_TRUE(tree.intersect(ray).hit()) << name(traversal) << ", ray " << i;
    }
  }
}

TEST(KdTreeRays, all_hits_are_those_of_the_bvh) {
  for (const NamedMesh& named : hard_meshes()) {
    SCOPED_TRACE(named.name);
    const MeshView mesh = named.mesh.view();
    const Bvh bvh = Bvh::build(mesh);
    for (const Traversal traversal : kTraversals) {
      KdTreeConfig config;
      config.traversal = traversal;
      const KdTree tree = KdTree::build(mesh, config);
      std::vector<Hit> hits(40), expected(40);
      for (const Ray& ray : hard_rays(mesh, 140, 4)) {
        const size_t count = tree.all_hits(ray, hits);
        ASSERT_EQ(count, bvh.all_hits(ray, expected));
        EXPECT_TRUE(std::equal(hits.begin(), hits.begin() + static_cast<ptrdiff_t>(count),
                               expected.begin()));
      }
    }
  }
}

TEST(KdTreeRays, masks_and_culling_are_those_of_the_bvh) {
  const Mesh mesh = shapes::blob(3, 2);
  std::vector<uint32_t> masks(mesh.triangles.size());
  for (uint32_t i = 0; i < masks.size(); ++i) masks[i] = 1u << i % 3;
  const Bvh bvh = Bvh::build(mesh.view(), {}, masks);
  const KdTree tree = KdTree::build(mesh.view(), {}, masks);
  for (const Ray& ray : adversarial_rays(mesh.view(), 500, 2))
    for (const RayOptions options : {RayOptions{1, false}, RayOptions{6, true}, RayOptions{0}}) {
      EXPECT_EQ(tree.intersect(ray, options), bvh.intersect(ray, options));
      EXPECT_EQ(tree.occluded(ray, options), bvh.occluded(ray, options));
    }
}

TEST(KdTreeRays, batches_equal_single_rays_for_any_number_of_threads) {
  const Mesh mesh = shapes::blob(3, 2);
  const KdTree tree = KdTree::build(mesh.view());
  const std::vector<Ray> rays = adversarial_rays(mesh.view(), 2000, 9);
  for (const uint32_t threads : {1u, 3u, 0u}) {
    std::vector<Hit> hits(rays.size());
    std::vector<uint8_t> shadows(rays.size());
    tree.intersect(rays, hits, {}, threads);
    tree.occluded(rays, shadows, {}, threads);
    for (size_t i = 0; i < rays.size(); ++i) {
      EXPECT_EQ(hits[i], tree.intersect(rays[i]));
      EXPECT_EQ(shadows[i] != 0, tree.occluded(rays[i]));
    }
  }
}

TEST(KdTreeRays, extreme_scales_give_the_hits_of_the_bvh) {
  for (const float scale : {1e-20f, 1e-12f, 1e12f, 1e15f}) {
    SCOPED_TRACE(scale);
    const Mesh mesh = transformed(shapes::blob(2, 3), scale);
    const Bvh bvh = Bvh::build(mesh.view());
    for (const Traversal traversal : kTraversals) {
      KdTreeConfig config;
      config.traversal = traversal;
      const KdTree tree = KdTree::build(mesh.view(), config);
      size_t differences = 0;
      for (const Ray& ray : adversarial_rays(mesh.view(), 700, 6))
        differences += tree.intersect(ray) != bvh.intersect(ray);
      EXPECT_EQ(differences, 0u);
    }
  }
}

TEST(KdTreeRays, real_meshes_equal_brute_force) {
  bool is_any = false;
  for (const char* file : {"bunny_69k.ply", "conference_331k.ply", "nasty_tetfaces_96k.ply"}) {
    const std::optional<Mesh> mesh = read_mesh(file);
    if (!mesh) continue;
    is_any = true;
    SCOPED_TRACE(file);
    const MeshView view = mesh->view();
    KdTreeConfig config;
    KdTree tree = KdTree::build(view, config);
    const Bvh bvh = Bvh::build(view);
    const std::vector<Ray> rays = adversarial_rays(view, 5000, 8);
    std::vector<Truth> truths;
    for (size_t i = 0; i < 14; ++i) truths.push_back(trace_all(view, rays[i]));
    for (const Traversal traversal : kTraversals) {
      tree.set_traversal(traversal);
      for (size_t i = 0; i < rays.size(); ++i) {
        const Hit hit = tree.intersect(rays[i]);
        EXPECT_EQ(hit, bvh.intersect(rays[i])) << name(traversal) << ", ray " << i;
        if (i < truths.size()) EXPECT_TRUE(is_right(view, rays[i], truths[i], hit)) << "ray " << i;
      }
    }
  }
  if (!is_any) GTEST_SKIP() << "no meshes in " << data_folder();
}

TEST(KdTreeRays, nothing_is_hit_without_triangles_or_by_rays_that_are_none) {
  const KdTree empty;
  EXPECT_FALSE(empty.intersect(Ray{{0, 0, 0}, 0, {0, 0, 1}}).hit());
  const Mesh mesh = shapes::sphere(1);
  const KdTree tree = KdTree::build(mesh.view());
  EXPECT_FALSE(tree.intersect(Ray{{0, 0, 0}, 0, {0, 0, 0}}).hit());
  EXPECT_FALSE(tree.intersect(Ray{{0, NAN, 0}, 0, {0, 0, 1}}).hit());
  EXPECT_FALSE(tree.intersect(Ray{{0, 0, 0}, 2, {0, 0, 1}, 1}).hit());
  EXPECT_TRUE(tree.intersect(Ray{{0, 0, 0}, 0, {0, 0, 1}}).hit());
}

TEST(KdTreeRays, moves_leave_a_tree_without_triangles) {
  const Mesh mesh = shapes::sphere(1);
  KdTree tree = KdTree::build(mesh.view());
  const KdTree moved = std::move(tree);
  EXPECT_TRUE(moved.occluded(Ray{{0, 0, 0}, 0, {0, 0, 1}}));
  EXPECT_FALSE(tree.occluded(Ray{{0, 0, 0}, 0, {0, 0, 1}}));  // NOLINT(bugprone-use-after-move)
}

TEST(KdTreeRays, refuses_what_does_not_fit) {
  const Mesh mesh = shapes::sphere(1);
  std::vector<uint32_t> masks(3);
  EXPECT_THROW(KdTree::build(mesh.view(), {}, masks), Error);
  const KdTree tree = KdTree::build(mesh.view());
  std::vector<Ray> rays(2);
  std::vector<Hit> hits(3);
  EXPECT_THROW(tree.intersect(rays, hits), Error);
  EXPECT_THROW(kdtree::traversal_by_name("teleport"), Error);
  EXPECT_EQ(kdtree::traversal_by_name("ropes"), Traversal::kRopes);
  kdtree::Tree other = kdtree::build(mesh.view());
  KdTreeConfig config;
  config.tree.cost.traversal = 0;  // no file of such a tree could be read
  EXPECT_THROW(KdTree::of(other, mesh.view(), config), Error);
  other.references[0] = 500;
  EXPECT_THROW(KdTree::of(other, mesh.view()), Error);
}

}  // namespace
}  // namespace umbel
