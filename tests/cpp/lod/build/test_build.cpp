#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <map>
#include <utility>

#include "lod/synthetic_dag.hpp"
#include "umbel/lod.hpp"

namespace umbel::lod {
namespace {

VerifyReport check(const Mesh& mesh, const Dag& dag, uint32_t cuts = 24) {
  return verify(dag.tables, testing::reader_of(dag), testing::verify_config_of(dag, mesh, cuts));
}

std::string first_problem(const VerifyReport& report) {
  return report.problems.empty() ? "" : report.problems[0];
}

bool same_bytes(const Dag& a, const Dag& b) {
  return a.tables.groups == b.tables.groups && a.tables.clusters == b.tables.clusters &&
         a.tables.levels == b.tables.levels && a.tables.nodes == b.tables.nodes &&
         a.cluster_vertices == b.cluster_vertices && a.cluster_triangles == b.cluster_triangles &&
         a.vertices.positions == b.vertices.positions;
}

struct Case {
  const char* name;
  Mesh mesh;
};

std::vector<Case> all_shapes() {
  std::vector<Case> cases;
  cases.push_back({"grid", shapes::grid(90, 70)});
  cases.push_back({"sphere", shapes::sphere(5)});
  cases.push_back({"torus", shapes::torus(120, 60)});
  cases.push_back({"moebius", shapes::moebius(400, 8)});
  cases.push_back({"fan", shapes::fan(3000)});
  cases.push_back({"soup", shapes::soup(3000, 1)});
  cases.push_back({"tetrahedra", shapes::tetrahedra(1000)});
  cases.push_back({"terrain", shapes::terrain(80, 80, 1)});
  cases.push_back({"blob", shapes::blob(5, 1)});
  return cases;
}

// The surface of a lattice of bars, `cells` in each direction: closed, connected, with very many
// handles, which no collapse of a single edge takes away.
Mesh lattice(int cells) {
  const int size = 2 * cells + 1;
  const auto is_solid = [&](int x, int y, int z) {
    if (std::min({x, y, z}) < 0 || std::max({x, y, z}) >= size) return false;
    return x % 2 + y % 2 + z % 2 <= 1;
  };
  Mesh mesh;
  std::map<std::array<int, 3>, uint32_t> vertices;
  const auto vertex = [&](const std::array<int, 3>& at) {
    const auto [i, is_new] = vertices.insert({at, static_cast<uint32_t>(vertices.size())});
    if (is_new) mesh.positions.push_back({float(at[0]), float(at[1]), float(at[2])});
    return i->second;
  };
  for (int z = 0; z < size; ++z)
    for (int y = 0; y < size; ++y)
      for (int x = 0; x < size; ++x)
        for (int axis = 0; axis < 3 && is_solid(x, y, z); ++axis)
          for (int side : {0, 1}) {
            std::array<int, 3> across = {x, y, z};
            across[axis] += side == 0 ? -1 : 1;
            if (is_solid(across[0], across[1], across[2])) continue;
            std::array<int, 3> corner = {x, y, z};
            corner[axis] += side;
            std::array<uint32_t, 4> quad;
            for (int i = 0; i < 4; ++i) {
              std::array<int, 3> at = corner;
              at[(axis + 1) % 3] += i == 1 || i == 2;
              at[(axis + 2) % 3] += i >= 2;
              quad[i] = vertex(at);
            }
            if (side == 0) std::swap(quad[1], quad[3]);
            mesh.triangles.push_back({quad[0], quad[1], quad[2]});
            mesh.triangles.push_back({quad[0], quad[2], quad[3]});
          }
  return mesh;
}

TEST(Build, a_surface_with_many_handles_ends_in_one_root) {
  const Mesh mesh = lattice(8);
  const Dag dag = build(mesh.view());
  const VerifyReport report = check(mesh, dag);
  EXPECT_TRUE(report.ok) << first_problem(report);
  EXPECT_EQ(dag.report.root_groups, 1u);
  EXPECT_EQ(dag.report.stuck_groups, 0u);
  EXPECT_LE(dag.report.root_triangles, dag.config.max_triangles);
}

TEST(Build, every_shape_is_verified) {
  for (const Case& c : all_shapes()) {
    const Dag dag = build(c.mesh.view());
    const VerifyReport report = check(c.mesh, dag);
    EXPECT_TRUE(report.ok) << c.name << ": " << first_problem(report);
  }
}

TEST(Build, connected_shapes_end_in_one_root_of_one_cluster) {
  for (const Mesh& mesh : {shapes::grid(90, 70), shapes::sphere(5), shapes::torus(120, 60),
                           shapes::terrain(80, 80, 1), shapes::blob(5, 1)}) {
    const Dag dag = build(mesh.view());
    EXPECT_EQ(dag.report.root_groups, 1u);
    EXPECT_EQ(dag.report.stuck_groups, 0u);
    EXPECT_LE(dag.report.root_triangles, 128u);
    EXPECT_EQ(dag.tables.groups.back().error, std::numeric_limits<float>::infinity());
  }
}

TEST(Build, many_components_end_in_one_root) {
  const Dag dag = build(shapes::tetrahedra(2000).view());
  EXPECT_EQ(dag.report.root_groups, 1u);
  EXPECT_LE(dag.report.root_triangles, 128u);
}

TEST(Build, same_bytes_for_any_thread_count) {
  const Mesh mesh = shapes::blob(6, 3);
  BuildOptions one, two, eight;
  one.threads = 1, two.threads = 2, eight.threads = 8;
  const Dag a = build(mesh.view(), {}, one);
  EXPECT_TRUE(same_bytes(a, build(mesh.view(), {}, two)));
  EXPECT_TRUE(same_bytes(a, build(mesh.view(), {}, eight)));
}

TEST(Build, clusters_keep_their_limits) {
  const Mesh mesh = shapes::blob(5, 2);
  Config config;
  config.max_triangles = 64;
  config.max_vertices = 40;
  const Dag dag = build(mesh.view(), config);
  for (const Cluster& c : dag.tables.clusters) {
    EXPECT_LE(c.triangle_count, 64u);
    EXPECT_LE(c.vertex_count, 40u);
    EXPECT_GE(c.triangle_count, 1u);
  }
  EXPECT_TRUE(check(mesh, dag).ok);
}

TEST(Build, group_sizes_are_as_asked) {
  Config config;
  config.min_group = 8;
  config.max_group = 12;
  const Dag dag = build(shapes::blob(6, 2).view(), config);
  for (const Group& g : dag.tables.groups) EXPECT_LE(g.clusters.count, 12u);
  // Level 0 has enough clusters for every group but one to be of full size.
  const Range level = dag.tables.levels[0];
  uint32_t small = 0;
  for (uint32_t g = level.offset; g < level.offset + level.count; ++g)
    small += dag.tables.groups[g].clusters.count < 8;
  EXPECT_LE(small, 1u);
}

TEST(Build, empty_mesh_gives_an_empty_dag) {
  const Dag dag = build(MeshView{});
  EXPECT_TRUE(dag.tables.groups.empty());
  EXPECT_TRUE(dag.tables.nodes.empty());
  EXPECT_EQ(dag.report.root_groups, 0u);
  EXPECT_TRUE(check(Mesh{}, dag).ok);
}

TEST(Build, one_triangle_and_two_apart_are_their_own_root) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {5, 5, 5}, {6, 5, 5}, {5, 6, 5}};
  mesh.triangles = {{0, 1, 2}};
  EXPECT_EQ(build(mesh.view()).report.root_triangles, 1u);
  mesh.triangles.push_back({3, 4, 5});
  const Dag dag = build(mesh.view());
  EXPECT_EQ(dag.report.root_groups, 1u);
  EXPECT_EQ(dag.report.root_triangles, 2u);
  EXPECT_TRUE(check(mesh, dag).ok);
}

