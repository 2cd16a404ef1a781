#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>

#include "data_folder.hpp"
#include "umbel/mesh.hpp"

namespace umbel {
namespace {

namespace fs = std::filesystem;

using testing::data_folder;

/// Reads the plainest binary PLY: float x y z, and lists of three 32-bit indices.
std::optional<Mesh> read_plain_ply(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return std::nullopt;
  size_t vertices = 0, faces = 0;
  for (std::string line; std::getline(file, line) && line != "end_header";) {
    if (line.starts_with("element vertex")) vertices = std::stoul(line.substr(15));
    if (line.starts_with("element face")) faces = std::stoul(line.substr(13));
  }
  Mesh mesh;
  mesh.positions.resize(vertices);
  mesh.triangles.resize(faces);
  file.read(reinterpret_cast<char*>(mesh.positions.data()), vertices * sizeof(Vec3));
  for (Triangle& t : mesh.triangles) {
    file.get();
    file.read(reinterpret_cast<char*>(t.data()), sizeof t);
  }
  if (!file) return std::nullopt;
  return mesh;
}

TEST(RealMeshes, dragon_welds_to_its_published_counts) {
  const auto mesh = read_plain_ply(data_folder() / "dragon_871k.ply");
  if (!mesh) GTEST_SKIP() << "no dragon_871k.ply";
  EXPECT_NO_THROW(validate(mesh->view()));
  const Mesh welded = weld(mesh->view());
  EXPECT_EQ(welded.positions.size(), 435545u);
  EXPECT_EQ(welded.triangles.size(), 871414u);
  EXPECT_EQ(triangle_set_digest(mesh->view()), triangle_set_digest(welded.view()));
}

TEST(RealMeshes, unwelded_scan_seams_close) {
  const auto mesh = read_plain_ply(data_folder() / "nasty_capsule_10k.ply");
  if (!mesh) GTEST_SKIP() << "no nasty_capsule_10k.ply";
  EXPECT_EQ(mesh->positions.size(), 5252u);
  EXPECT_EQ(weld(mesh->view()).positions.size(), 5002u);
}

TEST(RealMeshes, soup_welds_to_its_published_counts) {
  const auto mesh = read_plain_ply(data_folder() / "nasty_conrod_soup_6k.ply");
  if (!mesh) GTEST_SKIP() << "no nasty_conrod_soup_6k.ply";
  EXPECT_EQ(mesh->positions.size(), 19326u);
  EXPECT_EQ(weld(mesh->view()).positions.size(), 3223u);
}

TEST(RealMeshes, nan_is_rejected_and_dropped) {
  const auto mesh = read_plain_ply(data_folder() / "nasty_synth_nan_inf.ply");
  if (!mesh) GTEST_SKIP() << "no nasty_synth_nan_inf.ply";
  EXPECT_THROW(validate(mesh->view()), Error);
  const DropResult result = drop_invalid(mesh->view());
  EXPECT_GT(result.dropped, 10u);
  EXPECT_LT(result.dropped, 20u);
  EXPECT_NO_THROW(validate(result.mesh.view()));
}

}  // namespace
}  // namespace umbel
