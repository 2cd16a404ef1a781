#include "bvh/same_answers.hpp"
#include "kdtree/meshes.hpp"
#include "uniform/grid_data.hpp"

namespace umbel {
namespace {

using namespace testing;
using uniform::TwoLevelGrid;

TEST(TwoLevelGrid, every_cell_lists_the_triangles_that_touch_it) {
  for (const NamedMesh& named : hard_meshes()) {
    SCOPED_TRACE(named.name);
    const MeshView mesh = named.mesh.view();
    struct Peek : TwoLevelGrid {
      explicit Peek(TwoLevelGrid&& grid) : TwoLevelGrid(std::move(grid)) {}
      const GridData& peek() const { return static_cast<const GridData&>(*store_); }
    };
    const Peek grid(TwoLevelGrid::build(mesh));
    const GridData& data = grid.peek();
    ASSERT_EQ(data.bounds, bounds(mesh));
    size_t cells = 0;
    std::vector<GridNodes::Link> stack{GridNodes(data).root()};
    while (!stack.empty()) {
      const GridNodes::Link link = stack.back();
      stack.pop_back();
      if (!GridNodes::is_leaf(link)) {
        const auto children = GridNodes(data).children(link);
        stack.insert(stack.end(), {children.link(0), children.link(1)});
        continue;
      }
      ++cells;
      std::vector<uint32_t> listed;
      GridNodes(data).visit_runs(link, [&](uint32_t run) {
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
    EXPECT_EQ(cells, data.cells.size());
    EXPECT_EQ(grid.statistics().leaves, cells);
    EXPECT_EQ(grid.statistics().references, data.reference_count);
  }
}

}  // namespace
}  // namespace umbel
