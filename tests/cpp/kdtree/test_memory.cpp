#include <gtest/gtest.h>

#include "bvh/oracle.hpp"
#include "heap_peak.hpp"
#include "kdtree/meshes.hpp"
#include "umbel/kdtree.hpp"

namespace umbel {
namespace {

using namespace testing;

/// What docs/kdtree.md states, in bytes a triangle: the bound for what never comes apart, and the
/// greatest of these meshes with the default settings, on two threads: each thread more
/// has a subtree of its own in hand.
constexpr double kBytesAReference = 300, kNastyBytes = 700;

double bytes_a_triangle(const MeshView& mesh, const kdtree::Config& config, uint32_t threads) {
  const HeapPeak peak;
  const kdtree::Tree tree = kdtree::build(mesh, config, {{}, threads});
  EXPECT_FALSE(tree.nodes.empty());
  return double(peak.bytes()) / double(mesh.triangles.size());
}

void expect_bounded(const std::string& name, const MeshView& mesh,
                    std::initializer_list<float> max_references) {
  for (const kdtree::Builder builder : {kdtree::Builder::kExact, kdtree::Builder::kBinned}) {
    SCOPED_TRACE(name + ", " + std::string(kdtree::name(builder)));
    kdtree::Config config;
    config.builder = builder;
    EXPECT_LE(bytes_a_triangle(mesh, config, 2), kNastyBytes);
    for (const float references : max_references) {
      config.max_references = references;
      EXPECT_LE(bytes_a_triangle(mesh, config, 0), kBytesAReference * references) << references;
    }
  }
}

TEST(KdTreeMemory, what_never_comes_apart_stays_within_its_bytes) {
  if (!HeapPeak::counts()) GTEST_SKIP() << "operator new is not counted here";
  const NamedMesh meshes[] = {{"one centroid", concentric(5000)},
                              {"identical", identical(10000)},
                              {"needles", needles(5000)},
                              {"fan", shapes::fan(10000)}};
  for (const NamedMesh& named : meshes) expect_bounded(named.name, named.mesh.view(), {1, 4});
}

TEST(KdTreeMemory, nasty_files_stay_within_their_bytes) {
  if (!HeapPeak::counts()) GTEST_SKIP() << "operator new is not counted here";
  bool is_any = false;
  for (const char* name :
       {"nasty_synth_same_centroid_20k.ply", "nasty_synth_identical_10k.ply",
        "nasty_synth_fan_50k.ply", "nasty_synth_needles_20k.ply", "nasty_tetfaces_96k.ply"}) {
    const std::optional<Mesh> mesh = read_mesh(name);
    if (!mesh) continue;
    is_any = true;
    expect_bounded(name, mesh->view(), {});
  }
  if (!is_any) GTEST_SKIP() << "no meshes in " << data_folder();
}

TEST(KdTreeMemory, without_memory_for_ropes_the_traversal_stays) {
  if (!FailingAllocation::works()) GTEST_SKIP() << "operator new is another's";
  const Mesh mesh = shapes::blob(3, 1);
  kdtree::KdTree tree = kdtree::KdTree::build(mesh.view());
  const Ray ray{{0.1f, 0.2f, 3}, 0, {0, 0, -1}, 10};
  const Hit expected = tree.intersect(ray);
  ASSERT_NE(expected.primitive, kNone);
  uint32_t failures = 0;
  fail_each_allocation([&] { tree.set_traversal(kdtree::Traversal::kRopes); },
                       [&] {
                         ++failures;
                         EXPECT_EQ(tree.traversal(), kdtree::Traversal::kStack);
                         EXPECT_EQ(tree.intersect(ray).primitive, expected.primitive);
                       });
  EXPECT_GT(failures, 2u);
  EXPECT_EQ(tree.traversal(), kdtree::Traversal::kRopes);
  EXPECT_EQ(tree.intersect(ray).primitive, expected.primitive);
}

}  // namespace
}  // namespace umbel
