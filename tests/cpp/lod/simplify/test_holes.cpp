// What holes and handles would keep from being simplified is simplified all the same.
#include <gtest/gtest.h>

#include "base/math.hpp"
#include "lod/synthetic_dag.hpp"
#include "umbel/triangle_bvh.hpp"

namespace umbel::lod {
namespace {

// A closed plate with holes through it, holes * holes of them, of the width 1 and a hole's
// thickness.
Mesh plate(uint32_t holes) {
  const uint32_t cells = 2 * holes + 1, row = cells + 1;
  const float step = 1.0f / static_cast<float>(cells);
  Mesh mesh;
  for (uint32_t z = 0; z < 2; ++z)
    for (uint32_t y = 0; y < row; ++y)
      for (uint32_t x = 0; x < row; ++x)
        mesh.positions.push_back({static_cast<float>(x) * step, static_cast<float>(y) * step,
                                  static_cast<float>(z) * step});
  const auto at = [&](uint32_t x, uint32_t y, uint32_t z) { return (z * row + y) * row + x; };
  const auto quad = [&](uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  };
  const auto solid = [&](int64_t x, int64_t y) {
    return x >= 0 && y >= 0 && x < cells && y < cells && !(x % 2 == 1 && y % 2 == 1);
  };
  for (uint32_t y = 0; y < cells; ++y)
    for (uint32_t x = 0; x < cells; ++x) {
      if (!solid(x, y)) continue;
      quad(at(x, y, 0), at(x, y + 1, 0), at(x + 1, y + 1, 0), at(x + 1, y, 0));
      quad(at(x, y, 1), at(x + 1, y, 1), at(x + 1, y + 1, 1), at(x, y + 1, 1));
      if (!solid(int64_t{x} - 1, y))
        quad(at(x, y, 0), at(x, y, 1), at(x, y + 1, 1), at(x, y + 1, 0));
      if (!solid(int64_t{x} + 1, y))
        quad(at(x + 1, y, 0), at(x + 1, y + 1, 0), at(x + 1, y + 1, 1), at(x + 1, y, 1));
      if (!solid(x, int64_t{y} - 1))
        quad(at(x, y, 0), at(x + 1, y, 0), at(x + 1, y, 1), at(x, y, 1));
      if (!solid(x, int64_t{y} + 1))
        quad(at(x, y + 1, 0), at(x, y + 1, 1), at(x + 1, y + 1, 1), at(x + 1, y + 1, 0));
    }
  return mesh;
}

// Of the vertices, from what is left.
constexpr double kMeanDistance = 0.02;

TEST(Holes, plate_stays_where_it_was) {
  const Mesh mesh = plate(24);
  const Dag dag = build(mesh.view());
  const VerifyReport report =
      verify(dag.tables, testing::reader_of(dag), testing::verify_config_of(dag, mesh, 24));
  EXPECT_TRUE(report.ok) << (report.problems.empty() ? "" : report.problems[0]);
  EXPECT_EQ(dag.report.stuck_groups, 0u);
  for (const uint64_t budget : {1000, 300}) {
    const float error = error_for_triangles(dag.tables, budget);
    const Mesh cut =
        mesh_of_cut(dag.tables, testing::reader_of(dag), select(dag.tables, view_error(error)));
    const Bvh bvh = Bvh::build(cut.view());
    double sum = 0;
    for (const Vec3& p : mesh.positions) sum += bvh.closest_point(p).distance;
    EXPECT_LT(sum, kMeanDistance * static_cast<double>(mesh.positions.size())) << budget;
  }
}

}  // namespace
}  // namespace umbel::lod
