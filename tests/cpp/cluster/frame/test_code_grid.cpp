#include <gtest/gtest.h>

#include "cluster/frame/block_boxes.hpp"
#include "cluster/frame/code_grid.hpp"
#include "cluster/frame/frame_cases.hpp"

namespace umbel {
namespace {

using namespace testing;

/// The order by arithmetic that shares nothing with the library's.
TEST(CodeGrid, morton_runs_are_in_the_order_of_interleaved_bits) {
  Mesh mesh;
  for (uint32_t z = 0; z < 8; ++z)
    for (uint32_t y = 0; y < 8; ++y)
      for (uint32_t x = 0; x < 8; ++x) {
        const Vec3 p{float(x), 1.5f * float(y), 1.25f * float(z)};
        for (int k = 0; k < 3; ++k) mesh.positions.push_back(p);
        const auto v = uint32_t(mesh.positions.size());
        mesh.triangles.push_back({v - 3, v - 2, v - 1});
      }
  FrameClusterConfig config;
  config.method = FrameMethod::kMorton;
  config.max_triangles = 8;
  const FrameClusterer c = clusters_of(mesh, config);
  // The longest axis, y, halves first, then z, then x.
  for (uint32_t i = 0; i < 512; ++i) {
    uint32_t at[3] = {0, 0, 0};
    for (int bit = 8; bit >= 0; --bit) {
      const int axis = bit % 3 == 2 ? 1 : bit % 3 == 1 ? 2 : 0;
      at[axis] = at[axis] * 2 + (i >> bit & 1);
    }
    ASSERT_EQ(c.items()[i], at[0] + 8 * at[1] + 64 * at[2]);
  }
}

#if UMBEL_BOX_VECTORS
TEST(CodeGrid, vectors_round_as_scalars_do) {
  for (const float scale : {1e-41f, 1e-20f, 1.0f, 1e20f, 8e37f}) {
    Mesh mesh = soup(3000, 21);
    for (Vec3& p : mesh.positions) p = (p - Vec3{1, 0.3f, 0.1f}) * scale;
    const cluster::FrameMesh view{{reinterpret_cast<const char*>(mesh.positions.data()), 12},
                                  mesh.triangles.data(),
                                  nullptr,
                                  3000};
    Aabb centers, frame;
    for (uint32_t i = 0; i < 3000; ++i) {
      const Vec3 c = center(view.box(i));
      extend(centers, c);
      extend(frame, view.box(i));
    }
    const auto small = cluster::CodeGrid::around(centers, 30);
    const auto large = cluster::CodeGrid::around(centers, 63);
    const auto block = cluster::BlockGrid::over(frame);
    for (uint32_t i = 0; i < 3000; ++i) {
      ASSERT_EQ(small.code<uint32_t>(view.record(i)), small.code<uint32_t>(view.box(i)));
      ASSERT_EQ(large.code<uint64_t>(view.record(i)), large.code<uint64_t>(view.box(i)));
      const cluster::BlockBox a = block.round(view, i), b = block.round(view.box(i));
      ASSERT_TRUE(std::equal(a.low, a.low + 8, b.low));
    }
  }
}
#endif

TEST(CodeGrid, large_triangles_are_apart) {
  Mesh mesh = soup(3000, 3);
  for (int i = 0; i < 64; ++i) {
    const auto v = uint32_t(mesh.positions.size());
    const float y = float(i) / 64;
    mesh.positions.insert(mesh.positions.end(), {{0, y, 0}, {4, y, 0}, {0, y, 0.2f}});
    mesh.triangles.push_back({v, v + 1, v + 2});
  }
  FrameClusterConfig config;
  config.method = FrameMethod::kMorton;
  config.max_triangles = 16;
  const FrameClusterer c = clusters_of(mesh, config);
  for (size_t i = 0; i < c.items().size(); ++i) ASSERT_EQ(c.items()[i] >= 3000, i >= 3000);
}

// On a device nobody looks at the values.
TEST(CodeGrid, has_codes_for_any_box) {
  const float values[] = {NAN, -INFINITY, INFINITY, -3e38f, 0, 5, 3e38f};
  for (const float low : values)
    for (const float high : values)
      for (int axis = 0; axis < 3; ++axis) {
        Aabb box{{0, 0, 0}, {5, 3, 1}};
        (&box.min.x)[axis] = low;
        (&box.max.x)[axis] = high;
        const auto grid = cluster::CodeGrid::around(box, 30);
        EXPECT_LE(3 * grid.of_all + 2 * grid.of_two, 29u) << low << ' ' << high << ' ' << axis;
        EXPECT_LT(grid.code<uint32_t>(box), 1u << 30) << low << ' ' << high << ' ' << axis;
      }
}

}  // namespace
}  // namespace umbel
