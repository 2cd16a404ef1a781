#include <gtest/gtest.h>

#include <random>
#include <span>
#include <string>

#include "asset/scratch.hpp"
#include "heap_peak.hpp"
#include "io/obj.hpp"
#include "io/source/obj_tables.hpp"

namespace umbel::io {
namespace {

ByteSource source_of(const std::string& text) { return ByteSource(std::as_bytes(std::span(text))); }

/// Corners with everything, told in many ways.
std::string random_text(uint32_t seed, int lines) {
  std::mt19937 random(seed);
  const auto below = [&](uint32_t n) { return static_cast<int>(random() % n); };
  std::string text = "v 1 2 3\nv 4 5 6 1 0 1\nv 7 8 10\nvt 0 1\nvn 0 0 1\n";
  int v = 3;
  for (int line = 0; line < lines; ++line) {
    if (below(2)) {
      (text += "v ") += std::to_string(below(99));
      ((text += ' ') += std::to_string(line)) += " 0.25\nvt ";
      (text += std::to_string(line)) += " 1\n";
      ++v;
      continue;
    }
    if (below(4) == 0) ((text += "usemtl m") += std::to_string(below(3))) += '\n';
    text += 'f';
    for (int k = 3 + below(2); k > 0; --k) {
      const int index = below(static_cast<uint32_t>(v));
      (text += ' ') += std::to_string(below(2) ? index + 1 : index - v);
      if (below(3)) (text += '/') += std::to_string(1 + below(static_cast<uint32_t>(v - 2)));
    }
    text += '\n';
  }
  return text;
}

TEST(ObjTables, HoldWhatTheReaderOfWholeFilesDoes) {
  for (uint32_t seed = 0; seed < 20; ++seed) {
    const umbel::testing::Scratch scratch;
    const std::string text = random_text(seed, 200);
    const ObjMesh mesh = read_obj(source_of(text), "a.obj");
    const ObjTables tables = write_obj_tables(source_of(text), "a.obj", scratch / "a", 64);
    EXPECT_EQ(tables.material_names, mesh.material_names);
    EXPECT_EQ(tables.notes, mesh.notes);
    const TableSource source(tables.layout);
    ASSERT_EQ(source.triangles(), mesh.triangles.size());
    for (uint64_t size : {1u, 7u, 1000u})
      for_each_block(source, 0, source.triangles(), size, [&](const TriangleBlock& block) {
        for (size_t i = 0; i < block.triangles.size(); ++i)
          for (size_t k = 0; k < 3; ++k) {
            const uint32_t a = block.triangles[i][k], b = mesh.triangles[block.first + i][k];
            const auto& p = mesh.positions[b];
            EXPECT_EQ(block.positions[a], (Vec3d{p[0], p[1], p[2]}));
            EXPECT_EQ(block.uvs[a], mesh.uvs[b]);
            EXPECT_EQ(block.colors[a], mesh.colors[b]);
            if (!mesh.materials.empty())
              EXPECT_EQ(block.materials[i], mesh.materials[block.first + i]);
          }
      });
  }
}

TEST(ObjTables, CornersWithoutNormalsAreCounted) {
  const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\n";
  const auto notes = [&](const std::string& faces) {
    const umbel::testing::Scratch scratch;
    const std::string text = vertices + faces;
    return write_obj_tables(source_of(text), "a.obj", scratch / "a", 64).notes;
  };
  EXPECT_TRUE(notes("f 1//1 2//1 3//1\n").empty());
  EXPECT_TRUE(notes("f 1 2 3\n").empty());
  std::string faces = "f 1 2 3\n";
  for (int i = 0; i < 99; ++i) faces += "f 1//1 2//1 3\n";
  const std::vector<std::string> said = notes(faces + "f 3 2 1\n");
  ASSERT_EQ(said.size(), 1u);
  EXPECT_TRUE(said[0].starts_with("a.obj: 105 corners of triangles have no normals")) << said[0];
}

TEST(ObjTables, MemoryDoesNotGrowWithTheFile) {
  if (!umbel::testing::HeapPeak::counts()) GTEST_SKIP();
  const auto peak = [](int lines) {
    const umbel::testing::Scratch scratch;
    const std::string text = random_text(1, lines);
    const umbel::testing::HeapPeak heap;
    write_obj_tables(source_of(text), "a.obj", scratch / "a", 1u << 16);
    return heap.bytes();
  };
  EXPECT_LT(peak(600'000), peak(200'000) * 5 / 4);
}

}  // namespace
}  // namespace umbel::io
