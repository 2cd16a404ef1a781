#include <gtest/gtest.h>

#include <string>

#include "base/parallel.hpp"
#include "io/source/mesh_source.hpp"
#include "io/source/triangle_source.hpp"

namespace umbel::io {
namespace {

TEST(TriangleSource, BlocksComeInOrderForAnyNumberOfThreads) {
  const Mesh mesh = shapes::blob(4, 1);
  const MeshSource source(mesh.view(), {100, 0, 0}, "mesh");
  for (uint32_t threads : {1u, 2u, 4u})
    with_threads(threads, [&] {
      uint64_t next = 10;
      for_each_block(source, 10, 4000, 77, [&](const TriangleBlock& block) {
        EXPECT_EQ(block.first, next);
        for (size_t i = 0; i < block.triangles.size(); ++i)
          for (size_t k = 0; k < 3; ++k) {
            const Vec3& p = mesh.positions[mesh.triangles[next + i][k]];
            EXPECT_EQ(block.positions[block.triangles[i][k]], (Vec3d{100.0 + p.x, p.y, p.z}));
          }
        next += block.triangles.size();
      });
      EXPECT_EQ(next, 4000u);
    });
}

TEST(TriangleSource, TheFirstFaultIsTheOneThatIsNamed) {
  Mesh mesh = shapes::blob(4, 1);
  mesh.triangles[1234][2] = 99'999;
  mesh.triangles[1300][0] = 77'777;
  mesh.triangles[3000][0] = 88'888;
  const MeshSource source(mesh.view(), {0, 0, 0}, "a.ply");
  for (uint32_t threads : {1u, 4u})
    for (int again = 0; again < 10; ++again)
      with_threads(threads, [&] {
        std::string message;
        try {
          for_each_block(source, 0, source.triangles(), 100, [](const TriangleBlock&) {});
        } catch (const Error& error) {
          EXPECT_EQ(error.code(), ErrorCode::kInvalidMesh);
          message = error.what();
        }
        EXPECT_NE(message.find("a.ply: triangle 1234 has vertex index 99999"), std::string::npos)
            << message;
      });
}

}  // namespace
}  // namespace umbel::io
