#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "base/thread_teams.hpp"
#include "cluster/frame/build_frame.hpp"
#include "cluster/frame/frame_cases.hpp"

namespace umbel {
namespace {

using namespace testing;

TEST(FrameClusters, every_triangle_is_in_one_cluster_within_the_limits) {
  for (const FrameClusterConfig& config : configs())
    for (const uint32_t n : {0u, 1u, 31u, 127u, 128u, 129u, 1535u, 1537u, 5000u, 40001u}) {
      const Mesh mesh = soup(n, n);
      expect_sound(clusters_of(mesh, config), mesh, config);
    }
}

TEST(FrameClusters, a_sphere_is_clustered_within_the_limits) {
  const Mesh mesh = shapes::sphere(5);
  for (const FrameClusterConfig& config : configs())
    expect_sound(clusters_of(mesh, config), mesh, config);
}

TEST(FrameClusters, of_no_triangles_end_their_progress_too) {
  for (const auto method : {cluster_mesh_morton, cluster_mesh_hybrid}) {
    float last = -1;
    BuildOptions options;
    options.progress = [&](float fraction, std::string_view) {
      last = fraction;
      return true;
    };
    EXPECT_TRUE(method(MeshView{}, cluster_preset("quality", 128), options).ranges.empty());
    EXPECT_EQ(last, 1);
  }
}

TEST(FrameClusters, hybrid_has_less_than_half_the_area_of_morton) {
  for (const Mesh& mesh : {shapes::sphere(6), soup(30000, 7)}) {
    FrameClusterConfig morton, hybrid;
    morton.method = FrameMethod::kMorton;
    const double of_morton = clusters_of(mesh, morton).area_growth().area_ratio;
    const double of_hybrid = clusters_of(mesh, hybrid).area_growth().area_ratio;
    EXPECT_LT(of_hybrid, 0.6 * of_morton);
    const Clusters best = cluster_mesh(mesh.view(), cluster_preset("quality", 128));
    Aabb all;
    double sum = 0;
    for (const Range& r : best.ranges) {
      Aabb box;
      for (uint32_t i = r.offset; i < r.offset + r.count; ++i)
        for (const uint32_t v : mesh.triangles[best.items[i]]) extend(box, mesh.positions[v]);
      sum += half_area(box);
      extend(all, box);
    }
    EXPECT_LT(of_hybrid, 1.15 * sum / half_area(all));
  }
}

TEST(FrameClusters, threads_change_nothing) {
  const Mesh mesh = soup(20000, 5);
  for (const FrameClusterConfig& config : configs()) {
    const FrameClusterer one = clusters_of(mesh, config, 1), many = clusters_of(mesh, config, 7);
    ASSERT_EQ(copy(one.items()), copy(many.items()));
    ASSERT_EQ(copy(one.offsets()), copy(many.offsets()));
  }
}

/// Clusters by an executor whose teams have several lanes.
template <typename Exec>
std::vector<uint32_t> built_by(const Mesh& mesh, const FrameClusterConfig& config) {
  const auto n = uint32_t(mesh.triangles.size());
  const auto checked = cluster::CheckedFrameConfig::of(config, n);
  std::vector<uint32_t> items(n), offsets(checked.most_clusters(n) + 1), count(1);
  std::vector<Triangle> triangles(n);
  std::vector<Aabb> boxes(checked.most_clusters(n));
  Exec exec;
  const cluster::Positions positions{reinterpret_cast<const char*>(mesh.positions.data()), 12};
  cluster::build_frame(
      exec, {positions, mesh.triangles.data(), nullptr, n}, checked,
      {items.data(), triangles.data(), offsets.data(), boxes.data(), count.data()});
  for (uint32_t c = 0; c <= count[0]; ++c) items.push_back(offsets[c]);
  for (uint32_t c = 0; c < count[0]; ++c) {
    for (const float x : {boxes[c].min.x, boxes[c].min.y, boxes[c].max.z})
      items.push_back(std::bit_cast<uint32_t>(x));
  }
  return items;
}

TEST(FrameClusters, teams_of_many_lanes_do_what_one_does) {
  Mesh same = soup(150, 2);  // all centres in one place: nothing but ranks tells them apart
  for (size_t v = 0; v < same.positions.size(); ++v)
    same.positions[v] = {float(v % 3), float(v % 3 == 1), 0};
  for (const FrameClusterConfig& config : configs_for_teams()) {
    ASSERT_EQ(built_by<ThreadTeamExec>(same, config), built_by<CpuExec>(same, config));
    const Mesh mesh = soup(config.max_triangles == 128 ? 1700 : 400, 9);
    ASSERT_EQ(built_by<ThreadTeamExec>(mesh, config), built_by<CpuExec>(mesh, config));
  }
}

TEST(FrameClusters, update_is_build_but_for_equal_codes) {
  const Mesh mesh = soup(9000, 4);
  for (FrameClusterConfig config : configs()) {
    config.code_bits = 63;  // so that no two codes are equal
    FrameClusterer updated = clusters_of(mesh, config);
    for (const float angle : {0.5f, 1.5f}) {
      const Mesh moved = deformed(mesh, angle);
      updated.update(moved.positions);
      expect_sound(updated, moved, config);
      const FrameClusterer built = clusters_of(moved, config);
      ASSERT_EQ(copy(updated.items()), copy(built.items()));
      ASSERT_EQ(copy(updated.offsets()), copy(built.offsets()));
    }
  }
}

TEST(FrameClusters, extremes_of_shape_and_scale_are_sound) {
  std::vector<Mesh> meshes;
  for (const float scale : {1e-41f, 1e-30f, 1e15f, 1e30f, 8e37f}) {
    Mesh mesh = soup(2000, 11);
    for (Vec3& p : mesh.positions) p = (p - Vec3{2, 0.5f, 0.1f}) * scale;
    meshes.push_back(mesh);
  }
  Mesh flat = soup(2000, 12), line = flat, point = flat, outlier = flat;
  for (Vec3& p : flat.positions) p.z = 0;
  for (Vec3& p : line.positions) p = {0, p.y, 0};
  for (Vec3& p : point.positions) p = {-0.0f, 5, 1e-3f};
  outlier.positions[0] = {1e30f, 0, 0};
  meshes.insert(meshes.end(), {flat, line, point, outlier});
  for (const Mesh& mesh : meshes)
    for (const FrameClusterConfig& config : configs())
      expect_sound(clusters_of(mesh, config), mesh, config);
}

TEST(FrameClusters, zeros_of_boxes_are_positive) {
  Mesh mesh;
  mesh.positions = {{-0.0f, 0, 1}, {0, -0.0f, 1}, {-0.0f, -0.0f, 0}};
  mesh.triangles = {{0, 1, 2}};
  const FrameClusterer c = clusters_of(mesh, {});
  for (const float x : {c.boxes()[0].min.x, c.boxes()[0].min.y, c.boxes()[0].max.y})
    EXPECT_FALSE(std::signbit(x));
}

template <typename Work>
std::string failure(const Work& work, ErrorCode code) {
  try {
    work();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code);
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return "";
}

TEST(FrameClusters, mistakes_are_named) {
  const Mesh mesh = soup(10, 1);
  const auto with = [](auto set) {
    return [set] {
      FrameClusterConfig config;
      set(config);
      max_frame_clusters(10, config);
    };
  };
  using C = FrameClusterConfig;
  const ErrorCode bad = ErrorCode::kInvalidArgument;
  EXPECT_EQ(failure(with([](C& c) { c.max_triangles = 513; }), bad),
            "max_triangles must be from 2 to 512, not 513");
  failure(with([](C& c) { c.max_triangles = 1; }), bad);
  failure(with([](C& c) { c.min_triangles = 65; }), bad);
  failure(with([](C& c) { c.max_vertices = 2; }), bad);
  failure(with([](C& c) { c.max_vertices = 257; }), bad);
  failure(with([](C& c) { c.underfill_cost = std::nanf(""); }), bad);
  failure(with([](C& c) { c.code_bits = 32; }), bad);
  failure(with([](C& c) { c.method = FrameMethod(2); }), bad);
  failure([] { max_frame_clusters(0x40000000u, {}); }, ErrorCode::kUnsupported);
  failure([&] { FrameClusterer(mesh.triangles, 29, {}); }, ErrorCode::kInvalidMesh);
  FrameClusterer c(mesh.triangles, 30, {});
  failure([&] { c.build(std::span(mesh.positions).first(29)); }, bad);
  Mesh infinite = mesh;
  infinite.positions[4].y = INFINITY;
  failure([&] { c.build(infinite.positions); }, ErrorCode::kInvalidMesh);
  FrameClusterConfig limited;
  limited.max_vertices = 64;
  FrameClusterer d(mesh.triangles, 30, limited);
  failure([&] { d.rebuild_worst(mesh.positions, 3); }, bad);
}

}  // namespace
}  // namespace umbel
