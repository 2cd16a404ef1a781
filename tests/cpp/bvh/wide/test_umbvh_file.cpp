#include <gtest/gtest.h>

#include "base/structure_file_tests.hpp"
#include "bvh/oracle.hpp"

namespace umbel {
namespace {

using namespace testing;

struct BvhFiles {
  using Structure = Bvh;

  static std::vector<BvhConfig> kinds() {
    std::vector<BvhConfig> all;
    for (const uint32_t width : {2u, 4u, 8u})
      for (const bool compact : {false, true}) {
        BvhConfig config;
        config.width = width, config.compact = compact;
        all.push_back(config);
      }
    return all;
  }

  /// Asks everything, as a query that leaves an array would be noticed by the sanitizers at least.
  static void ask(const Bvh& tree) {
    for (const Vec3& p : {Vec3{0, 0, 0}, Vec3{0.3f, -0.2f, 0.9f}, Vec3{5, 5, 5}}) {
      for (const Vec3& d : {Vec3{1, 0, 0}, Vec3{-0.3f, 0.4f, -0.8f}}) {
        tree.intersect({p, 0, d});
        tree.occluded({p, 0, d});
        std::array<Hit, 4> hits;
        tree.all_hits({p, 0, d}, hits);
      }
      tree.closest_point(p);
      tree.contains(p);
      tree.overlaps(Sphere{p, 0.5f});
      tree.overlaps(Aabb{{p.x - 1, p.y - 1, p.z - 1}, p});
    }
  }
};
INSTANTIATE_TYPED_TEST_SUITE_P(Bvh, StructureFile, BvhFiles);

TEST(BvhFile, a_loaded_tree_answers_as_the_saved_one) {
  const Scratch scratch;
  const Mesh mesh = shapes::blob(3, 1);
  std::vector<uint32_t> masks(mesh.triangles.size());
  for (uint32_t i = 0; i < masks.size(); ++i) masks[i] = 1 + i % 3;
  const std::vector<Ray> rays = adversarial_rays(mesh.view(), 280, 1);
  for (const BvhConfig& config : BvhFiles::kinds())
    for (const bool masked : {false, true}) {
      const std::string path = (scratch / "a.umbvh").string();
      const Bvh saved = Bvh::build(mesh.view(), config, masked ? masks : std::vector<uint32_t>{});
      saved.save(path);
      const Bvh loaded = Bvh::load(path);
      EXPECT_EQ(loaded.bounds(), saved.bounds());
      EXPECT_EQ(loaded.triangle_count(), saved.triangle_count());
      EXPECT_EQ(loaded.statistics().bytes, saved.statistics().bytes);
      EXPECT_EQ(loaded.statistics().sah_cost, saved.statistics().sah_cost);
      EXPECT_EQ(loaded.statistics().max_depth, saved.statistics().max_depth);
      for (const Ray& ray : rays) {
        ASSERT_EQ(loaded.intersect(ray), saved.intersect(ray));
        ASSERT_EQ(loaded.intersect(ray, {2}), saved.intersect(ray, {2}));
        ASSERT_EQ(loaded.closest_point(ray.origin).primitive,
                  saved.closest_point(ray.origin).primitive);
      }
      loaded.save((scratch / "b.umbvh").string());
      ASSERT_TRUE(read_bytes(scratch / "a.umbvh") == read_bytes(scratch / "b.umbvh"));
    }
  EXPECT_EQ(scratch.files(), 2u);
}

TEST(BvhFile, trees_of_every_builder_can_be_saved_and_loaded) {
  const Scratch scratch;
  for (const Mesh& mesh : {shapes::blob(2, 2), shapes::soup(100, 1), Mesh{}})
    for (const bvh::Builder builder : bvh::builders()) {
      BvhConfig config;
      config.tree = bvh::Config{};
      config.tree.builder = builder;
      Bvh::build(mesh.view(), config).save((scratch / "a").string());
      EXPECT_EQ(failure_of<BvhFiles>(scratch / "a"), std::nullopt) << bvh::name(builder);
    }
}

TEST(BvhFile, a_loaded_tree_can_be_refitted) {
  const Scratch scratch;
  const Mesh mesh = shapes::blob(3, 1), moved = transformed(mesh, 3, {1, 2, 3});
  Bvh::build(mesh.view()).save((scratch / "a").string());
  Bvh tree = Bvh::load((scratch / "a").string());
  const RefitReport report = tree.refit(moved.view());
  EXPECT_NEAR(report.sah_cost, report.built_sah_cost, 1e-4 * report.built_sah_cost);
  EXPECT_EQ(tree.bounds(), bounds(moved.view()));
}

TEST(BvhFile, what_cannot_be_written_leaves_what_was_there) {
  const Bvh tree = Bvh::build(shapes::sphere(1).view());
  expect_saving_is_whole_or_nothing([&](const std::string& path) { tree.save(path); });
}

}  // namespace
}  // namespace umbel
