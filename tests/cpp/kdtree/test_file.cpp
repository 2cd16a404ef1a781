#include <gtest/gtest.h>

#include "base/structure_file_tests.hpp"
#include "bvh/oracle.hpp"
#include "kdtree/meshes.hpp"
#include "umbel/kdtree.hpp"

namespace umbel {
namespace {

using namespace testing;
using kdtree::KdTree, kdtree::KdTreeConfig, kdtree::Traversal;

struct KdTreeFiles {
  using Structure = KdTree;

  static std::vector<KdTreeConfig> kinds() {
    std::vector<KdTreeConfig> all(2);
    all[1].compact = true;
    return all;
  }

  /// Asks everything, as a query that leaves an array would be noticed by the sanitizers at least.
  static void ask(KdTree& tree) {
    for (const Traversal traversal : kTraversals) {
      tree.set_traversal(traversal);
      for (const Vec3& p : {Vec3{0, 0, 0}, Vec3{0.3f, -0.2f, 0.9f}, Vec3{5, 5, 5}})
        for (const Vec3& d : {Vec3{1, 0, 0}, Vec3{-0.3f, 0.4f, -0.8f}}) {
          tree.intersect({p, 0, d});
          tree.occluded({p, 0, d});
          std::array<Hit, 4> hits;
          tree.all_hits({p, 0, d}, hits);
        }
    }
  }
};
INSTANTIATE_TYPED_TEST_SUITE_P(KdTree, StructureFile, KdTreeFiles);

TEST(KdTreeFile, a_loaded_tree_answers_as_the_saved_one) {
  const Scratch scratch;
  for (const NamedMesh& named : hard_meshes()) {
    SCOPED_TRACE(named.name);
    const MeshView mesh = named.mesh.view();
    std::vector<uint32_t> masks(mesh.triangles.size());
    for (uint32_t i = 0; i < masks.size(); ++i) masks[i] = 1 + i % 3;
    const std::vector<Ray> rays = adversarial_rays(mesh, 140, 1);
    for (const KdTreeConfig& config : KdTreeFiles::kinds())
      for (const bool masked : {false, true}) {
        const KdTree saved = KdTree::build(mesh, config, masked ? masks : std::vector<uint32_t>{});
        saved.save((scratch / "a").string());
        KdTree loaded = KdTree::load((scratch / "a").string());
        EXPECT_EQ(loaded.bounds(), saved.bounds());
        EXPECT_EQ(loaded.triangle_count(), saved.triangle_count());
        EXPECT_EQ(loaded.statistics().bytes, saved.statistics().bytes);
        EXPECT_EQ(loaded.statistics().sah_cost, saved.statistics().sah_cost);
        EXPECT_EQ(loaded.statistics().references, saved.statistics().references);
        for (const Traversal traversal : kTraversals) {
          loaded.set_traversal(traversal);
          for (const Ray& ray : rays) {
            ASSERT_EQ(loaded.intersect(ray), saved.intersect(ray));
            ASSERT_EQ(loaded.intersect(ray, {2}), saved.intersect(ray, {2}));
          }
        }
        loaded.save((scratch / "b").string());
        ASSERT_TRUE(read_bytes(scratch / "a") == read_bytes(scratch / "b"));
      }
  }
}

TEST(KdTreeFile, a_tree_without_triangles_can_be_saved_and_loaded) {
  const Scratch scratch;
  KdTree().save((scratch / "a").string());
  const KdTree loaded = KdTree::load((scratch / "a").string(), Traversal::kRopes);
  EXPECT_EQ(loaded.traversal(), Traversal::kRopes);
  EXPECT_EQ(loaded.triangle_count(), 0u);
  EXPECT_FALSE(loaded.intersect(Ray{{0, 0, 0}, 0, {0, 0, 1}}).hit());
}

TEST(KdTreeFile, files_of_other_structures_are_refused) {
  const Scratch scratch;
  Bvh::build(shapes::sphere(1).view()).save((scratch / "a.umbvh").string());
  EXPECT_EQ(failure_of<KdTreeFiles>(scratch / "a.umbvh"), ErrorCode::kCorrupt);
}

TEST(KdTreeFile, what_cannot_be_written_leaves_what_was_there) {
  const KdTree tree = KdTree::build(shapes::sphere(1).view());
  expect_saving_is_whole_or_nothing([&](const std::string& path) { tree.save(path); });
}

}  // namespace
}  // namespace umbel