TEST(Build, everything_at_one_point_keeps_level_zero) {
  Mesh mesh;
  mesh.positions.assign(30000, Vec3{1, 2, 3});
  for (uint32_t i = 0; i < 10000; ++i) mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  const Dag dag = build(mesh.view());
  EXPECT_EQ(dag.report.degenerate_triangles, 10000u);
  EXPECT_EQ(dag.report.root_groups, 1u);
  EXPECT_EQ(dag.report.root_triangles, 1u);
  uint64_t triangles = 0;
  for (const Cluster& c : dag.tables.clusters)
    if (c.generating_group == kNone) triangles += c.triangle_count;
  EXPECT_EQ(triangles, 10000u);
  EXPECT_TRUE(check(mesh, dag).ok) << first_problem(check(mesh, dag));
}

TEST(Build, unwelded_input_does_not_crack) {
  const Mesh welded = shapes::blob(5, 7);
  Mesh soup;
  for (const Triangle& t : welded.triangles) {
    const uint32_t base = static_cast<uint32_t>(soup.positions.size());
    for (uint32_t v : t) {
      soup.positions.push_back(welded.positions[v]);
      // A normal per face makes every vertex distinct, so that welding cannot hide the seams.
      soup.normals.push_back({static_cast<float>(base), 1.0f, 0.0f});
    }
    soup.triangles.push_back({base, base + 1, base + 2});
  }
  const Dag dag = build(soup.view());
  const VerifyReport report = check(soup, dag);
  EXPECT_TRUE(report.ok) << first_problem(report);
  EXPECT_EQ(report.cracks, 0u);
}

