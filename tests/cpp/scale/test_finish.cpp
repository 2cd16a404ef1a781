// An asset that is written part by part has the bytes of one that is written from memory.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <ranges>
#include <string>
#include <vector>

#include "asset/in_small_space.hpp"
#include "scale/finish.hpp"
#include "scale/join_parts.hpp"
#include "scale/parts.hpp"
#include "scale/run_task.hpp"
#include "scale/tiers.hpp"
#include "scale/units.hpp"
#include "umbel/lod.hpp"

namespace umbel::scale::testing {
namespace {

namespace fs = std::filesystem;
using umbel::testing::read_bytes;
using umbel::testing::Scratch;
using umbel::testing::write_bytes;

// A mesh that has been built in units.
struct Built {
  Scratch work;
  FinishInput input;
  lod::Dag dag;

  Built(const Mesh& mesh, uint64_t capacity, const lod::Config& config = {}) {
    const io::MeshSource source(mesh.view(), {0, 0, 0}, "mesh");
    fs::create_directory(folder());
    dag = build_in_tiers(source, config, {capacity, 2}, folder(), [&](std::span<const Task> tasks) {
      for (const Task& task : tasks) run_task(folder(), task);
    });
    for (const auto& entry : fs::recursive_directory_iterator(folder()))
      if (entry.path().extension() == ".parts") input.parts.push_back(entry.path());
    std::ranges::sort(input.parts);
    for (const fs::path& parts : input.parts)
      input.units.push_back({number(parts.parent_path().parent_path()), number(parts.stem())});
    input.config = dag.config;
    input.report = dag.report;
    input.report.groups_by_method = {};
    input.report.groups_by_limiting_factor = {};
    input.source_digest = dag.source_digest;
  }

  // Of t1, u000003.
  static uint32_t number(const fs::path& name) {
    return static_cast<uint32_t>(std::stoul(name.filename().string().substr(1)));
  }

  fs::path folder() const { return work / "work"; }
  fs::path file(const char* name) const { return work / name; }

