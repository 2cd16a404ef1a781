#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <string>
#include <thread>

#include "asset/scratch.hpp"
#include "umbel/asset.hpp"
#include "umbel/stream.hpp"
#include "umbel/umbel.h"

namespace umbel {
namespace {

using testing::Scratch;

std::filesystem::path written(const Scratch& scratch) {
  AssetConfig config;
  config.page_bytes = 8192;
  write_asset(scratch / "a.umbel", lod::build(shapes::blob(5, 1).view()), "{}", {}, config);
  return scratch / "a.umbel";
}

struct OpenedAsset {
  OpenedAsset() {
    EXPECT_EQ(umbel_asset_open(written(scratch).string().c_str(), &asset), UMBEL_OK);
  }
  ~OpenedAsset() { umbel_asset_free(asset); }
  OpenedAsset(const OpenedAsset&) = delete;
  OpenedAsset& operator=(const OpenedAsset&) = delete;

  Scratch scratch;
  umbel_asset* asset = nullptr;
};

int read_from(void* user, uint64_t offset, uint64_t size, void* out) {
  const auto& bytes = *static_cast<std::vector<char>*>(user);
  if (offset + size > bytes.size()) return 1;
  std::memcpy(out, bytes.data() + offset, size);
  return 0;
}

TEST(CAsset, attributes_are_saved_as_exactly_as_asked) {
  const Scratch scratch;
  Mesh mesh = shapes::blob(3, 1);
  mesh.normals.assign(mesh.positions.size(), {0, 0.6f, 0.8f});
  for (const Vec3& p : mesh.positions) mesh.uvs.push_back({p.x, p.y});
  umbel_lod_mesh given;
  umbel_lod_mesh_init(&given);
  given.positions = reinterpret_cast<const umbel_vec3*>(mesh.positions.data());
  given.position_count = mesh.positions.size();
  given.triangles = mesh.triangles[0].data();
  given.triangle_count = mesh.triangles.size();
  given.normals = reinterpret_cast<const umbel_vec3*>(mesh.normals.data());
  given.uvs = reinterpret_cast<const umbel_vec2*>(mesh.uvs.data());
  umbel_lod* lod = nullptr;
  ASSERT_EQ(umbel_lod_build(&given, nullptr, nullptr, &lod), UMBEL_OK) << umbel_last_error();
  const std::string path = (scratch / "a.umbel").string();
  umbel_lod_save_config config;
  umbel_lod_save_config_init(&config);
  EXPECT_EQ(config.normal_bits, AssetConfig{}.normal_bits);
  config.normal_bits = 7;
  config.uv_step = 0.125f;
  config.origin = {1, 2, 3};
  ASSERT_EQ(umbel_lod_save_with(lod, path.c_str(), &config, nullptr), UMBEL_OK);
  const Asset asset(path);
  EXPECT_EQ(asset.info().normal_bits, 7u);
  EXPECT_EQ(asset.info().uv_step, 0.125f);
  EXPECT_EQ(asset.info().origin, (Vec3d{1, 2, 3}));
  for (uint32_t c = 0; c < asset.tables().clusters.size(); ++c)
    for (const Vec2& uv : asset.geometry(c).uvs) EXPECT_EQ(std::round(uv.x * 8), uv.x * 8);

  ASSERT_EQ(umbel_lod_save_with(lod, path.c_str(), nullptr, nullptr), UMBEL_OK);
  EXPECT_EQ(Asset(path).info().uv_step, AssetConfig{}.uv_step);
  config.normal_bits = 17;
  EXPECT_EQ(umbel_lod_save_with(lod, path.c_str(), &config, nullptr), UMBEL_ERROR_INVALID_ARGUMENT);
  config.struct_size = 1;
  EXPECT_EQ(umbel_lod_save_with(lod, path.c_str(), &config, nullptr), UMBEL_ERROR_INVALID_ARGUMENT);
  umbel_lod_free(lod);
}

TEST(CAsset, streams_to_the_cut_that_is_asked_for) {
  const Scratch scratch;
  std::vector<char> bytes = testing::read_bytes(written(scratch));
  umbel_asset* asset = nullptr;
  ASSERT_EQ(umbel_asset_open_source(bytes.size(), read_from, &bytes, &asset), UMBEL_OK);
  umbel_asset_info info;
  umbel_asset_info_init(&info);
  ASSERT_EQ(umbel_asset_get_info(asset, &info), UMBEL_OK);
  EXPECT_EQ(info.version_major, 6u);
  EXPECT_EQ(info.file_bytes, bytes.size());
  EXPECT_EQ(info.source_triangles, 20480u);

  umbel_residency* residency = nullptr;
  ASSERT_EQ(umbel_residency_create(asset, nullptr, &residency), UMBEL_OK);
  umbel_stream_view view{};
  umbel_stream_step step;
  umbel_stream_step_init(&step);
  for (int i = 0; i < 2000; ++i) {
    ASSERT_EQ(umbel_residency_step(residency, &view, 1, 0.01 * i, &step), UMBEL_OK);
    if (step.missing_groups == 0) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  EXPECT_EQ(step.missing_groups, 0u);
  size_t count = 0;
  EXPECT_EQ(umbel_residency_cut(residency, nullptr, 0, &count), UMBEL_ERROR_CAPACITY);
  std::vector<umbel_stream_cluster> cut(count);
  ASSERT_EQ(umbel_residency_cut(residency, cut.data(), cut.size(), &count), UMBEL_OK);
  uint64_t triangles = 0;
  std::vector<umbel_vec3> positions(256);
  std::vector<uint8_t> corners(3 * 256);
  for (const umbel_stream_cluster& c : cut) {
    umbel_cluster_geometry geometry;
    umbel_cluster_geometry_init(&geometry);
    geometry.positions = positions.data();
    geometry.triangles = corners.data();
    ASSERT_EQ(umbel_residency_cluster(residency, &c, &geometry), UMBEL_OK);
    triangles += geometry.triangle_count;
    for (uint32_t i = 0; i < 3 * geometry.triangle_count; ++i)
      ASSERT_LT(corners[i], geometry.vertex_count);
  }
  EXPECT_EQ(triangles, 20480u);
  umbel_residency_free(residency);
  umbel_asset_free(asset);
}

TEST(CAsset, streams_what_a_view_of_levels_of_detail_asks_for) {
  const OpenedAsset opened;
  umbel_asset* const asset = opened.asset;
  umbel_residency* residency = nullptr;
  ASSERT_EQ(umbel_residency_create(asset, nullptr, &residency), UMBEL_OK);
  umbel_stream_step step;
  umbel_stream_step_init(&step);
  std::vector<size_t> counts;
  double seconds = 0;
  for (const float distance : {2.0f, 200.0f}) {
    const float eye[] = {0, 0, distance};
    umbel_stream_view view{};
    ASSERT_EQ(umbel_lod_view_camera(eye, 1, 1080, 1, &view.view), UMBEL_OK);
    for (int i = 0; i < 2000; ++i) {
      ASSERT_EQ(umbel_residency_step(residency, &view, 1, seconds += 0.01, &step), UMBEL_OK);
      if (step.missing_groups == 0 && step.caught_up) break;
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    size_t count = 0;
    std::vector<umbel_stream_cluster> cut(10000);
    ASSERT_EQ(umbel_residency_cut(residency, cut.data(), cut.size(), &count), UMBEL_OK);
    counts.push_back(count);
  }
  EXPECT_GT(counts[0], 4 * counts[1]);
  EXPECT_GT(counts[1], 0u);
  umbel_stream_view by_level{};
  ASSERT_EQ(umbel_lod_view_level(1, &by_level.view), UMBEL_OK);
  EXPECT_EQ(umbel_residency_step(residency, &by_level, 1, seconds, &step),
            UMBEL_ERROR_INVALID_ARGUMENT);
  umbel_residency_free(residency);
}

// Steps until everything is there; returns the size of the cut.
size_t settled(umbel_residency* residency, const umbel_stream_view& view, double& seconds,
               uint64_t* resident) {
  umbel_stream_step step;
  umbel_stream_step_init(&step);
  for (int i = 0; i < 200; ++i) {
    EXPECT_EQ(umbel_residency_step(residency, &view, 1, seconds += 0.01, &step), UMBEL_OK);
    if (step.missing_groups == 0 && step.caught_up) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  *resident = step.resident_bytes;
  size_t count = 0;
  umbel_residency_cut(residency, nullptr, 0, &count);
  return count;
}

TEST(CAsset, shows_and_loads_little_of_what_lies_outside_the_planes) {
  const OpenedAsset opened;
  umbel_asset* const asset = opened.asset;
  double seconds = 0;
  const float eye[] = {0, 0, 3}, up[] = {0, 1, 0};
  const float toward[] = {0, 0, 0}, away[] = {0, 0, 6};
  umbel_plane planes[6];
  size_t counts[3] = {};
  uint64_t bytes[3] = {};
  for (int i = 0; i < 3; ++i) {
    umbel_residency* residency = nullptr;
    ASSERT_EQ(umbel_residency_create(asset, nullptr, &residency), UMBEL_OK);
    umbel_stream_view view{};
    ASSERT_EQ(umbel_lod_view_camera(eye, 1, 1080, 1, &view.view), UMBEL_OK);
    if (i > 0) {
      ASSERT_EQ(umbel_lod_frustum(eye, i == 1 ? toward : away, up, 0.2f, 1, 0.01f, INFINITY, planes,
                                  &view.plane_count),
                UMBEL_OK);
      view.planes = planes;
    }
    counts[i] = settled(residency, view, seconds, &bytes[i]);
    umbel_residency_free(residency);
  }
  EXPECT_LE(counts[1], counts[0]);
  EXPECT_LT(counts[2], counts[1] / 2);
  EXPECT_LT(bytes[2], bytes[1] / 2);
}

TEST(CAsset, a_step_keeps_the_limits_of_its_config) {
  const OpenedAsset opened;
  umbel_asset* const asset = opened.asset;
  uint32_t most[2] = {};
  for (int i = 0; i < 2; ++i) {
    umbel_residency_config config;
    umbel_residency_config_init(&config);
    if (i == 0) config.loads_in_flight = 1;
    umbel_residency* residency = nullptr;
    ASSERT_EQ(umbel_residency_create(asset, &config, &residency), UMBEL_OK);
    umbel_stream_view view{};
    umbel_stream_step step;
    umbel_stream_step_init(&step);
    for (int k = 0; k < 20; ++k) {
      ASSERT_EQ(umbel_residency_step(residency, &view, 1, 0.01 * k, &step), UMBEL_OK);
      most[i] = std::max(most[i], step.requested);
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    umbel_residency_free(residency);
  }
  EXPECT_EQ(most[0], 1u);
  EXPECT_GT(most[1], 1u);
}

TEST(CAsset, has_its_mistakes_named) {
  const Scratch scratch;
  const std::string path = written(scratch).string();
  umbel_asset* asset = nullptr;
  EXPECT_EQ(umbel_asset_open("/no/such/file", &asset), UMBEL_ERROR_IO);
  EXPECT_EQ(asset, nullptr);
  EXPECT_EQ(umbel_asset_open(nullptr, &asset), UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(umbel_asset_open(path.c_str(), nullptr), UMBEL_ERROR_INVALID_ARGUMENT);
  std::vector<char> nothing(10);
  EXPECT_EQ(umbel_asset_open_source(1000, read_from, &nothing, &asset), UMBEL_ERROR_IO);
  EXPECT_EQ(umbel_asset_open_source(1000, nullptr, nullptr, &asset), UMBEL_ERROR_INVALID_ARGUMENT);
  ASSERT_EQ(umbel_asset_open(path.c_str(), &asset), UMBEL_OK);
  umbel_asset_info info{};
  EXPECT_EQ(umbel_asset_get_info(asset, &info), UMBEL_ERROR_INVALID_ARGUMENT);
  umbel_residency* residency = nullptr;
  umbel_residency_config config;
  umbel_residency_config_init(&config);
  config.budget_bytes = 1;
  EXPECT_EQ(umbel_residency_create(asset, &config, &residency), UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_NE(std::string(umbel_last_error()).find("budget"), std::string::npos);
  ASSERT_EQ(umbel_residency_create(asset, nullptr, &residency), UMBEL_OK);
  umbel_residency* jumpy = nullptr;
  umbel_residency_config_init(&config);
  EXPECT_EQ(config.hysteresis, umbel::ResidencyConfig{}.hysteresis);
  EXPECT_EQ(config.budget_bytes, umbel::ResidencyConfig{}.budget_bytes);
  config.hysteresis = 0.5f;
  EXPECT_EQ(umbel_residency_create(asset, &config, &jumpy), UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_NE(std::string(umbel_last_error()).find("hysteresis"), std::string::npos);
  umbel_stream_step step;
  umbel_stream_step_init(&step);
  umbel_stream_view view{};
  view.mesh = 9;
  EXPECT_EQ(umbel_residency_step(residency, &view, 1, 0, &step), UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(umbel_residency_step(residency, nullptr, 1, 0, &step), UMBEL_ERROR_INVALID_ARGUMENT);
  view.mesh = 0;
  view.plane_count = 6;
  EXPECT_EQ(umbel_residency_step(residency, &view, 1, 0, &step), UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_NE(std::string(umbel_last_error()).find("planes"), std::string::npos);
  const umbel_stream_cluster wrong{0, 1u << 30, 0, 0};
  umbel_cluster_geometry geometry;
  umbel_cluster_geometry_init(&geometry);
  EXPECT_EQ(umbel_residency_cluster(residency, &wrong, &geometry), UMBEL_ERROR_INVALID_ARGUMENT);
  umbel_residency_free(residency);
  umbel_asset_free(asset);
  umbel_residency_free(nullptr);
  umbel_asset_free(nullptr);
}

}  // namespace
}  // namespace umbel