TEST(Build, materials_never_mix_in_a_cluster) {
  Mesh mesh = shapes::blob(5, 4);
  for (size_t i = 0; i < mesh.triangles.size(); ++i)
    mesh.materials.push_back(mesh.positions[mesh.triangles[i][0]].x > 0 ? 1 : 0);
  const Dag dag = build(mesh.view());
  EXPECT_TRUE(check(mesh, dag).ok);
  bool seen[2] = {};
  for (const Cluster& c : dag.tables.clusters) seen[c.material] = true;
  EXPECT_TRUE(seen[0] && seen[1]);
}

TEST(Build, scale_does_not_matter) {
  const Mesh mesh = shapes::blob(4, 5);
  const Dag reference = build(mesh.view());
  for (float scale : {0x1p-60f, 0x1p50f}) {
    Mesh scaled = mesh;
    for (Vec3& p : scaled.positions) p = {p.x * scale, p.y * scale, p.z * scale};
    const Dag dag = build(scaled.view());
    ASSERT_EQ(dag.tables.groups.size(), reference.tables.groups.size());
    EXPECT_EQ(dag.cluster_triangles, reference.cluster_triangles);
    for (size_t g = 0; g + 1 < dag.tables.groups.size(); ++g)
      EXPECT_NEAR(dag.tables.groups[g].error / scale / reference.tables.groups[g].error, 1.0, 1e-3);
  }
}

TEST(Build, cancelling_throws_and_progress_never_falls) {
  const Mesh mesh = shapes::blob(5, 1);
  float last = 0;
  BuildOptions options;
  options.progress = [&](float fraction, std::string_view) {
    EXPECT_GE(fraction, last);
    EXPECT_LE(fraction, 1.0f);
    last = fraction;
    return true;
  };
  build(mesh.view(), {}, options);
  EXPECT_EQ(last, 1.0f);
  options.progress = [](float fraction, std::string_view) { return fraction < 0.3f; };
  try {
    build(mesh.view(), {}, options);
    FAIL() << "not cancelled";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCancelled);
  }
}

TEST(Build, impossible_configs_and_bad_meshes_are_refused) {
  const Mesh mesh = shapes::grid(4, 4);
  const auto code = [&](const Config& config, const Mesh& m) {
    try {
      build(m.view(), config);
    } catch (const Error& error) {
      return error.code();
    }
    return ErrorCode::kIo;
  };
  Config config;
  config.max_triangles = 3;
  EXPECT_EQ(code(config, mesh), ErrorCode::kInvalidArgument);
  config = {};
  config.min_group = 40;
  EXPECT_EQ(code(config, mesh), ErrorCode::kInvalidArgument);
  config = {};
  config.ratio = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(code(config, mesh), ErrorCode::kInvalidArgument);
  Mesh bad = mesh;
  bad.positions[3].y = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(code({}, bad), ErrorCode::kInvalidMesh);
  bad = mesh;
  bad.triangles[2][1] = 1000;
  EXPECT_EQ(code({}, bad), ErrorCode::kInvalidMesh);
}