  void write_from_memory(const FinishOptions& options = {}) const {
    AssetContents contents = options.contents;
    contents.meshes = {&dag};
    write_asset(file("memory.umbel"), contents, {}, options.asset);
  }
  Finished write_from_parts(FinishOptions options = {}, const BuildOptions& build = {}) const {
    options.work = folder();
    return finish(file("parts.umbel"), input, options, build);
  }
  void expect_same(const FinishOptions& options = {}) const {
    write_from_memory(options);
    for (const uint32_t threads : {1u, 2u}) {
      BuildOptions build;
      build.threads = threads;
      const Finished finished = write_from_parts(options, build);
      EXPECT_EQ(finished.bytes, fs::file_size(file("parts.umbel")));
      EXPECT_EQ(read_bytes(file("parts.umbel")), read_bytes(file("memory.umbel")));
    }
  }
};

// With whatever a vertex may have; some values differ in the sign of zero alone.
Mesh skinned(Mesh mesh) {
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    mesh.normals.push_back({v % 2 == 0 ? 0.0f : -0.0f, 0, 1});
    mesh.tangents.push_back({1, 0, 0, v % 7 == 0 ? -1.0f : 1.0f});
    mesh.uvs.push_back({static_cast<float>(v % 3) * 5000, -0.0f});
    const float weight = static_cast<float>(v % 4) / 4;
    mesh.extra_values.insert(mesh.extra_values.end(),
                             {static_cast<float>(v % 9), 1, 0, 0, weight, 1 - weight, 0, 0});
  }
  mesh.extras = {{ExtraKind::kJoints, 0}, {ExtraKind::kWeights, 0}};
  return mesh;
}

std::vector<std::pair<std::string, Mesh>> meshes() {
  return {{"terrain", shapes::terrain(60, 60, 1)},
          {"moebius", shapes::moebius(400, 8)},
          {"fan", shapes::fan(5000)},
          {"soup", shapes::soup(4000, 3)},
          {"rich", rich(shapes::blob(4, 2))},
          {"skinned", skinned(shapes::terrain(50, 50, 5))}};
}

TEST(Finish, WritesTheBytesOfTheWriterInMemory) {
  for (const auto& [name, mesh] : meshes()) {
    SCOPED_TRACE(name);
    const Built built(mesh, 1000);
    for (const uint32_t page_bytes : {0u, 4096u, 262144u})
      for (AssetConfig config : {AssetConfig{}, AssetConfig::exact()}) {
        config.page_bytes = page_bytes;
        FinishOptions options;
        options.asset = config;
        built.expect_same(options);
      }
    EXPECT_TRUE(verify_asset(built.file("parts.umbel"), 8).ok);
  }
}

// As tasks, in an order of their own, some of them twice.
struct EncodesElsewhere {
  const Built& built;
  size_t tasks = 0;
  FinishOptions options(FinishOptions options = {}) {
    options.run = [this](std::span<const Task> given, const auto& poll) {
      for (const Task& task : given | std::views::reverse)
        for (int i = 0; i < 2; ++i, ++tasks) run_task(built.folder(), task);
      poll(given.size());
    };
    return options;
  }
};

TEST(Finish, IsTheSameWhereOthersEncode) {
  for (const auto& [name, mesh] : meshes())
    for (const bool mixed : {false, true}) {
      SCOPED_TRACE(name);
      lod::Config config;
      config.mix_materials = mixed;
      const Built built(mesh, 1000, config);
      FinishOptions options;
      options.contents.first_materials = {3};
      EncodesElsewhere elsewhere{built};
      built.write_from_memory(options);
      built.write_from_parts(elsewhere.options(options));
      EXPECT_EQ(read_bytes(built.file("parts.umbel")), read_bytes(built.file("memory.umbel")));
      EXPECT_EQ(elsewhere.tasks, 2 * built.input.parts.size());
    }
}

TEST(Finish, TakesChunksThatAreThereAndOfTheSamePlan) {
  const Built built(rich(shapes::blob(4, 2)), 1000);
  EncodesElsewhere elsewhere{built};
  built.write_from_parts(elsewhere.options());
  std::vector<fs::path> chunks;
  for (const auto& entry : fs::recursive_directory_iterator(built.folder()))
    if (entry.path().extension() == ".chunks") chunks.push_back(entry.path());
  ASSERT_EQ(chunks.size(), built.input.parts.size());
  // One is gone, a byte of another has changed.
  fs::remove(chunks[0]);
  std::vector<char> bytes = read_bytes(chunks[1]);
  bytes[bytes.size() / 2] ^= 1;
  write_bytes(chunks[1], bytes);
  elsewhere.tasks = 0;
  built.write_from_parts(elsewhere.options());
  EXPECT_EQ(elsewhere.tasks, 4u);
  built.write_from_memory();
  EXPECT_EQ(read_bytes(built.file("parts.umbel")), read_bytes(built.file("memory.umbel")));
  // Other settings make other chunks.
  elsewhere.tasks = 0;
  FinishOptions exact;
  exact.asset = AssetConfig::exact();
  built.write_from_parts(elsewhere.options(exact));
  EXPECT_EQ(elsewhere.tasks, 2 * chunks.size());
  built.write_from_memory(exact);
  EXPECT_EQ(read_bytes(built.file("parts.umbel")), read_bytes(built.file("memory.umbel")));
}

TEST(Finish, CarriesMaterialsAndWhateverElseAnAssetHas) {
  lod::Config config;
  config.mix_materials = true;
  const Built built(rich(shapes::blob(4, 2)), 1000, config);
  FinishOptions options;
  options.contents.metadata = "{\"a\": 1}";
  options.contents.materials = "{\"materials\": [{}, {}]}";
  options.contents.scene = "{\"nodes\": []}";
  options.contents.first_materials = {3};
  options.contents.files = {std::vector<std::byte>(5000, std::byte{7})};
  options.contents.origin = {1e6, 2, 3};
  options.contents.instances = {Instance{}};
  built.expect_same(options);
  const Asset asset(built.file("parts.umbel"));
  EXPECT_GE(asset.tables().clusters.front().material, 3u);
  const auto bytes = read_bytes(built.file("parts.umbel"));
  std::ofstream(built.file("image"), std::ios::binary) << std::string(5000, 7);
  options.contents.files.clear();
  options.files = {built.file("image")};
  built.write_from_parts(options);
  EXPECT_EQ(read_bytes(built.file("parts.umbel")), bytes);
}

TEST(Finish, OfOneUnitIsWhatBuildAndWriteMake) {
  for (const auto& [name, mesh] : meshes()) {
    SCOPED_TRACE(name);
    if (name == "skinned") continue;  // 0 and -0 are one value
    Built built(mesh, 1u << 20);
    built.input.report.input_vertices = mesh.positions.size();
    built.write_from_parts();
    write_asset(built.file("memory.umbel"), lod::build(mesh.view()));
    EXPECT_EQ(read_bytes(built.file("parts.umbel")), read_bytes(built.file("memory.umbel")));
  }
}

TEST(Finish, TellsWhatItHasWritten) {
  const Built built(shapes::terrain(60, 60, 1), 1000);
  FinishOptions options;
  options.metadata = [](const Finished& finished) {
    return "{\"groups\": " + std::to_string(finished.groups) + "}";
  };
  const Finished finished = built.write_from_parts(options);
  EXPECT_EQ(finished.groups, built.dag.tables.groups.size());
  EXPECT_EQ(finished.clusters, built.dag.tables.clusters.size());
  EXPECT_EQ(finished.levels, built.dag.tables.levels.size());
  EXPECT_EQ(finished.triangles, built.dag.cluster_triangles.size() / 3);
  EXPECT_EQ(finished.report.groups_by_method, built.dag.report.groups_by_method);
  EXPECT_EQ(finished.report.groups_by_limiting_factor, built.dag.report.groups_by_limiting_factor);
  EXPECT_EQ(Asset(built.file("parts.umbel")).info().metadata,
            "{\"groups\": " + std::to_string(finished.groups) + "}");
}

TEST(Finish, LeavesNothingWhereItIsCancelled) {
  const Built built(shapes::terrain(60, 60, 1), 1000);
  for (const float at : {0.0f, 0.3f, 0.8f, 0.95f}) {
    write_bytes(built.file("parts.umbel"), {'o', 'l', 'd'});
    const size_t before = built.work.files();
    BuildOptions build;
    build.progress = [&](float done, std::string_view) { return done < at; };
    EXPECT_THROW(built.write_from_parts({}, build), Error);
    EXPECT_EQ(read_bytes(built.file("parts.umbel")), (std::vector<char>{'o', 'l', 'd'}));
    EXPECT_EQ(built.work.files(), before);
  }
}

TEST(Finish, FindsAnyChangedByteOfTheParts) {
  const Built built(shapes::terrain(30, 30, 1), 500);
  const fs::path part = built.input.parts[1];
  const std::vector<char> whole = read_bytes(part);
  const size_t before = built.work.files();
  for (size_t at = 0; at < whole.size(); at += 97) {
    std::vector<char> bytes = whole;
    bytes[at] = static_cast<char>(bytes[at] ^ 0x20);
    write_bytes(part, bytes);
    EXPECT_THROW(built.write_from_parts(), Error) << "byte " << at;
  }
  fs::remove(part);
  EXPECT_THROW(built.write_from_parts(), Error);
  EXPECT_EQ(built.work.files(), before);
}

#if defined(__unix__)

TEST(Finish, SaysSoWhereThereIsNoRoomAndLeavesNothing) {
  const Built built(shapes::terrain(60, 60, 1), 1000);
  const size_t before = built.work.files(), in_folder = built.input.parts.size();
  built.write_from_memory();
  const auto bytes = static_cast<rlim_t>(fs::file_size(built.file("memory.umbel")));
  fs::remove(built.file("memory.umbel"));
  // The temporary file does not fit, or the asset does not.
  for (const rlim_t room : {bytes / 4, bytes - 4096}) {
    EXPECT_TRUE(umbel::testing::in_small_space(room, [&] {
      BuildOptions build;
      build.threads = 1;
      try {
        built.write_from_parts({}, build);
      } catch (const Error& error) {
        return error.code() == ErrorCode::kIo;
      }
      return false;
    }));
    EXPECT_EQ(built.work.files(), before);
  }
  EXPECT_EQ(built.input.parts.size(), in_folder);
}

#endif

}  // namespace
}  // namespace umbel::scale::testing
