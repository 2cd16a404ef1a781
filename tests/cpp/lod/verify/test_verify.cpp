#include <gtest/gtest.h>

#include "lod/specimen.hpp"

namespace umbel::lod {
namespace {

using testing::Random;

/// A right DAG of several levels, to be damaged.
struct Specimen : testing::Specimen {
  VerifyReport report(uint32_t threads = 0) const {
    BuildOptions options;
    options.threads = threads;
    return verify(dag.tables, testing::reader_of(dag), testing::verify_config_of(dag, mesh),
                  options);
  }
};

bool names(const VerifyReport& report, const std::string& what) {
  for (const std::string& problem : report.problems)
    if (problem.find(what) != std::string::npos) return true;
  return false;
}

std::string all_problems(const VerifyReport& report) {
  std::string all;
  for (const std::string& problem : report.problems) all += problem + "\n";
  return all;
}

void expect_named(const VerifyReport& report, const std::string& what) {
  EXPECT_FALSE(report.ok);
  EXPECT_TRUE(names(report, what)) << "looked for: " << what << "\n" << all_problems(report);
}

TEST(Verify, right_dags_pass) {
  for (const Mesh& mesh : {shapes::blob(5, 1), shapes::torus(90, 40), shapes::grid(70, 50),
                           shapes::terrain(64, 64, 2), shapes::moebius(300, 8), shapes::fan(2000),
                           shapes::soup(2000, 3), shapes::tetrahedra(600), Mesh{}}) {
    const Dag dag = build(mesh.view(), testing::small_config());
    const VerifyReport report =
        verify(dag.tables, testing::reader_of(dag), testing::verify_config_of(dag, mesh, 64));
    EXPECT_TRUE(report.ok) << all_problems(report);
    EXPECT_TRUE(report.monotone);
    EXPECT_EQ(report.cuts, 64u);
    EXPECT_EQ(report.cracks + report.overlaps + report.limit_violations, 0u);
  }
}

TEST(Verify, a_triangle_dropped_at_level_0_is_named) {
  Specimen specimen;
  specimen.drop_last_triangle(0);
  const VerifyReport report = specimen.report();
  expect_named(report, "Level 0 has 5119 triangles, but the source has 5120");
}

TEST(Verify, a_triangle_of_level_0_turned_over_is_named) {
  Specimen specimen;
  specimen.turn_over(0);
  expect_named(specimen.report(), "digests differ");
}

TEST(Verify, a_triangle_dropped_at_a_coarser_level_is_named) {
  Specimen specimen;
  const uint32_t cluster = specimen.coarse_cluster();
  const uint32_t from = specimen.dag.tables.clusters[cluster].generating_group;
  specimen.drop_last_triangle(cluster);
  const VerifyReport report = specimen.report();
  EXPECT_GT(report.cracks, 0u);
  expect_named(report, "Group " + std::to_string(from) + " of level");
  expect_named(report, "does not keep its border");
  expect_named(report, "is open at the edge from (");
}

TEST(Verify, a_triangle_that_is_there_twice_is_named) {
  Specimen specimen;
  Dag& dag = specimen.dag;
  const uint32_t c = specimen.coarse_cluster();
  ASSERT_GE(dag.tables.clusters[c].triangle_count, 2u);
  const size_t first = size_t{3} * dag.triangle_offsets[c];
  std::copy_n(dag.cluster_triangles.begin() + first, 3, dag.cluster_triangles.begin() + first + 3);
  const VerifyReport report = specimen.report();
  EXPECT_GT(report.cracks, 0u);
  EXPECT_FALSE(report.ok);
}

TEST(Verify, two_coincident_triangles_too_many_are_overlaps) {
  Specimen specimen;
  specimen.add_pair(specimen.coarse_cluster());
  const VerifyReport report = specimen.report();
  EXPECT_GT(report.overlaps, 0u);
  EXPECT_EQ(report.cracks, 0u);
  expect_named(report, "more than two triangles at the edge");
}

TEST(Verify, a_coarse_triangle_turned_over_is_named) {
  Specimen specimen;
  specimen.turn_over(specimen.coarse_cluster());
  expect_named(specimen.report(), "does not keep its border");
}

TEST(Verify, a_lowered_error_is_named) {
  Specimen specimen;
  const uint32_t g = specimen.middle_group();
  specimen.dag.tables.groups[g].error = 0;
  const VerifyReport report = specimen.report();
  EXPECT_FALSE(report.monotone);
  expect_named(report, "Group " + std::to_string(g) + " has the error 0, less than");
}

TEST(Verify, a_lowered_error_is_named_even_if_the_hierarchy_agrees) {
  Specimen specimen;
  const uint32_t g = specimen.middle_group();
  specimen.dag.tables.groups[g].error = 0;
  specimen.dag.tables.nodes = build_hierarchy(specimen.dag.tables);
  const VerifyReport report = specimen.report();
  EXPECT_FALSE(report.monotone);
  EXPECT_EQ(report.limit_violations, 0u);
  expect_named(report, "Group " + std::to_string(g) + " has the error 0, less than");
}

TEST(Verify, a_shrunk_sphere_is_named) {
  for (const uint32_t level : {0u, 1u}) {
    Specimen specimen;
    const uint32_t g = level == 0 ? 0 : specimen.middle_group();
    specimen.dag.tables.groups[g].sphere.radius *= 0.5f;
    specimen.dag.tables.nodes = build_hierarchy(specimen.dag.tables);
    const VerifyReport report = specimen.report();
    EXPECT_FALSE(report.monotone);
    expect_named(report, "Group " + std::to_string(g) + " has the sphere of radius");
  }
}

TEST(Verify, a_flipped_root_flag_is_named) {
  Specimen specimen;
  const uint32_t g = specimen.middle_group();
  specimen.dag.tables.groups[g].method = SimplifyMethod::kRoot;
  expect_named(specimen.report(),
               "Group " + std::to_string(g) + " has the simplification method 4");
  expect_named(specimen.report(), "is a root and so was never simplified");
}

TEST(Verify, a_root_that_lost_its_flag_is_named) {
  Specimen specimen;
  const uint32_t g = static_cast<uint32_t>(specimen.dag.tables.groups.size()) - 1;
  specimen.dag.tables.groups[g].method = SimplifyMethod::kRegular;
  expect_named(specimen.report(),
               "Group " + std::to_string(g) + " has the simplification method 0");
}

TEST(Verify, a_root_with_a_finite_error_and_no_flag_is_named) {
  Specimen specimen;
  Group& root = specimen.dag.tables.groups.back();
  ASSERT_EQ(root.method, SimplifyMethod::kRoot);
  root.method = SimplifyMethod::kRegular;
  root.error = 1e3f;
  specimen.dag.tables.nodes = build_hierarchy(specimen.dag.tables);
  // It now claims to have been simplified to nothing.
  expect_named(specimen.report(), "is empty, though the source is not");
}

TEST(Verify, a_cluster_moved_to_another_group_is_named) {
  Specimen specimen;
  specimen.dag.tables.clusters[0].group = 1;
  expect_named(specimen.report(), "Cluster 0 says group 1 but is in the range of group 0");
}

TEST(Verify, a_generating_group_that_is_wrong_is_named) {
  Specimen specimen;
  const uint32_t c = specimen.coarse_cluster();
  uint32_t& from = specimen.dag.tables.clusters[c].generating_group;
  from = from == 0 ? 1 : 0;
  const VerifyReport report = specimen.report();
  EXPECT_GT(report.cracks + report.limit_violations, 0u);
  expect_named(report, "Group");
  from = static_cast<uint32_t>(specimen.dag.tables.groups.size());
  expect_named(specimen.report(), "Cluster " + std::to_string(c) + " has generating group");
}

TEST(Verify, a_moved_vertex_is_named) {
  Specimen specimen;
  const uint32_t c = specimen.coarse_cluster();
  specimen.move_vertex(c, 3);  // out of the sphere of the group that the cluster was made from
  expect_named(specimen.report(), "Cluster " + std::to_string(c) + " has a vertex at (");
}

TEST(Verify, clusters_over_a_limit_are_named) {
  const Specimen specimen;
  VerifyConfig config = testing::verify_config_of(specimen.dag, specimen.mesh, 2);
  config.max_triangles = 31;
  config.max_vertices = 15;
  const VerifyReport report = verify(specimen.dag.tables, testing::reader_of(specimen.dag), config);
  EXPECT_GT(report.limit_violations, 0u);
  expect_named(report, "triangles, more than the limit of 31");
  expect_named(report, "vertices, more than the limit of 15");
}

TEST(Verify, counts_that_are_not_the_geometry_are_named) {
  Specimen specimen;
  specimen.dag.tables.clusters[3].vertex_count += 1;
  specimen.dag.tables.clusters[4].triangle_count += 1;
  const VerifyReport report = specimen.report();
  expect_named(report, "Cluster 3 has");
  expect_named(report, "Cluster 4 has");
  EXPECT_EQ(report.limit_violations, 2u);
}

TEST(Verify, an_index_out_of_range_is_named) {
  Specimen specimen;
  specimen.dag.cluster_triangles[4] = 255;
  expect_named(specimen.report(), "Cluster 0 has the vertex index 255 in its triangle 1");
}

TEST(Verify, a_position_that_is_no_number_is_named) {
  Specimen specimen;
  specimen.dag.vertices.positions[0].y = std::numeric_limits<float>::quiet_NaN();
  expect_named(specimen.report(), "impossible position");
}

TEST(Verify, a_box_too_small_is_named) {
  Specimen specimen;
  Aabb& box = specimen.dag.tables.clusters[2].box;
  box.max.x = box.min.x;
  expect_named(specimen.report(), "Cluster 2 has a vertex at");
}

TEST(Verify, a_cluster_that_cannot_be_read_is_named) {
  const Specimen specimen;
  const GeometryReader reader = [&](uint32_t c) {
    if (c == 5) throw Error(ErrorCode::kCorrupt, "page 1 is torn");
    return specimen.dag.geometry(c);
  };
  const VerifyReport report =
      verify(specimen.dag.tables, reader, testing::verify_config_of(specimen.dag, specimen.mesh));
  expect_named(report, "Cluster 5 cannot be read: page 1 is torn");
}

TEST(Verify, a_hierarchy_that_hides_a_group_is_named) {
  Specimen specimen;
  for (Node& node : specimen.dag.tables.nodes) {
    if (node.group != kNone) continue;
    const Node right = node;
    node.sphere.radius *= 0.1f;
    if (&node == specimen.dag.tables.nodes.data()) {
      node = right;  // infinite error: its sphere does not matter
      continue;
    }
    const VerifyReport report = specimen.report();
    if (!std::isinf(node.error)) {
      expect_named(report, "of the hierarchy has the sphere");
      return;
    }
    node = right;
  }
  FAIL() << "no inner node with a finite error";
}

TEST(Verify, a_group_outside_the_hierarchy_is_named) {
  Specimen specimen;
  for (Node& node : specimen.dag.tables.nodes)
    if (node.group == 1) node.group = 0;
  expect_named(specimen.report(), "Group 1 is no leaf of the hierarchy");
}

TEST(Verify, threads_and_runs_do_not_matter) {
  Specimen specimen;
  specimen.drop_last_triangle(specimen.coarse_cluster());
  const VerifyReport one = specimen.report(1);
  for (const uint32_t threads : {1u, 2u, 8u}) {
    const VerifyReport many = specimen.report(threads);
    EXPECT_EQ(one.problems, many.problems);
    EXPECT_EQ(one.cracks, many.cracks);
    EXPECT_EQ(one.overlaps, many.overlaps);
  }
}

TEST(Verify, progress_rises_and_can_cancel) {
  const Specimen specimen;
  const VerifyConfig config = testing::verify_config_of(specimen.dag, specimen.mesh);
  std::vector<float> fractions;
  BuildOptions options;
  options.progress = [&](float fraction, std::string_view) {
    fractions.push_back(fraction);
    return true;
  };
  verify(specimen.dag.tables, testing::reader_of(specimen.dag), config, options);
  EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
  EXPECT_EQ(fractions.back(), 1.0f);
  for (size_t stop = 0; stop < fractions.size(); ++stop) {
    size_t calls = 0;
    options.progress = [&](float, std::string_view) { return calls++ < stop; };
    EXPECT_THROW(verify(specimen.dag.tables, testing::reader_of(specimen.dag), config, options),
                 Error);
  }
}

TEST(Verify, tables_of_random_bytes_never_crash) {
  const Specimen specimen;
  Random random(6);
  const auto damage = [&](auto& elements, Dag& dag) {
    auto& element = elements[random.below(static_cast<uint32_t>(elements.size()))];
    auto* words = reinterpret_cast<uint32_t*>(&element);
    uint32_t& word = words[random.below(sizeof(element) / 4)];
    const uint32_t values[] = {word ^ (1u << random.below(32)),
                               0,
                               kNone,
                               word + 1,
                               0x7fc00000,
                               static_cast<uint32_t>(dag.tables.groups.size())};
    word = values[random.below(6)];
  };
  size_t found = 0;
  for (int i = 0; i < 400; ++i) {
    Specimen copy = specimen;
    Tables& tables = copy.dag.tables;
    switch (random.below(4)) {
      case 0:
        damage(tables.levels, copy.dag);
        break;
      case 1:
        damage(tables.groups, copy.dag);
        break;
      case 2:
        damage(tables.clusters, copy.dag);
        break;
      default:
        damage(tables.nodes, copy.dag);
    }
    const VerifyReport report = verify(tables, testing::reader_of(copy.dag),
                                       testing::verify_config_of(copy.dag, copy.mesh, 4));
    found += !report.ok;
    EXPECT_EQ(report.ok, report.problems.empty());
    EXPECT_LE(report.problems.size(), 32u);
  }
  // What is left grew a sphere or an error within what its neighbours allow, or changed nothing.
  EXPECT_GT(found, 250u);
}

}  // namespace
}  // namespace umbel::lod
