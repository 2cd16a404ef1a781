// Verification in a fixed memory finds what verification from tables finds.
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "asset/scratch.hpp"
#include "lod/specimen.hpp"
#include "umbel/asset.hpp"

namespace umbel {
namespace {

using lod::Dag;
using lod::testing::Random;
using lod::testing::Specimen;
using testing::Scratch;

constexpr uint64_t kMemory = uint64_t{256} << 20;

std::string all_problems(const lod::VerifyReport& report) {
  std::string all;
  for (const std::string& problem : report.problems) all += problem + "\n";
  return all;
}

/// Verifies in both ways; nothing where the DAG cannot be stored.
bool verify_both(const Scratch& scratch, const Dag& dag, lod::VerifyReport& whole,
                 lod::VerifyReport& paged) {
  AssetConfig config;
  config.page_bytes = 8192;
  try {
    write_asset(scratch / "a.umbel", dag, "{}", {}, config);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    return false;
  }
  whole = verify_asset(scratch / "a.umbel", 16);
  paged = verify_asset_within(kMemory, scratch / "a.umbel", 16);
  return true;
}

TEST(VerifyWithin, right_assets_pass) {
  const Scratch scratch;
  std::vector<Mesh> meshes = {
      shapes::blob(5, 1),         shapes::torus(90, 40),   shapes::grid(70, 50),
      shapes::terrain(64, 64, 2), shapes::moebius(300, 8), shapes::fan(2000),
      shapes::soup(2000, 3),      shapes::tetrahedra(600), Mesh{}};
  Mesh degenerate = shapes::grid(3, 3);
  for (Vec3& p : degenerate.positions) p = {1, 2, 3};
  meshes.push_back(degenerate);
  for (const Mesh& mesh : meshes) {
    lod::VerifyReport whole, paged;
    ASSERT_TRUE(
        verify_both(scratch, lod::build(mesh.view(), lod::testing::small_config()), whole, paged));
    EXPECT_TRUE(whole.ok) << all_problems(whole);
    EXPECT_TRUE(paged.ok) << all_problems(paged);
    EXPECT_EQ(paged.cuts, 16u);
  }
}

TEST(VerifyWithin, scenes_of_several_meshes_pass) {
  const Scratch scratch;
  const Dag blob = lod::build(shapes::blob(4, 1).view(), lod::testing::small_config());
  const Dag grid = lod::build(shapes::grid(40, 30).view(), lod::testing::small_config());
  AssetContents contents;
  contents.meshes = {&blob, &grid, &blob};
  write_asset(scratch / "a.umbel", contents);
  const auto report = verify_asset_within(kMemory, scratch / "a.umbel", 8);
  EXPECT_TRUE(report.ok) << all_problems(report);
  EXPECT_EQ(report.cuts, verify_asset(scratch / "a.umbel", 8).cuts);
}

TEST(VerifyWithin, finds_every_kind_of_damage) {
  using Damage = std::function<void(Specimen&)>;
  const std::pair<const char*, Damage> kinds[] = {
      {"a triangle of level 0 dropped", [](Specimen& s) { s.drop_last_triangle(0); }},
      {"a triangle of level 0 turned over", [](Specimen& s) { s.turn_over(0); }},
      {"a coarse triangle dropped", [](Specimen& s) { s.drop_last_triangle(s.coarse_cluster()); }},
      {"a coarse triangle turned over", [](Specimen& s) { s.turn_over(s.coarse_cluster()); }},
      {"two coincident triangles too many", [](Specimen& s) { s.add_pair(s.coarse_cluster()); }},
      {"a lowered error",
       [](Specimen& s) {
         s.dag.tables.groups[s.middle_group()].error = 0;
         s.rebuild_hierarchy();
       }},
      {"a lowered error that the hierarchy does not have",
       [](Specimen& s) { s.dag.tables.groups[s.middle_group()].error = 0; }},
      {"a shrunk sphere",
       [](Specimen& s) {
         s.dag.tables.groups[s.middle_group()].sphere.radius *= 0.5f;
         s.rebuild_hierarchy();
       }},
      {"a shrunk sphere of level 0",
       [](Specimen& s) {
         s.dag.tables.groups[0].sphere.radius *= 0.5f;
         s.rebuild_hierarchy();
       }},
      {"a flipped root flag",
       [](Specimen& s) {
         s.dag.tables.groups[s.middle_group()].method = lod::SimplifyMethod::kRoot;
       }},
      {"a root that lost its flag",
       [](Specimen& s) { s.dag.tables.groups.back().method = lod::SimplifyMethod::kRegular; }},
      {"no root",
       [](Specimen& s) {
         s.dag.tables.groups.back().method = lod::SimplifyMethod::kRegular;
         s.dag.tables.groups.back().error = 1e3f;
         s.rebuild_hierarchy();
       }},
      {"a wrong level", [](Specimen& s) { s.dag.tables.groups[s.middle_group()].level = 0; }},
      {"a wrong generating group",
       [](Specimen& s) {
         uint32_t& from = s.dag.tables.clusters[s.coarse_cluster()].generating_group;
         from = from == 0 ? 1 : 0;
       }},
      {"a vertex moved far", [](Specimen& s) { s.move_vertex(s.coarse_cluster(), 3); }},
      {"a cluster over a limit", [](Specimen& s) { s.dag.config.max_triangles = 31; }},
      {"a hierarchy that hides groups",
       [](Specimen& s) {
         for (lod::Node& node : s.dag.tables.nodes)
           if (node.group == kNone && std::isfinite(node.error)) {
             node.sphere.radius *= 0.1f;
             return;
           }
       }},
      {"a group outside the hierarchy",
       [](Specimen& s) {
         for (lod::Node& node : s.dag.tables.nodes)
           if (node.group == 1) node.group = 0;
       }},
      {"another source", [](Specimen& s) { ++s.dag.source_digest; }},
  };
  const Scratch scratch;
  for (const auto& [name, damage] : kinds) {
    SCOPED_TRACE(name);
    Specimen specimen;
    damage(specimen);
    lod::VerifyReport whole, paged;
    ASSERT_TRUE(verify_both(scratch, specimen.dag, whole, paged));
    EXPECT_FALSE(whole.ok);
    EXPECT_FALSE(paged.ok);
    EXPECT_FALSE(paged.problems.empty());
    EXPECT_EQ(paged.monotone, whole.monotone) << all_problems(paged);
    EXPECT_EQ(paged.limit_violations > 0, whole.limit_violations > 0) << all_problems(paged);
    // Cuts are wrong, too, where errors shrink, but windows need not show it.
    if (whole.monotone)
      EXPECT_EQ(paged.cracks + paged.overlaps > 0, whole.cracks + whole.overlaps > 0)
          << all_problems(paged);
    EXPECT_EQ(paged.checksum_errors, whole.checksum_errors) << all_problems(paged);
  }
}

TEST(VerifyWithin, finds_random_damage_that_tables_find) {
  const Scratch scratch;
  Random random(9);
  const Specimen whole_specimens[] = {Specimen(), Specimen(shapes::terrain(40, 40, 2)),
                                      Specimen(shapes::soup(800, 3))};
  size_t found = 0;
  for (int i = 0; i < 150; ++i) {
    Specimen s = whole_specimens[i % 3];
    const uint32_t cluster = random.below(uint32_t(s.dag.tables.clusters.size()));
    const uint32_t group = random.below(uint32_t(s.dag.tables.groups.size()));
    switch (random.below(6)) {
      case 0:
        s.turn_over(cluster);
        break;
      case 1:
        s.move_vertex(cluster, 1e-3f);
        break;
      case 2:
        if (s.dag.tables.clusters[cluster].triangle_count > 1) s.drop_last_triangle(cluster);
        break;
      case 3:
        s.dag.cluster_vertices[s.dag.vertex_offsets[cluster]] =
            random.below(uint32_t(s.dag.vertices.positions.size()));
        break;
      case 4:
        s.dag.tables.groups[group].sphere.radius *= 0.9f;
        break;
      default:
        s.dag.tables.groups[group].error *= 0.9f;
    }
    lod::VerifyReport whole, paged;
    if (!verify_both(scratch, s.dag, whole, paged)) continue;
    found += !whole.ok;
    EXPECT_EQ(paged.ok, whole.ok) << i << "\nwhole:\n"
                                  << all_problems(whole) << "paged:\n"
                                  << all_problems(paged);
  }
  EXPECT_GT(found, 75u);
}

TEST(VerifyWithin, finds_damaged_files) {
  const Scratch scratch;
  write_asset(scratch / "a.umbel", Specimen().dag);
  std::vector<char> bytes = testing::read_bytes(scratch / "a.umbel");
  bytes[5000] ^= 4;
  testing::write_bytes(scratch / "a.umbel", bytes);
  const auto report = verify_asset_within(kMemory, scratch / "a.umbel", 4);
  EXPECT_EQ(report.checksum_errors, 1u);
  EXPECT_NE(all_problems(report).find("checksum of page 0"), std::string::npos);
  testing::write_bytes(scratch / "b.umbel", {'p', 'l', 'y'});
  EXPECT_EQ(verify_asset_within(kMemory, scratch / "b.umbel").checksum_errors, 1u);
}

TEST(VerifyWithin, counts_edges_in_parts_where_memory_is_small) {
  // A soup has twice as many edges as a closed surface, so that the first table overflows.
  const Scratch scratch;
  for (const Mesh& mesh : {shapes::blob(7, 1), shapes::soup(200000, 3)}) {
    write_asset(scratch / "a.umbel", lod::build(mesh.view()));
    const auto report = verify_asset_within(uint64_t{66} << 20, scratch / "a.umbel", 2);
    EXPECT_TRUE(report.ok) << all_problems(report);
  }
}

TEST(VerifyWithin, says_how_much_memory_would_do) {
  const Scratch scratch;
  write_asset(scratch / "a.umbel", Specimen().dag);
  try {
    verify_asset_within(1000, scratch / "a.umbel");
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    EXPECT_NE(std::string(error.what()).find("at least"), std::string::npos) << error.what();
  }
}

TEST(VerifyWithin, does_not_depend_on_threads) {
  const Scratch scratch;
  Specimen specimen(shapes::terrain(60, 60, 2));
  specimen.drop_last_triangle(specimen.coarse_cluster());
  write_asset(scratch / "a.umbel", specimen.dag);
  BuildOptions options;
  options.threads = 1;
  const auto one = verify_asset_within(kMemory, scratch / "a.umbel", 16, 1, options);
  options.threads = 3;
  const auto many = verify_asset_within(kMemory, scratch / "a.umbel", 16, 1, options);
  EXPECT_FALSE(one.ok);
  EXPECT_EQ(one.problems, many.problems);
  EXPECT_EQ(one.cracks, many.cracks);
}

}  // namespace
}  // namespace umbel
