#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <ctime>
#include <random>

#include "asset/scratch.hpp"
#include "io/source/coherent.hpp"

namespace umbel::io {
namespace {

/// A mesh as tables, with a material a triangle.
TableLayout tables_of(const Mesh& mesh, const std::filesystem::path& path) {
  std::vector<char> bytes(mesh.positions.size() * 12 + mesh.triangles.size() * 16);
  std::memcpy(bytes.data(), mesh.positions.data(), mesh.positions.size() * 12);
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    char* row = bytes.data() + mesh.positions.size() * 12 + i * 16;
    std::memcpy(row, mesh.triangles[i].data(), 12);
    const auto material = static_cast<uint32_t>(i);
    std::memcpy(row + 12, &material, 4);
  }
  umbel::testing::write_bytes(path, bytes);
  TableLayout layout;
  layout.files = {path};
  layout.tables = {{0, 0, 12, mesh.positions.size(), false},
                   {0, mesh.positions.size() * 12, 16, mesh.triangles.size(), false}};
  TablePart part;
  part.name = "mesh";
  part.positions = {0, Scalar::kF32, {0, 4, 8}};
  part.indices = {1, Scalar::kU32, {0, 4, 8}};
  part.materials = {1, Scalar::kU32, {12}};
  part.triangles = mesh.triangles.size();
  layout.parts = {part};
  layout.has_materials = true;
  return layout;
}

Mesh shuffled(Mesh mesh) {
  std::mt19937 random(3);
  std::shuffle(mesh.triangles.begin(), mesh.triangles.end(), random);
  return mesh;
}

TEST(Coherent, TrianglesStayInOrderForAnyBlockAndRange) {
  const Mesh mesh = shuffled(shapes::terrain(60, 50, 1));
  for (uint64_t block : {7u, 100u, 100'000u})
    for (uint64_t bytes : {1200u, 5000u, 1u << 20}) {
      const umbel::testing::Scratch scratch;
      TableLayout layout = tables_of(mesh, scratch / "mesh");
      CoherenceConfig config;
      config.block = block;
      config.range_bytes = bytes;
      make_coherent(layout, 0, scratch / "sorted", config);
      const TableSource source(layout);
      ASSERT_EQ(source.triangles(), mesh.triangles.size());
      const TriangleBlock all = source.read(0, source.triangles());
      for (size_t i = 0; i < all.triangles.size(); ++i) {
        EXPECT_EQ(all.materials[i], i);
        for (size_t k = 0; k < 3; ++k) {
          const Vec3& p = mesh.positions[mesh.triangles[i][k]];
          EXPECT_EQ(all.positions[all.triangles[i][k]], (Vec3d{p.x, p.y, p.z}));
        }
      }
      EXPECT_EQ(scratch.files(), 3u);  // the mesh, new indices, new rows
    }
}

TEST(Coherent, OnlyMeshesThatJumpAboutAreIncoherent) {
  const umbel::testing::Scratch scratch;
  const Mesh mesh = shapes::terrain(700, 700, 1);
  CoherenceConfig config;
  config.block = 1000;
  config.least_bytes = 0;
  const TableLayout good = tables_of(mesh, scratch / "good");
  EXPECT_FALSE(is_incoherent(good, good.parts[0], config));
  const TableLayout bad = tables_of(shuffled(mesh), scratch / "bad");
  EXPECT_TRUE(is_incoherent(bad, bad.parts[0], config));
  config.least_bytes = uint64_t{1} << 30;
  EXPECT_FALSE(is_incoherent(bad, bad.parts[0], config));
}

TEST(Coherent, AnIndexBeyondTheVerticesIsRefusedAndLeavesNothing) {
  const umbel::testing::Scratch scratch;
  Mesh mesh = shapes::grid(10, 10);
  mesh.triangles[50][1] = 5000;
  TableLayout layout = tables_of(mesh, scratch / "mesh");
  EXPECT_THROW(make_coherent(layout, 0, scratch / "sorted"), Error);
  EXPECT_EQ(scratch.files(), 1u);
}

// Scenes may have a hundred thousand meshes of a few triangles.
TEST(TableSource, TimeGrowsWithTheNumberOfPartsOnly) {
  const umbel::testing::Scratch scratch;
  TableLayout layout = tables_of(shapes::sphere(3), scratch / "mesh");
  layout.parts[0].triangles = 1;
  layout.tables[1].rows = 1;
  const auto seconds = [&](size_t parts) {
    TableLayout many = layout;
    many.parts.resize(parts, layout.parts[0]);
    const TableSource source(many);
    const std::clock_t begin = std::clock();
    EXPECT_EQ(source.read(0, parts).triangles.size(), parts);
    return static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  };
  const double few = std::max({seconds(2000), seconds(2000), 1e-3});
  EXPECT_LT(seconds(32'000), 40 * few);  // 256 times where all is copied for each part
}

}  // namespace
}  // namespace umbel::io
