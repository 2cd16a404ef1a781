// The public interface of builds in units.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "asset/scratch.hpp"
#include "umbel/scale.hpp"

namespace umbel {
namespace {

using testing::Scratch;

constexpr uint64_t kUnit = 2000;

std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

UnitsConfig config_in(const std::filesystem::path& work) {
  UnitsConfig config;
  config.unit_triangles = kUnit;
  config.work = work;
  return config;
}

// A source that a user has written, with mistakes to choose from.
class Given : public TriangleSource {
 public:
  explicit Given(TriangleBlock block) : block_(std::move(block)) {}
  uint64_t triangles() const override { return 1; }
  TriangleBlock read(uint64_t, uint64_t) const override { return block_; }
  SourceStreams streams() const override { return streams_; }
  void say(SourceStreams streams) { streams_ = std::move(streams); }

 private:
  TriangleBlock block_;
  SourceStreams streams_;
};

TriangleBlock one_triangle() {
  TriangleBlock block;
  block.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  block.triangles = {{0, 1, 2}};
  return block;
}

TEST(BuildInUnits, AssetIsSoundAndTheWorkFolderGoes) {
  const Scratch scratch;
  const Mesh mesh = shapes::blob(5, 1);
  UnitsConfig config = config_in(scratch / "work");
  config.contents.metadata = R"({"name":"blob"})";
  const UnitsReport report = build_in_units(scratch / "a.umbel", *source_of(mesh.view()), config);
  EXPECT_TRUE(verify_asset(scratch / "a.umbel", 8).ok);
  EXPECT_EQ(report.lod.input_triangles, mesh.triangles.size());
  EXPECT_EQ(report.file_bytes, std::filesystem::file_size(scratch / "a.umbel"));
  EXPECT_FALSE(std::filesystem::exists(scratch / "work"));
  EXPECT_EQ(Asset(scratch / "a.umbel").info().metadata, config.contents.metadata);
}

TEST(BuildInUnits, MeshOfOneUnitIsAsInMemory) {
  const Scratch scratch;
  const Mesh mesh = shapes::blob(4, 1);
  UnitsConfig config = config_in(scratch / "work");
  config.unit_triangles = mesh.triangles.size();
  build_in_units(scratch / "a.umbel", *source_of(mesh.view()), config);
  write_asset(scratch / "b.umbel", lod::build(mesh.view()), "{}", {}, AssetConfig::exact());
  const Asset a(scratch / "a.umbel"), b(scratch / "b.umbel");
  EXPECT_EQ(a.tables().groups, b.tables().groups);
  EXPECT_EQ(a.tables().clusters, b.tables().clusters);
}

TEST(BuildInUnits, MeshWithoutTrianglesIsAnAssetAsInMemory) {
  const Scratch scratch;
  const Mesh mesh;
  build_in_units(scratch / "a.umbel", *source_of(mesh.view()), config_in(scratch / "work"));
  write_asset(scratch / "b.umbel", lod::build(mesh.view()), "{}", {}, AssetConfig::exact());
  EXPECT_TRUE(verify_asset(scratch / "a.umbel", 8).ok);
  EXPECT_EQ(bytes_of(scratch / "a.umbel"), bytes_of(scratch / "b.umbel"));
}

TEST(BuildInUnits, StoppedBuildGoesOn) {
  const Scratch scratch;
  const Mesh mesh = shapes::blob(5, 1);
  const auto source = source_of(mesh.view());
  UnitsConfig config = config_in(scratch / "work");
  build_in_units(scratch / "a.umbel", *source, config);
  BuildOptions options;
  options.progress = [](float, std::string_view stage) { return !stage.starts_with("tier 2"); };
  EXPECT_THROW(build_in_units(scratch / "b.umbel", *source, config, options), Error);
  EXPECT_THROW(build_in_units(scratch / "b.umbel", *source, config), Error);
  config.resume = true;
  build_in_units(scratch / "b.umbel", *source, config);
  EXPECT_EQ(bytes_of(scratch / "a.umbel"), bytes_of(scratch / "b.umbel"));
}

TEST(BuildInUnits, BlocksThatAreNotWhatWasAskedForAreRefused) {
  const Scratch scratch;
  const auto refused = [&](const TriangleBlock& block) {
    try {
      build_in_units(scratch / "a.umbel", Given(block), config_in(scratch / "work"));
    } catch (const Error& error) {
      EXPECT_FALSE(std::filesystem::exists(scratch / "work"));
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(refused(one_triangle()), "");
  TriangleBlock block = one_triangle();
  block.triangles[0][1] = 3;
  EXPECT_NE(refused(block).find("vertex index 3"), std::string::npos);
  block = one_triangle();
  block.positions[2].y = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(refused(block).find("not finite"), std::string::npos);
  block = one_triangle();
  block.triangles.clear();
  EXPECT_NE(refused(block).find("0 of triangles, not 1"), std::string::npos);
  block = one_triangle();
  block.uvs.resize(3);
  EXPECT_NE(refused(block).find("3 of uvs, not 0"), std::string::npos);
}

TEST(BuildInUnits, SettingsOutOfRangeAreRefused) {
  const Scratch scratch;
  const Mesh mesh = shapes::sphere(3);
  const auto source = source_of(mesh.view());
  const auto refused = [&](auto change) {
    UnitsConfig config = config_in(scratch / "work");
    change(config);
    EXPECT_THROW(build_in_units(scratch / "a.umbel", *source, config), Error);
    EXPECT_FALSE(std::filesystem::exists(scratch / "work"));
  };
  refused([](UnitsConfig& c) { c.unit_triangles = 999; });
  refused([](UnitsConfig& c) { c.work.clear(); });
  refused([](UnitsConfig& c) { c.memory_bytes = 1000; });
  refused([](UnitsConfig& c) { c.lod.measured_error = true; });
  refused([](UnitsConfig& c) { c.contents.instances = {{0, {}}}; });
  refused([](UnitsConfig& c) { c.lod.max_triangles = 257; });
  refused([](UnitsConfig& c) { c.lod.ratio = std::numeric_limits<float>::quiet_NaN(); });
}

TEST(BuildInUnits, SetsThatNoMeshCanHaveAreRefused) {
  const Scratch scratch;
  Given source(one_triangle());
  for (const std::vector<Extra>& extras : std::vector<std::vector<Extra>>{
           {{ExtraKind::kUvs, 2}, {ExtraKind::kUvs, 1}}, {{ExtraKind::kMaterial, 0}}}) {
    SourceStreams streams;
    streams.extras = extras;
    source.say(streams);
    EXPECT_THROW(build_in_units(scratch / "a.umbel", source, config_in(scratch / "work")), Error);
    EXPECT_FALSE(std::filesystem::exists(scratch / "work"));
  }
}

TEST(BuildInUnits, MixedMaterialsNeedRoomAmongFurtherAttributes) {
  const Scratch scratch;
  Given source(one_triangle());
  SourceStreams streams;
  streams.materials = true;
  for (uint32_t set = 0; set < kMostExtraValues / 4; ++set)
    streams.extras.push_back({ExtraKind::kJoints, set});
  source.say(streams);
  UnitsConfig config = config_in(scratch / "work");
  config.lod.mix_materials = true;
  try {
    build_in_units(scratch / "a.umbel", source, config);
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    EXPECT_NE(std::string(error.what()).find("at most 39"), std::string::npos) << error.what();
  }
  EXPECT_FALSE(std::filesystem::exists(scratch / "work"));
}

TEST(BuildInUnits, LimitsOfZeroAreNone) {
  const Scratch scratch;
  const Mesh mesh = shapes::blob(5, 1);
  for (const uint32_t limit : {0u, 256u}) {
    UnitsConfig config = config_in(scratch / "work");
    config.lod.max_triangles = config.lod.max_vertices = limit;
    build_in_units(scratch / std::to_string(limit), *source_of(mesh.view()), config);
  }
  EXPECT_EQ(bytes_of(scratch / "0"), bytes_of(scratch / "256"));
}

TEST(BuildInUnits, MaterialsThatMixedClustersCannotKeepAreRefused) {
  const Scratch scratch;
  Mesh mesh = shapes::sphere(3);
  mesh.materials.assign(mesh.triangles.size(), 1u << 24);
  mesh.materials[1] += 1;
  UnitsConfig config = config_in(scratch / "work");
  config.lod.mix_materials = true;
  EXPECT_THROW(build_in_units(scratch / "a.umbel", *source_of(mesh.view()), config), Error);
  mesh.materials[1] -= 1;
  build_in_units(scratch / "a.umbel", *source_of(mesh.view()), config);
}

TEST(BuildInUnits, OfLongInputsTheFirstDifferenceIsTold) {
  const Scratch scratch;
  const Mesh mesh = shapes::sphere(3);
  UnitsConfig config = config_in(scratch / "work");
  const auto said = [&](const std::string& input) -> std::string {
    config.input = input;
    try {
      build_in_units(scratch / "a.umbel", *source_of(mesh.view()), config);
    } catch (const Error& error) {
      config.resume = true;
      return error.what();
    }
    return "";
  };
  std::string names;
  for (size_t i = 0; i < 5000; ++i) names += "\u00e9/tile, ";
  // The folder stays only where it may be of use.
  config.worker = {"sh", "-c", "exit 12"};
  said(names + "one" + names);
  const std::string sentence = said(names + "two" + names);
  EXPECT_NE(sentence.find("tile, one\u00e9/"), std::string::npos) << sentence;
  EXPECT_NE(sentence.find("tile, two\u00e9/"), std::string::npos) << sentence;
  EXPECT_LT(sentence.size(), 1000u);
  EXPECT_NE(sentence.find("was ..."), std::string::npos);
}

TEST(BuildInUnits, WhatCannotBeMadeInTheWorkFolderIsNamed) {
  const Scratch scratch;
  const Mesh mesh = shapes::sphere(3);
  UnitsConfig config = config_in(scratch / "work");
  config.worker = {"true"};
  const auto said = [&]() -> std::string {
    try {
      build_in_units(scratch / "a.umbel", *source_of(mesh.view()), config);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kIo);
      return error.what();
    }
    return "";
  };
  // Units are not built, so the folder stays.
  said();
  config.resume = true;
  const std::filesystem::path below = scratch / "work" / "t0" / "unit";
  std::filesystem::create_directory(below / "u000000.said");
  EXPECT_EQ(said(), "cannot write " + (below / "u000000.said").string() + ": Is a directory");
  std::filesystem::remove_all(below);
  std::ofstream(below).close();
  EXPECT_TRUE(said().starts_with("cannot make the folder " + below.string() + ": ")) << said();
}

TEST(BuildInUnits, WorkersProgramSaysWhatIsWrong) {
  const std::array<const char*, 2> few{"program", "1"};
  EXPECT_EQ(run_unit_worker(2, few.data()), 10 + static_cast<int>(ErrorCode::kInvalidArgument));
}

}  // namespace
}  // namespace umbel
