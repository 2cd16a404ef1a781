// Decimation of the caller's own, and attributes that are refitted.
#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <set>

#include "base/math.hpp"
#include "lod/synthetic_dag.hpp"

namespace umbel::lod {
namespace {

// Takes vertices out of the inside, one at a time, and fills the hole with a fan around a new
// vertex at the mean of its rim: an edge-free decimation that adds vertices. A vertex of n
// triangles is replaced by nothing less, so it merges two neighbours' rings: the two vertices of an
// edge go, a new one comes.
bool merge_edges(const DecimationInput& input, DecimationResult& result) {
  std::vector<Triangle> triangles(input.mesh.triangles.begin(), input.mesh.triangles.end());
  std::vector<Vec3> positions(input.mesh.positions.begin(), input.mesh.positions.end());
  std::vector<uint8_t> used(positions.size(), 0);
  for (size_t v = 0; v < positions.size(); ++v) used[v] = input.locked[v];
  std::map<uint32_t, std::set<uint32_t>> around;
  for (const Triangle& t : triangles)
    for (int k = 0; k < 3; ++k) around[t[k]].insert({t[(k + 1) % 3], t[(k + 2) % 3]});
  std::map<uint32_t, uint32_t> merged;
  const auto link_holds = [&](uint32_t a, uint32_t b) {
    size_t common = 0;
    for (uint32_t x : around[a]) common += around[b].count(x);
    return common == 2;
  };
  for (const Triangle& t : input.mesh.triangles) {
    const uint32_t a = t[0], b = t[1];
    if (used[a] || used[b] || !link_holds(a, b)) continue;
    bool free = true;
    for (uint32_t v : {a, b})
      for (uint32_t x : around[v]) free &= !merged.count(x);
    if (!free) continue;
    const uint32_t made = static_cast<uint32_t>(positions.size());
    positions.push_back((positions[a] + positions[b]) * 0.5f);
    result.error = std::max(result.error, length(positions[a] - positions[b]));
    merged[a] = merged[b] = made;
    for (uint32_t v : {a, b})
      for (uint32_t x : around[v])
        if (x < used.size()) used[x] = 1;
    used[a] = used[b] = 1;
  }
  for (Triangle& t : triangles) {
    for (uint32_t& v : t)
      if (merged.count(v)) v = merged[v];
    if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) result.triangles.push_back(t);
  }
  result.added.positions.assign(positions.begin() + input.mesh.positions.size(), positions.end());
  return true;
}

VerifyReport check(const Dag& dag, const Mesh& mesh) {
  return verify(dag.tables, testing::reader_of(dag), testing::verify_config_of(dag, mesh, 24));
}

/// That the caller's function was used, and the result verifies.
void expect_sound_and_decimated(const Dag& dag, const Mesh& mesh) {
  EXPECT_GT(dag.report.groups_by_limiting_factor[0][static_cast<size_t>(LimitingFactor::kCaller)],
            0u);
  const VerifyReport report = check(dag, mesh);
  EXPECT_TRUE(report.ok) << (report.problems.empty() ? "" : report.problems[0]);
}

TEST(Decimator, may_add_vertices) {
  const Mesh mesh = shapes::blob(5, 4);
  for (const uint32_t threads : {1u, 4u}) {
    BuildOptions options;
    options.threads = threads;
    std::atomic<size_t> calls = 0;
    const Dag dag = build(mesh.view(), testing::small_config(), options,
                          [&](const DecimationInput& input, DecimationResult& result) {
                            ++calls;
                            return merge_edges(input, result);
                          });
    EXPECT_GT(calls, 10u);
    EXPECT_GT(dag.vertices.positions.size(), mesh.positions.size() + 100);
    EXPECT_EQ(dag.report.root_groups, 1u);
    expect_sound_and_decimated(dag, mesh);
  }
}

TEST(Decimator, threads_do_not_matter) {
  const Mesh mesh = shapes::blob(4, 4);
  BuildOptions one, many;
  one.threads = 1;
  many.threads = 4;
  const Dag a = build(mesh.view(), testing::small_config(), one, merge_edges);
  const Dag b = build(mesh.view(), testing::small_config(), many, merge_edges);
  EXPECT_EQ(a.tables.groups, b.tables.groups);
  EXPECT_EQ(a.vertices.positions, b.vertices.positions);
  EXPECT_EQ(a.cluster_vertices, b.cluster_vertices);
}

TEST(Decimator, that_declines_changes_nothing) {
  const Mesh mesh = shapes::blob(4, 4);
  const Dag a = build(mesh.view(), testing::small_config());
  const Dag b = build(mesh.view(), testing::small_config(), {},
                      [](const DecimationInput&, DecimationResult&) { return false; });
  EXPECT_EQ(a.tables.groups, b.tables.groups);
  EXPECT_EQ(a.cluster_vertices, b.cluster_vertices);
}

// Results that would tear the surface are not used.
TEST(Decimator, that_breaks_the_border_is_not_used) {
  const Mesh mesh = shapes::blob(5, 4);
  const Dag dag = build(mesh.view(), testing::small_config(), {},
                        [](const DecimationInput& input, DecimationResult& result) {
                          const auto& all = input.mesh.triangles;
                          result.triangles.assign(all.begin(), all.begin() + all.size() / 2);
                          return true;
                        });
  EXPECT_EQ(dag.report.root_groups, 1u);
  const VerifyReport report = check(dag, mesh);
  EXPECT_TRUE(report.ok) << (report.problems.empty() ? "" : report.problems[0]);
}

TEST(Decimator, that_turns_triangles_over_is_not_used) {
  const Mesh closed = shapes::blob(5, 4), open = shapes::grid(60, 60);
  for (const Mesh* mesh : {&closed, &open})
    for (const bool turns_all : {false, true}) {
      std::atomic<size_t> told = 0;
      const Dag dag = build(mesh->view(), testing::small_config(), {},
                            [&](const DecimationInput& input, DecimationResult& result) {
                              if (input.refused) {
                                told += input.refused->reason == DecimationRefusal::Reason::kEdges;
                                return false;
                              }
                              merge_edges(input, result);
                              for (size_t i = 0; i < result.triangles.size(); ++i)
                                if (turns_all || i % 9 == 0)
                                  std::swap(result.triangles[i][0], result.triangles[i][1]);
                              return true;
                            });
      EXPECT_GT(told, 5u);
      const VerifyReport report = check(dag, *mesh);
      EXPECT_TRUE(report.ok) << (report.problems.empty() ? "" : report.problems[0]);
    }
}

// No neighbour has an edge of theirs.
TEST(Decimator, that_turns_whole_components_over_is_not_used) {
  Mesh mesh;
  const auto add = [&](const Mesh& part, float x) {
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    for (const Vec3& p : part.positions) mesh.positions.push_back({p.x + x, p.y, p.z});
    for (const Triangle& t : part.triangles)
      mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  };
  for (int k = 0; k < 4; ++k) add(k % 2 == 0 ? shapes::blob(3, 4) : shapes::grid(20, 20), 4.0f * k);
  for (const bool turns : {false, true}) {
    std::atomic<size_t> told = 0;
    const Dag dag =
        build(mesh.view(), testing::small_config(), {},
              [&](const DecimationInput& input, DecimationResult& result) {
                if (input.refused) {
                  using Reason = DecimationRefusal::Reason;
                  const bool is_turned = input.refused->reason == Reason::kTurnedOver;
                  told += is_turned;
                  if (is_turned) EXPECT_NE(input.refused->triangle, kNone);
                  return false;
                }
                merge_edges(input, result);
                if (turns && std::ranges::all_of(input.locked, [](uint8_t l) { return !l; }))
                  for (Triangle& t : result.triangles) std::swap(t[0], t[1]);
                return true;
              });
    EXPECT_EQ(told > 0, turns);
    const VerifyReport report = check(dag, mesh);
    EXPECT_TRUE(report.ok) << (report.problems.empty() ? "" : report.problems[0]);
  }
}

// It mends what it is told.
TEST(Decimator, is_told_why_and_may_try_again) {
  using Reason = DecimationRefusal::Reason;
  const Mesh mesh = shapes::blob(5, 4);
  std::map<Reason, int> told;
  BuildOptions one;
  one.threads = 1;
  const Dag dag = build(
      mesh.view(), testing::small_config(), one,
      [&](const DecimationInput& input, DecimationResult& result) {
        EXPECT_GT(input.most, input.target);
        if (!input.refused) {  // all triangles: too many
          result.triangles.assign(input.mesh.triangles.begin(), input.mesh.triangles.end());
          return true;
        }
        EXPECT_FALSE(to_string(*input.refused).empty());
        ++told[input.refused->reason];
        switch (input.refused->reason) {
          case Reason::kTooMany:  // half of them: torn
            result.triangles.assign(input.mesh.triangles.begin(),
                                    input.mesh.triangles.begin() + input.mesh.triangles.size() / 2);
            return true;
          case Reason::kEdges:
            EXPECT_FALSE(input.refused->edges.empty());
            for (const auto& edge : input.refused->edges)
              for (const uint32_t v : edge) EXPECT_LT(v, input.mesh.positions.size());
            result.triangles = {{0, 1, 1}};
            return true;
          case Reason::kDegenerate:
            EXPECT_EQ(input.refused->triangle, 0u);
            return merge_edges(input, result);
          default:
            return false;
        }
      });
  EXPECT_GT(told[Reason::kTooMany], 5);
  EXPECT_EQ(told[Reason::kTooMany], told[Reason::kEdges]);
  EXPECT_EQ(told[Reason::kTooMany], told[Reason::kDegenerate]);
  expect_sound_and_decimated(dag, mesh);
}

TEST(Decimator, that_never_mends_is_asked_four_times) {
  const Mesh mesh = shapes::blob(4, 4);
  std::atomic<int> first = 0, again = 0;
  const Dag dag =
      build(mesh.view(), testing::small_config(), {},
            [&](const DecimationInput& input, DecimationResult& result) {
              // An edge that another group has made is known before the first call.
              const bool is_first =
                  !input.refused || input.refused->reason == DecimationRefusal::Reason::kTakenEdge;
              ++(is_first ? first : again);
              result.triangles.assign(input.mesh.triangles.begin(), input.mesh.triangles.end());
              return true;
            });
  EXPECT_GT(first, 10);
  EXPECT_EQ(again, 3 * first);
  EXPECT_EQ(dag.tables.groups, build(mesh.view(), testing::small_config()).tables.groups);
}

TEST(Decimator, can_cancel) {
  const Mesh mesh = shapes::blob(4, 4);
  try {
    build(mesh.view(), testing::small_config(), {},
          [](const DecimationInput&, DecimationResult&) -> bool {
            throw Error(ErrorCode::kCancelled, "enough");
          });
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCancelled);
  }
}

