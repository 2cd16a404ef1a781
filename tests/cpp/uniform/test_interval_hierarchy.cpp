#include "bvh/same_answers.hpp"
#include "kdtree/meshes.hpp"
#include "uniform/interval_data.hpp"

namespace umbel {
namespace {

using namespace testing;
using uniform::IntervalHierarchy;

TEST(IntervalHierarchy, lists_each_triangle_once_in_a_binary_tree_of_bounded_depth) {
  for_hard_meshes([](const MeshView& mesh) {
    const uniform::Statistics s = IntervalHierarchy::build(mesh).statistics();
    EXPECT_EQ(s.references, mesh.triangles.size());
    EXPECT_EQ(s.nodes, 2 * s.leaves - 1);
    EXPECT_LE(s.max_depth, kMaxIntervalDepth);
    EXPECT_GT(s.sah_cost, 0);
  });
}

}  // namespace
}  // namespace umbel
