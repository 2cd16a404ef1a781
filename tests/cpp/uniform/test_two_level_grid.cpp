#include "bvh/same_answers.hpp"
#include "kdtree/meshes.hpp"
#include "uniform/cell_lists.hpp"
#include "uniform/grid_data.hpp"

namespace umbel {
namespace {

using namespace testing;
using uniform::TwoLevelGrid;

TEST(TwoLevelGrid, every_cell_lists_the_triangles_that_touch_it) {
  for_hard_meshes([](const MeshView& mesh) {
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
      expect_lists_what_touches(GridNodes(data), link, data, mesh);
    }
    EXPECT_EQ(cells, data.cells.size());
    EXPECT_EQ(grid.statistics().leaves, cells);
    EXPECT_EQ(grid.statistics().references, data.reference_count);
  });
}

}  // namespace
}  // namespace umbel