TEST(Decimator, gets_materials_and_attributes_and_keeps_seams) {
  Mesh mesh = shapes::grid(60, 60);
  for (size_t i = 0; i < mesh.triangles.size(); ++i)
    mesh.materials.push_back(i < mesh.triangles.size() / 2 ? 0 : 7);
  for (const Vec3& p : mesh.positions) {
    mesh.normals.push_back({0, 0, 1});
    mesh.uvs.push_back({p.x, p.y});
  }
  std::set<uint32_t> seen;
  BuildOptions one;
  one.threads = 1;
  const Dag dag = build(mesh.view(), testing::small_config(), one,
                        [&](const DecimationInput& input, DecimationResult&) {
                          EXPECT_EQ(input.mesh.normals.size(), input.mesh.positions.size());
                          EXPECT_EQ(input.mesh.uvs.size(), input.mesh.positions.size());
                          EXPECT_EQ(input.locked.size(), input.mesh.positions.size());
                          EXPECT_EQ(input.mesh.materials.size(), input.mesh.triangles.size());
                          EXPECT_LT(input.target, input.mesh.triangles.size());
                          seen.insert(input.mesh.materials.begin(), input.mesh.materials.end());
                          return false;
                        });
  EXPECT_EQ(seen, (std::set<uint32_t>{0, 7}));
  EXPECT_EQ(dag.report.root_groups, 1u);
}