TEST(Build, impossible_configs_are_refused_by_the_name_of_the_field) {
  const Mesh mesh = shapes::grid(4, 4);
  const auto sentence = [&](const std::function<void(Config&)>& change) -> std::string {
    Config config;
    change(config);
    try {
      build(mesh.view(), config);
    } catch (const Error& error) {
      return error.what();
    }
    return "not refused";
  };
  EXPECT_EQ(sentence([](Config& c) { c.min_group = 1; }), "min_group is 1, must be at least 2");
  EXPECT_EQ(sentence([](Config& c) { c.min_group = 40; }),
            "min_group is 40, more than max_group, 32");
  EXPECT_EQ(sentence([](Config& c) { c.max_group = 1025; }),
            "max_group is 1025, must be at most 1024");
  const std::pair<const char*, float Config::*> weights[] = {
      {"normal_weight", &Config::normal_weight},
      {"uv_weight", &Config::uv_weight},
      {"color_weight", &Config::color_weight},
      {"tangent_weight", &Config::tangent_weight},
      {"skin_weight", &Config::skin_weight}};
  for (const auto& [name, weight] : weights)
    EXPECT_EQ(sentence([&](Config& c) { c.*weight = 1001; }),
              std::string(name) + " is 1001, must be in [0, 1000]");
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::pair<float, const char*> steps[] = {{3.0f, "3"},
                                                 {-0.5f, "-0.5"},
                                                 {1e-9f, "1e-09"},
                                                 {nan, "nan"},
                                                 {std::numeric_limits<float>::infinity(), "inf"}};
  for (const auto& [step, printed] : steps)
    EXPECT_EQ(
        sentence([&, step = step](Config& c) { c.position_step = step; }),
        std::string("position_step is ") + printed + ", must be 0 or a positive power of two");
}

// The margin between a group's error and those of its generating groups, without which rounding far
// away could refine the latter alone (hierarchy.cpp).
TEST(Build, errors_keep_their_margin_where_positions_are_rounded) {
  const Mesh mesh = shapes::grid(120, 120);
  for (const bool measured : {false, true}) {
    Config config;
    config.position_step = 0x1p-5f;
    config.measured_error = measured;
    const Dag dag = build(mesh.view(), config);
    ASSERT_GT(dag.report.largest_move, 0);
    const auto& groups = dag.tables.groups;
    for (const Group& group : groups) ASSERT_GE(group.error, dag.report.largest_move);
    for (const Cluster& cluster : dag.tables.clusters)
      if (cluster.generating_group != kNone)
        ASSERT_GE(groups[cluster.group].error, 1.000009f * groups[cluster.generating_group].error);
  }
}

TEST(Build, no_error_is_above_the_limit_where_positions_are_rounded) {
  const Mesh mesh = shapes::sphere(5);
  Config config;
  config.position_step = 0x1p-5f;
  config.max_error = 0.05f;
  const Dag dag = build(mesh.view(), config);
  EXPECT_GT(dag.tables.levels.size(), 1u);
  for (const Group& group : dag.tables.groups)
    EXPECT_TRUE(group.error <= config.max_error || group.method == SimplifyMethod::kRoot)
        << group.error;
}

TEST(Build, every_ratio_leads_to_one_root) {
  const Mesh mesh = shapes::terrain(60, 60, 1);
  for (const float ratio : {0.1f, 0.5f, 0.8f, 0.86f, 0.9f}) {
    Config config;
    config.ratio = ratio;
    const Dag dag = build(mesh.view(), config);
    EXPECT_EQ(dag.report.root_groups, 1u) << ratio;
    EXPECT_EQ(dag.report.stuck_groups, 0u) << ratio;
    EXPECT_LE(dag.report.root_triangles, 128u) << ratio;
    EXPECT_EQ(first_problem(check(mesh, dag)), "") << ratio;
  }
}

TEST(Build, ends_where_large_texture_coordinates_cancel_out) {
  // 64 charts with vertices of their own, which lie far apart in the texture.
  Mesh mesh;
  for (uint32_t chart = 0; chart < 64; ++chart) {
    const Mesh square = shapes::grid(6, 6);
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    const uint32_t row = chart / 8;
    const auto x = static_cast<float>(chart % 8), y = static_cast<float>(row);
    for (const Vec3& p : square.positions) {
      mesh.positions.push_back({p.x + x, p.y + y, p.z});
      mesh.uvs.push_back({p.x + 10.0f * static_cast<float>(chart), p.y});
    }
    for (const Triangle& t : square.triangles)
      mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  }
  for (const SeamRule rule : {SeamRule::kProtect, SeamRule::kAllow, SeamRule::kIgnore}) {
    Config config;
    config.seams = config.creases = rule;
    const VerifyReport report = check(mesh, build(mesh.view(), config));
    EXPECT_TRUE(report.ok) << first_problem(report);
  }
}

}  // namespace
}  // namespace umbel::lod
