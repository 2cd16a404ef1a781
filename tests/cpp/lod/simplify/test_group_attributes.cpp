// Attributes through the levels of detail: each weighs in the error, none is lost, materials stay
// the triangles', and the report says why methods were left.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <numeric>

#include "asset/scratch.hpp"
#include "lod/synthetic_dag.hpp"
#include "umbel/asset.hpp"
#include "umbel/lod.hpp"

namespace umbel::lod {
namespace {

using umbel::testing::Scratch;

Config small() { return testing::small_config(); }
GeometryReader reader(const Dag& dag) { return testing::reader_of(dag); }

Mesh cut_of(const Dag& dag, float error) {
  return mesh_of_cut(dag.tables, reader(dag), select(dag.tables, view_error(error)));
}

Mesh cut_to(const Dag& dag, uint64_t triangles) {
  return cut_of(dag, error_for_triangles(dag.tables, triangles));
}

void expect_verified(const Mesh& mesh, const Dag& dag) {
  const VerifyReport report =
      verify(dag.tables, reader(dag), testing::verify_config_of(dag, mesh, 16));
  EXPECT_TRUE(report.ok) << (report.problems.empty() ? "" : report.problems[0]);
}

// Two further sets of texture coordinates and two of joints, all functions of the position.
Mesh with_extras(Mesh mesh) {
  mesh.extras = {{ExtraKind::kUvs, 1},    {ExtraKind::kUvs, 2},     {ExtraKind::kJoints, 0},
                 {ExtraKind::kJoints, 1}, {ExtraKind::kWeights, 0}, {ExtraKind::kWeights, 1}};
  for (const Vec3& p : mesh.positions) {
    const float along = std::clamp(0.5f + 2.0f * p.x, 0.0f, 1.0f);
    for (float value : {p.x, p.y,     2 * p.y, 3 * p.z, 4.f, 700.f,        0.f,
                        0.f, 65535.f, 0.f,     0.f,     0.f, 0.5f * along, 0.5f - 0.5f * along,
                        0.f, 0.f,     0.5f,    0.f,     0.f, 0.f})
      mesh.extra_values.push_back(value);
  }
  return mesh;
}

void expect_extras_of_position(const Mesh& mesh, float tolerance) {
  Mesh expected;
  expected.positions = mesh.positions;
  expected = with_extras(std::move(expected));
  ASSERT_EQ(mesh.extras, expected.extras);
  ASSERT_EQ(mesh.extra_values.size(), expected.extra_values.size());
  for (size_t i = 0; i < expected.extra_values.size(); ++i)
    ASSERT_NEAR(mesh.extra_values[i], expected.extra_values[i], tolerance) << i % 20;
}

TEST(Attributes, every_further_one_stays_with_its_vertex_in_every_cut) {
  const Mesh mesh = with_extras(shapes::blob(4, 3));
  const Dag dag = build(mesh.view(), small());
  expect_verified(mesh, dag);
  for (uint32_t triangles : {5000u, 1000u, 100u})
    expect_extras_of_position(cut_to(dag, triangles), 0.0f);
}

TEST(Attributes, files_keep_further_ones_as_exactly_as_they_are_asked_to) {
  const Mesh mesh = with_extras(shapes::blob(3, 3));
  const Dag dag = build(mesh.view(), small());
  const Scratch scratch;
  for (const bool exact : {true, false}) {
    write_asset(scratch / "a.umbel", dag, "{}", {}, exact ? AssetConfig::exact() : AssetConfig{});
    const Asset asset(scratch / "a.umbel");
    const auto cut = select(dag.tables, view_level(1));
    const Mesh stored = mesh_of_cut(dag.tables, [&](uint32_t c) { return asset.geometry(c); }, cut);
    EXPECT_EQ(stored.triangles.size(), mesh_of_cut(dag.tables, reader(dag), cut).triangles.size());
    expect_extras_of_position(stored, exact ? 0.0f : 0x1p-14f);
  }
}

// A flat patch where only `paint` says where detail is: near x = 0.5.
Mesh patch(const std::function<void(Mesh&, float)>& paint) {
  Mesh mesh = shapes::grid(64, 64);
  for (const Vec3& p : mesh.positions) paint(mesh, p.x);
  return mesh;
}

double part_in_the_middle(const Mesh& cut) {
  const auto inside = std::ranges::count_if(
      cut.positions, [](const Vec3& p) { return p.x > 0.35f && p.x < 0.65f; });
  return static_cast<double>(inside) / static_cast<double>(cut.positions.size());
}

float wave(float x) { return std::fabs(x - 0.5f) < 0.12f ? std::sin(100.0f * x) : 0.0f; }

void expect_weight_keeps_the_middle(const Mesh& mesh, float Config::* weight) {
  Config config = small();
  config.*weight = 0.0f;
  const double without = part_in_the_middle(cut_to(build(mesh.view(), config), 1600));
  config.*weight = 0.3f;
  const double with = part_in_the_middle(cut_to(build(mesh.view(), config), 1600));
  EXPECT_GT(with, without + 0.15);
}

TEST(Attributes, further_texture_coordinates_weigh_in_the_error) {
  expect_weight_keeps_the_middle(patch([](Mesh& mesh, float x) {
                                   mesh.extras = {{ExtraKind::kUvs, 1}};
                                   mesh.extra_values.insert(mesh.extra_values.end(), {wave(x), 0});
                                 }),
                                 &Config::uv_weight);
}

TEST(Attributes, weights_of_joints_weigh_in_the_error) {
  expect_weight_keeps_the_middle(
      patch([](Mesh& mesh, float x) {
        mesh.extras = {{ExtraKind::kJoints, 0}, {ExtraKind::kWeights, 0}};
        const float part = 0.5f + 0.5f * wave(x);
        mesh.extra_values.insert(mesh.extra_values.end(), {7, 3, 0, 0, part, 1 - part, 0, 0});
      }),
      &Config::skin_weight);
}

TEST(Attributes, joints_without_weight_do_not_matter) {
  Mesh plain = patch([](Mesh& mesh, float x) {
    mesh.extras = {{ExtraKind::kJoints, 0}, {ExtraKind::kWeights, 0}};
    mesh.extra_values.insert(mesh.extra_values.end(), {x < 0.5f ? 1.f : 2.f, 0, 9, 9, 0, 0, 0, 0});
  });
  const Dag dag = build(plain.view(), small());
  plain.extras.clear();
  plain.extra_values.clear();
  EXPECT_EQ(dag.tables.groups, build(plain.view(), small()).tables.groups);
}

TEST(Attributes, tangents_weigh_in_the_error) {
  expect_weight_keeps_the_middle(patch([](Mesh& mesh, float x) {
                                   const float a = wave(x);
                                   mesh.tangents.push_back({std::cos(a), std::sin(a), 0, 1});
                                 }),
                                 &Config::tangent_weight);
}

// Texture coordinates that run towards x = 0.5 from both sides, tangents with them.
Mesh mirrored() {
  Mesh half = shapes::grid(40, 40), mesh;
  for (const float side : {-1.0f, 1.0f}) {
    const uint32_t first = static_cast<uint32_t>(mesh.positions.size());
    for (const Vec3& p : half.positions) {
      mesh.positions.push_back({side * p.x, p.y, 0.05f * std::sin(9 * p.x) * std::sin(7 * p.y)});
      mesh.uvs.push_back({p.x, p.y});
      mesh.tangents.push_back({side, 0, 0, side});
    }
    for (const Triangle& t : half.triangles)
      mesh.triangles.push_back(side < 0 ? Triangle{first + t[0], first + t[2], first + t[1]}
                                        : Triangle{first + t[0], first + t[1], first + t[2]});
  }
  return mesh;
}

TEST(Attributes, mirrored_texture_coordinates_stay_mirrored) {
  const Mesh mesh = mirrored();
  for (const SeamRule rule : {SeamRule::kProtect, SeamRule::kAllow}) {
    Config config = small();
    config.seams = rule;
    const Dag dag = build(mesh.view(), config);
    expect_verified(mesh, dag);
    const Mesh cut = cut_to(dag, mesh.triangles.size() / 10);
    double worst = 0;
    size_t across = 0;
    for (const Triangle& t : cut.triangles) {
      double u = 0, x = 0;
      bool left = false, right = false;
      for (uint32_t v : t) {
        u += cut.uvs[v].x / 3;
        x += cut.positions[v].x / 3;
        left |= cut.positions[v].x < -1e-3f;
        right |= cut.positions[v].x > 1e-3f;
      }
      worst = std::max(worst, std::fabs(u - std::fabs(x)));
      across += left && right;
      // A triangle has the handedness of its side.
      if (rule == SeamRule::kProtect) {
        EXPECT_EQ(cut.tangents[t[0]].w, cut.tangents[t[1]].w);
        EXPECT_EQ(cut.tangents[t[0]].w, cut.tangents[t[2]].w);
      }
    }
    if (rule == SeamRule::kProtect) EXPECT_EQ(across, 0u);
    EXPECT_LT(worst, 0.08);
  }
}

// Squares of two materials, as a chess board.
Mesh board() {
  Mesh mesh = shapes::terrain(48, 48, 4);
  for (const Triangle& t : mesh.triangles) {
    const Vec3& p = mesh.positions[t[0]];
    const int column = static_cast<int>(8 * p.x), row = static_cast<int>(8 * p.y);
    mesh.materials.push_back((column + row) % 2 == 0 ? 3 : 5);
  }
  return mesh;
}

std::map<uint32_t, double> area_by_material(const Mesh& mesh) {
  std::map<uint32_t, double> areas;
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    const Vec3 &p = mesh.positions[a], &q = mesh.positions[b], &r = mesh.positions[c];
    areas[mesh.materials[t]] +=
        0.5 * std::fabs((q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x));
  }
  return areas;
}

TEST(Attributes, clusters_may_mix_materials_and_triangles_keep_theirs) {
  const Mesh mesh = board();
  const Dag apart = build(mesh.view(), small());
  Config config = small();
  config.mix_materials = true;
  const Dag mixed = build(mesh.view(), config);
  expect_verified(mesh, mixed);
  EXPECT_LT(mixed.tables.levels[0].count, apart.tables.levels[0].count);
  const auto source = area_by_material(mesh);
  for (const Dag* dag : {&apart, &mixed}) {
    const Mesh level0 = cut_of(*dag, 0.0f);
    EXPECT_EQ(std::ranges::count(level0.materials, 3u), std::ranges::count(mesh.materials, 3u));
    EXPECT_TRUE(level0.extras.empty());
    const Mesh coarse = cut_to(*dag, mesh.triangles.size() / 4);
    for (const auto& [material, area] : area_by_material(coarse))
      EXPECT_NEAR(area, source.at(material), 0.03 * area) << material;
  }
  size_t of_several = 0;
  for (uint32_t c = 0; c < mixed.tables.clusters.size(); ++c) {
    const ClusterGeometry g = mixed.geometry(c);
    ASSERT_EQ(g.extras, (std::vector<Extra>{{ExtraKind::kMaterial, 0}}));
    for (size_t i = 0; i < g.triangles.size(); i += 3)
      for (size_t k = 1; k < 3; ++k)
        EXPECT_EQ(g.extra_values[g.triangles[i]], g.extra_values[g.triangles[i + k]]);
    of_several +=
        std::ranges::adjacent_find(g.extra_values, std::not_equal_to<>()) != g.extra_values.end();
  }
  EXPECT_GT(of_several, 0u);
}

TEST(Attributes, files_keep_the_materials_of_triangles_each_mesh_its_own) {
  const Mesh mesh = board();
  Config config = small();
  config.mix_materials = true;
  const Dag dag = build(mesh.view(), config);
  AssetContents contents;
  contents.meshes = {&dag, &dag};
  contents.first_materials = {0, 10};
  const Scratch scratch;
  write_asset(scratch / "a.umbel", contents);
  const Asset asset(scratch / "a.umbel");
  const auto cut = select(dag.tables, view_error(0.0f));
  for (uint32_t m = 0; m < 2; ++m) {
    const Mesh stored =
        mesh_of_cut(asset.tables(m), [&](uint32_t c) { return asset.geometry(c, m); }, cut);
    EXPECT_EQ(std::ranges::count(stored.materials, 3u + 10 * m),
              std::ranges::count(mesh.materials, 3u));
    EXPECT_EQ(std::ranges::count(stored.materials, 5u + 10 * m),
              std::ranges::count(mesh.materials, 5u));
  }
}

TEST(Attributes, materials_and_further_attributes_beyond_what_vertices_can_have_are_refused) {
  Mesh mesh = board();
  for (uint32_t set = 0; set < 10; ++set) mesh.extras.push_back({ExtraKind::kJoints, set});
  mesh.extra_values.assign(mesh.positions.size() * kMostExtraValues, 1.0f);
  Config config = small();
  EXPECT_FALSE(build(mesh.view(), config).tables.groups.empty());
  config.mix_materials = true;
  EXPECT_THROW(build(mesh.view(), config), Error);

  const Dag dag = build(board().view(), config);
  AssetContents contents;
  contents.meshes = {&dag};
  contents.first_materials = {kNone - 3};
  const Scratch scratch;
  EXPECT_THROW(write_asset(scratch / "a.umbel", contents), Error);
}

TEST(Attributes, what_is_no_attribute_is_refused_by_name) {
  const auto message = [](const Mesh& mesh) -> std::string {
    try {
      build(mesh.view());
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  const Mesh good = with_extras(shapes::grid(2, 2));
  EXPECT_EQ(message(good), "");
  Mesh bad = good;
  bad.extra_values.pop_back();
  EXPECT_NE(message(bad).find("extra_values has"), std::string::npos);
  bad = good;
  std::swap(bad.extras[0], bad.extras[1]);
  EXPECT_NE(message(bad).find("extras[1]"), std::string::npos);
  bad = good;
  bad.extra_values[4] = 0.5f;
  EXPECT_NE(message(bad).find("number of a joint"), std::string::npos);
  bad.extra_values[4] = NAN;
  EXPECT_NE(message(bad).find("not finite"), std::string::npos);
  bad = good;
  bad.extras = {{static_cast<ExtraKind>(3), 0}};
  EXPECT_NE(message(bad).find("has the kind 3"), std::string::npos);
  bad.extras = {{ExtraKind::kUvs, 0}};
  EXPECT_NE(message(bad).find("has the set 0"), std::string::npos);
  bad = shapes::grid(1, 1);
  bad.extras = {{ExtraKind::kMaterial, 0}};
  bad.extra_values.assign(bad.positions.size(), 0.0f);
  EXPECT_NE(message(bad).find("give `materials`"), std::string::npos);
}

uint64_t sum(const std::array<uint64_t, kLimitingFactors>& counts) {
  return std::accumulate(counts.begin(), counts.end(), uint64_t{0});
}

uint64_t count(const Report& report, SimplifyMethod method, LimitingFactor limiting_factor) {
  return report
      .groups_by_limiting_factor[static_cast<size_t>(method)][static_cast<size_t>(limiting_factor)];
}

void expect_counted(const Dag& dag) {
  ASSERT_EQ(dag.limiting_factors.size(), dag.tables.groups.size());
  std::array<std::array<uint64_t, kLimitingFactors>, 5> counted{};
  for (size_t g = 0; g < dag.limiting_factors.size(); ++g)
    ++counted[static_cast<size_t>(dag.tables.groups[g].method)]
             [static_cast<size_t>(dag.limiting_factors[g])];
  EXPECT_EQ(counted, dag.report.groups_by_limiting_factor);
  for (size_t method = 0; method < counted.size(); ++method)
    EXPECT_EQ(sum(counted[method]), dag.report.groups_by_method[method]);
}

TEST(LimitingFactors, of_every_group_are_counted) {
  for (const Mesh& mesh : {shapes::blob(4, 1), shapes::soup(2000, 1), shapes::tetrahedra(500),
                           shapes::moebius(200, 8), mirrored()}) {
    const Dag dag = build(mesh.view(), small());
    expect_counted(dag);
    EXPECT_EQ(count(dag.report, SimplifyMethod::kRoot, LimitingFactor::kCoarsest), 1u);
  }
}

TEST(LimitingFactors, name_what_stood_in_the_way) {
  // A smooth closed surface: the first method does it.
  Dag dag = build(shapes::sphere(4).view(), small());
  EXPECT_GT(count(dag.report, SimplifyMethod::kRegular, LimitingFactor::kNone),
            dag.report.groups_by_method[static_cast<size_t>(SimplifyMethod::kRegular)] * 9 / 10);
  // Separate triangles: whatever moves, the last triangle of a part goes.
  Config config = small();
  config.keep_area = false;
  dag = build(shapes::soup(2000, 1).view(), config);
  EXPECT_EQ(count(dag.report, SimplifyMethod::kRegular, LimitingFactor::kNone), 0u);
  uint64_t topology = 0;
  for (const auto& limiting_factors : dag.report.groups_by_limiting_factor)
    topology += limiting_factors[static_cast<size_t>(LimitingFactor::kTopology)];
  EXPECT_GT(topology, 0u);
  // Every triangle a chart of its own.
  Mesh charts = shapes::grid(30, 30), split;
  for (const Triangle& t : charts.triangles)
    for (uint32_t v : t) {
      if (split.positions.size() % 3 == 0) {
        const auto first = static_cast<uint32_t>(split.positions.size());
        split.triangles.push_back({first, first + 1, first + 2});
      }
      split.positions.push_back(charts.positions[v]);
      split.uvs.push_back({static_cast<float>(split.triangles.size()), 0});
    }
  config = small();
  config.seams = SeamRule::kProtect;
  dag = build(split.view(), config);
  uint64_t seams = 0;
  for (const auto& limiting_factors : dag.report.groups_by_limiting_factor)
    seams += limiting_factors[static_cast<size_t>(LimitingFactor::kSeams)];
  EXPECT_GT(
      seams + dag.report.waits_by_limiting_factor[static_cast<size_t>(LimitingFactor::kSeams)], 0u);
}

TEST(LimitingFactors, of_roots_say_why_it_ends_there) {
  Config config = small();
  config.max_levels = 2;
  EXPECT_GT(count(build(shapes::blob(4, 1).view(), config).report, SimplifyMethod::kRoot,
                  LimitingFactor::kStopped),
            0u);
  config = small();
  config.max_error = 1e-4f;
  const Report report = build(shapes::blob(4, 1).view(), config).report;
  EXPECT_GT(count(report, SimplifyMethod::kRoot, LimitingFactor::kStopped), 0u);
  EXPECT_GT(report.waits_by_limiting_factor[static_cast<size_t>(LimitingFactor::kStopped)], 0u);
}

}  // namespace
}  // namespace umbel::lod