TEST(Decimator, impossible_results_are_rejected_in_a_sentence) {
  const Mesh mesh = shapes::blob(4, 4);
  const auto with = [&](const std::function<void(DecimationResult&)>& change) {
    build(mesh.view(), testing::small_config(), {},
          [&](const DecimationInput& input, DecimationResult& result) {
            result.triangles = {input.mesh.triangles[0]};
            change(result);
            return true;
          });
  };
  const auto expect_sentence = [&](const char* part, const auto& change) {
    try {
      with(change);
      ADD_FAILURE() << part;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  };
  expect_sentence("triangles[0]", [](DecimationResult& r) { r.triangles[0][1] = 1u << 30; });
  expect_sentence("error", [](DecimationResult& r) { r.error = -1; });
  expect_sentence("error", [](DecimationResult& r) { r.error = NAN; });
  expect_sentence("normals", [](DecimationResult& r) { r.added.normals.push_back({0, 0, 1}); });
  expect_sentence("materials", [](DecimationResult& r) { r.added_materials = {1, 2}; });
  expect_sentence("osition", [](DecimationResult& r) { r.added.positions.push_back({NAN, 0, 0}); });
  EXPECT_THROW(with([](DecimationResult&) { throw std::runtime_error("mine"); }),
               std::runtime_error);
}

// Noise that has no extent at a tenth of the triangles must go into means, not be sampled.
TEST(RefitAttributes, brings_noisy_normals_closer_to_the_mean) {
  Mesh mesh = shapes::grid(120, 120);
  testing::Random random(3);
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    const Vec3 d = random.point() * 0.4f;
    const Vec3 n{d.x, d.y, 1};
    mesh.normals.push_back(n * (1.0f / length(n)));
  }
  const auto deviation = [&](bool refit) {
    Config config = testing::small_config();
    config.refit_attributes = refit;
    const Dag dag = build(mesh.view(), config);
    const VerifyReport report = check(dag, mesh);
    EXPECT_TRUE(report.ok) << (report.problems.empty() ? "" : report.problems[0]);
    const float error = error_for_triangles(dag.tables, mesh.triangles.size() / 10);
    const Mesh cut =
        mesh_of_cut(dag.tables, testing::reader_of(dag), select(dag.tables, view_error(error)));
    double sum = 0;
    for (const Vec3& n : cut.normals) {
      EXPECT_NEAR(length(n), 1, 1e-4);
      sum += std::acos(std::min(n.z, 1.0f));
    }
    return sum / cut.normals.size();
  };
  EXPECT_LT(deviation(true), 0.9 * deviation(false));
}

}  // namespace
}  // namespace umbel::lod
