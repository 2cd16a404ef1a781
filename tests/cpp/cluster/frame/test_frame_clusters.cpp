#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <set>

#include "base/math.hpp"
#include "base/thread_teams.hpp"
#include "cluster/frame/build_frame.hpp"
#include "cluster/frame/rebuild_worst.hpp"
#include "umbel/frame_clusters.hpp"

namespace umbel {
namespace {

/// Every configuration that changes what is done.
std::vector<FrameClusterConfig> configs() {
  std::vector<FrameClusterConfig> all;
  for (const FrameMethod method : {FrameMethod::kMorton, FrameMethod::kHybrid})
    for (const uint32_t bits : {30u, 63u})
      for (const uint32_t vertices : {0u, 48u})
        for (const uint32_t max : {128u, 37u}) {
          FrameClusterConfig config;
          config.method = method;
          config.code_bits = bits;
          config.max_vertices = vertices;
          config.max_triangles = max;
          all.push_back(config);
        }
  return all;
}

Mesh soup(uint32_t triangles, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  Mesh mesh;
  for (uint32_t i = 0; i < triangles; ++i) {
    const Vec3 at{4 * unit(random), unit(random), 0.2f * unit(random)};
    for (int k = 0; k < 3; ++k)
      mesh.positions.push_back(at + Vec3{unit(random), unit(random), unit(random)} * 0.05f);
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return mesh;
}

FrameClusterer clusters_of(const Mesh& mesh, const FrameClusterConfig& config,
                           uint32_t threads = 0) {
  FrameClusterer clusters(mesh.triangles, mesh.positions.size(), config);
  clusters.build(mesh.positions, {nullptr, threads});
  return clusters;
}

template <typename T>
std::vector<T> copy(std::span<const T> span) {
  return {span.begin(), span.end()};
}

uint32_t vertices_of(const FrameClusterer& c, size_t cluster) {
  std::set<uint32_t> vertices;
  for (uint32_t i = c.offsets()[cluster]; i < c.offsets()[cluster + 1]; ++i)
    vertices.insert(c.triangles()[i].begin(), c.triangles()[i].end());
  return uint32_t(vertices.size());
}

/// What must hold of clusters of any frame.
void expect_sound(const FrameClusterer& c, const Mesh& mesh, const FrameClusterConfig& config) {
  const size_t n = mesh.triangles.size();
  ASSERT_EQ(c.items().size(), n);
  ASSERT_EQ(c.offsets().front(), 0u);
  ASSERT_EQ(c.offsets().back(), n);
  ASSERT_LE(c.count(), max_frame_clusters(uint32_t(n), config));
  std::vector<uint32_t> seen = copy(c.items());
  std::sort(seen.begin(), seen.end());
  for (size_t i = 0; i < n; ++i) ASSERT_EQ(seen[i], i);
  for (size_t i = 0; i < n; ++i) ASSERT_EQ(c.triangles()[i], mesh.triangles[c.items()[i]]);
  const uint32_t least = config.min_triangles ? config.min_triangles : config.max_triangles / 4;
  uint32_t small = 0;
  for (size_t k = 0; k < c.count(); ++k) {
    ASSERT_LT(c.offsets()[k], c.offsets()[k + 1]);
    const uint32_t size = c.offsets()[k + 1] - c.offsets()[k];
    ASSERT_LE(size, config.max_triangles);
    small += size < (config.method == FrameMethod::kHybrid ? least : config.max_triangles);
    if (config.max_vertices) ASSERT_LE(vertices_of(c, k), config.max_vertices);
    Aabb box;
    for (uint32_t i = c.offsets()[k]; i < c.offsets()[k + 1]; ++i)
      for (const uint32_t v : c.triangles()[i]) extend(box, mesh.positions[v]);
    ASSERT_EQ(c.boxes()[k], box);
  }
  if (!config.max_vertices) ASSERT_LE(small, 1u);
}

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

/// The order by arithmetic that shares nothing with the library's.
TEST(FrameClusters, morton_runs_are_in_the_order_of_interleaved_bits) {
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
TEST(FrameClusters, vectors_round_as_scalars_do) {
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
      const cluster::ShortBox a = block.round(view, i), b = block.round(view.box(i));
      ASSERT_TRUE(std::equal(a.low, a.low + 8, b.low));
    }
  }
}
#endif

TEST(FrameClusters, large_triangles_are_apart) {
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
  const auto rules = cluster::CheckedFrameConfig::of(config, n);
  std::vector<uint32_t> items(n), offsets(rules.most_clusters(n) + 1), count(1);
  std::vector<Triangle> triangles(n);
  std::vector<Aabb> boxes(rules.most_clusters(n));
  Exec exec;
  const cluster::Positions positions{reinterpret_cast<const char*>(mesh.positions.data()), 12};
  cluster::build_frame(
      exec, {positions, mesh.triangles.data(), nullptr, n}, rules,
      {items.data(), triangles.data(), offsets.data(), boxes.data(), count.data()});
  for (uint32_t c = 0; c <= count[0]; ++c) items.push_back(offsets[c]);
  for (uint32_t c = 0; c < count[0]; ++c) {
    for (const float x : {boxes[c].min.x, boxes[c].min.y, boxes[c].max.z})
      items.push_back(std::bit_cast<uint32_t>(x));
  }
  return items;
}

/// A team's threads meet some thousand times for a mesh, so only what differs is tried.
std::vector<FrameClusterConfig> configs_for_teams() {
  std::vector<FrameClusterConfig> all = configs();
  std::erase_if(all, [](const FrameClusterConfig& c) { return c.code_bits == 63; });
  return all;
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

/// Bends what was straight.
Mesh deformed(Mesh mesh, float angle) {
  for (Vec3& p : mesh.positions) {
    const float a = angle * p.x;
    p = {p.x, p.y * std::cos(a) - p.z * std::sin(a), p.y * std::sin(a) + p.z * std::cos(a)};
  }
  return mesh;
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

TEST(FrameClusters, refit_keeps_clusters_and_bounds_them) {
  const Mesh mesh = soup(9000, 6);
  for (const FrameClusterConfig& config : configs()) {
    FrameClusterer c = clusters_of(mesh, config);
    const auto items = copy(c.items());
    const AreaGrowth rest = c.refit(mesh.positions);
    EXPECT_EQ(rest.area_ratio, rest.area_ratio_at_build);
    EXPECT_EQ(rest.growth(), 1.0);
    const Mesh moved = deformed(mesh, 2);
    const AreaGrowth growth = c.refit(moved.positions);
    expect_sound(c, moved, config);
    EXPECT_EQ(copy(c.items()), items);
    Aabb all;
    double sum = 0;
    for (const Aabb& box : c.boxes()) {
      sum += half_area(box);
      extend(all, box);
    }
    EXPECT_NEAR(growth.area_ratio, sum / half_area(all), 1e-5 * growth.area_ratio);
    EXPECT_EQ(growth.area_ratio_at_build, rest.area_ratio);
  }
}

TEST(FrameClusters, boxes_without_a_size_count_as_the_whole) {
  constexpr uint64_t kWhole = cluster::AreaShares::kWhole;
  const float inf = std::numeric_limits<float>::infinity(), nan = std::nanf("");
  // As devices make them of any positions: a cube, half of it, a point, what is infinite, what is
  // no number, nothing.
  std::vector<Aabb> boxes{{{0, 0, 0}, {1, 1, 1}}, {{0, 0, 0}, {1, 1, 0}}, {{1, 1, 1}, {1, 1, 1}}};
  const auto shares_of = [](std::vector<Aabb> of) {
    const auto count = uint32_t(of.size());
    std::vector<uint64_t> now(count), at_build(count), total(2);
    uint32_t n = count;
    CpuExec exec;
    cluster::measure_area_growth(exec, {nullptr, nullptr, nullptr, of.data(), &n}, count,
                                 {now.data(), at_build.data(), total.data()}, true);
    EXPECT_EQ(total[0], std::accumulate(now.begin(), now.end(), uint64_t(0)));
    return now;
  };
  EXPECT_EQ(shares_of(boxes), (std::vector<uint64_t>{kWhole, kWhole / 3, 0}));
  boxes.push_back({});
  EXPECT_EQ(shares_of(boxes), (std::vector<uint64_t>{kWhole, kWhole / 3, 0, 0}));
  boxes.push_back({{-inf, 0, 0}, {inf, 0, 0}});
  boxes.push_back({{inf, inf, inf}, {inf, inf, inf}});
  boxes.push_back({{nan, 0, 0}, {nan, 1, 1}});
  const std::vector<uint64_t> shares = shares_of(boxes);
  for (size_t i = 0; i < shares.size(); ++i) EXPECT_LE(shares[i], kWhole) << i;
  for (size_t i = 4; i < shares.size(); ++i) EXPECT_EQ(shares[i], kWhole) << i;
}

TEST(FrameClusters, scaling_alone_is_no_area_growth) {
  const Mesh mesh = soup(2000, 6);
  FrameClusterer c = clusters_of(mesh, {});
  Mesh larger = mesh;
  for (Vec3& p : larger.positions) p = p * 8.0f;
  EXPECT_DOUBLE_EQ(c.refit(larger.positions).growth(), 1.0);
}

TEST(FrameClusters, the_worst_are_rebuilt_and_the_others_stay) {
  const Mesh mesh = soup(9000, 8);
  // One end of the soup is stirred.
  Mesh stirred = mesh;
  std::mt19937 random(1);
  std::uniform_real_distribution<float> unit(-0.2f, 0.2f);
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (mesh.positions[3 * t].x > 0.4f) continue;
    const Vec3 by{unit(random), unit(random), unit(random)};
    for (size_t k = 0; k < 3; ++k) stirred.positions[3 * t + k] = mesh.positions[3 * t + k] + by;
  }
  for (const FrameClusterConfig& config : configs()) {
    if (config.max_vertices) continue;
    FrameClusterer c = clusters_of(mesh, config);
    const double refitted = c.refit(stirred.positions).area_ratio;
    std::set<std::vector<uint32_t>> before;
    const auto sets = [&](auto& into) {
      for (size_t k = 0; k < c.count(); ++k) {
        std::vector<uint32_t> items(c.items().begin() + c.offsets()[k],
                                    c.items().begin() + c.offsets()[k + 1]);
        std::sort(items.begin(), items.end());
        into.insert(items);
      }
    };
    sets(before);
    const auto budget = uint32_t(c.count() / 4);
    const double rebuilt = c.rebuild_worst(stirred.positions, budget).area_ratio;
    expect_sound(c, stirred, config);
    EXPECT_LT(rebuilt, refitted);
    std::set<std::vector<uint32_t>> after;
    sets(after);
    std::vector<std::vector<uint32_t>> gone;
    std::set_difference(before.begin(), before.end(), after.begin(), after.end(),
                        std::back_inserter(gone));
    EXPECT_LE(gone.size(), budget);
    EXPECT_GT(gone.size(), 0u);
    // With nothing to improve, nothing is done.
    FrameClusterer again = clusters_of(mesh, config);
    const auto items = copy(again.items());
    again.rebuild_worst(mesh.positions, 1000000);
    EXPECT_EQ(copy(again.items()), items);
  }
}

TEST(FrameClusters, partial_rebuilds_by_teams_of_many_lanes_are_the_same) {
  const Mesh mesh = soup(600, 8), moved = deformed(mesh, 3);
  const auto rebuild = [&](auto exec, const FrameClusterConfig& config) {
    const auto n = uint32_t(mesh.triangles.size());
    const auto rules = cluster::CheckedFrameConfig::of(config, n);
    const uint32_t most = rules.most_clusters(n);
    std::vector<uint32_t> items[2], offsets[2], count[2];
    std::vector<Triangle> triangles[2];
    std::vector<Aabb> boxes[2];
    std::vector<uint64_t> now(most), at_build[2], total(2);
    cluster::FrameClusters view[2];
    for (int k = 0; k < 2; ++k) {
      items[k].resize(n), offsets[k].resize(most + 1), count[k].resize(1);
      triangles[k].resize(n), boxes[k].resize(most), at_build[k].resize(most);
      view[k] = {items[k].data(), triangles[k].data(), offsets[k].data(), boxes[k].data(),
                 count[k].data()};
    }
    const auto at = [](const Mesh& m) {
      return cluster::Positions{reinterpret_cast<const char*>(m.positions.data()), 12};
    };
    cluster::build_frame(exec, {at(mesh), mesh.triangles.data(), nullptr, n}, rules, view[0]);
    const cluster::AreaShares shares{now.data(), at_build[0].data(), total.data()};
    cluster::measure_area_growth(exec, view[0], most, shares, true);
    exec.for_each_team(
        most, cluster::RefitCluster{{at(moved), triangles[0].data(), nullptr, n}, view[0]});
    cluster::measure_area_growth(exec, view[0], most, shares, false);
    cluster::rebuild_worst(exec, at(moved), rules, view[0], shares, n, 3, view[1],
                           {now.data(), at_build[1].data(), total.data()});
    items[1].insert(items[1].end(), offsets[1].begin(), offsets[1].begin() + count[1][0] + 1);
    for (const uint64_t sum : total) items[1].push_back(uint32_t(sum ^ sum >> 32));
    return items[1];
  };
  for (const FrameClusterConfig& config : configs_for_teams())
    if (!config.max_vertices)
      ASSERT_EQ(rebuild(ThreadTeamExec(), config), rebuild(CpuExec(), config));
}

TEST(FrameClusters, vertex_lists_name_the_corners) {
  const Mesh mesh = shapes::sphere(4);
  for (const FrameClusterConfig& config : configs()) {
    const FrameClusterer c = clusters_of(mesh, config);
    const FrameVertexLists lists = list_frame_vertices(c);
    ASSERT_EQ(lists.vertex_offsets.size(), c.count() + 1);
    for (size_t k = 0; k < c.count(); ++k) {
      const uint32_t* vertices = lists.vertices.data() + lists.vertex_offsets[k];
      ASSERT_EQ(lists.vertex_offsets[k + 1] - lists.vertex_offsets[k], vertices_of(c, k));
      for (uint32_t i = c.offsets()[k]; i < c.offsets()[k + 1]; ++i)
        for (int corner = 0; corner < 3; ++corner)
          ASSERT_EQ(vertices[lists.corners[i][corner]], c.triangles()[i][corner]);
    }
  }
}

TEST(FrameClusters, lists_need_clusters_of_few_vertices) {
  const Mesh mesh = soup(300, 1);  // 128 triangles with 384 vertices
  const FrameClusterer c = clusters_of(mesh, {});
  EXPECT_THROW(list_frame_vertices(c), Error);
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

TEST(RebuildPolicy, decides_by_threshold_period_and_budget) {
  using Action = RebuildPolicy::Action;
  RebuildPolicy policy;
  policy.threshold = 1.5;
  policy.least_period = 4;
  policy.most_period = 20;
  const AreaGrowth little{2.9, 2.0}, much{3.0, 2.0};
  EXPECT_EQ(policy.decide(little, 10), Action::kKeep);
  EXPECT_EQ(policy.decide(much, 3), Action::kKeep);
  EXPECT_EQ(policy.decide(much, 4), Action::kRebuild);
  EXPECT_EQ(policy.decide(little, 20), Action::kRebuild);
  policy.budget = 0.1;
  EXPECT_EQ(policy.decide(much, 4), Action::kRebuildWorst);
}

}  // namespace
}  // namespace umbel
