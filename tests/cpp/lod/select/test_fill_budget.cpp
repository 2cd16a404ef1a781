// Cuts that fill a budget.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "lod/synthetic_dag.hpp"

namespace umbel::lod {
namespace {

using testing::Random;

const Mesh& blob() {
  static const Mesh mesh = shapes::blob(5, 8);
  return mesh;
}

const Dag& blob_dag() {
  static const Dag dag = build(blob().view(), testing::small_config());
  return dag;
}

uint64_t sum(std::span<const uint32_t> costs, std::span<const uint32_t> cut) {
  uint64_t total = 0;
  for (const uint32_t c : cut) total += costs[c];
  return total;
}

size_t groups_in(const Tables& tables, std::span<const uint32_t> cut) {
  std::set<uint32_t> groups;
  for (const uint32_t c : cut) groups.insert(tables.clusters[c].group);
  return groups.size();
}

// A closed surface: every edge has two triangles.
void expect_closed(const Dag& dag, std::span<const uint32_t> cut) {
  const Mesh mesh = mesh_of_cut(dag.tables, testing::reader_of(dag), cut);
  std::map<std::pair<uint32_t, uint32_t>, int> edges;
  for (const Triangle& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) ++edges[std::minmax(t[k], t[(k + 1) % 3])];
  for (const auto& [edge, triangles] : edges) ASSERT_EQ(triangles, 2);
}

// The groups that are refined, as the cut shows: those with a cluster in it, and all above.
std::set<uint32_t> refined(const Tables& tables, std::span<const uint32_t> cut) {
  std::set<uint32_t> groups;
  for (const uint32_t c : cut) groups.insert(tables.clusters[c].group);
  for (uint32_t c = 0; c < tables.clusters.size(); ++c)
    if (tables.clusters[c].generating_group != kNone &&
        groups.count(tables.clusters[c].generating_group))
      groups.insert(tables.clusters[c].group);
  return groups;
}

TEST(FillBudget, cuts_fit_are_whole_and_are_never_coarser_than_the_view) {
  const Tables& tables = blob_dag().tables;
  const std::vector<uint32_t> costs = triangle_costs(tables);
  size_t fuller = 0;
  for (uint64_t budget = 40; budget < 21000; budget = budget * 5 / 4) {
    const BudgetCuts made = select_for_budget(tables, view_error(0), costs, budget);
    const std::vector<uint32_t>& cut = made.cuts.clusters;
    EXPECT_EQ(made.cuts.offsets, (std::vector<uint32_t>{0, uint32_t(cut.size())}));
    EXPECT_TRUE(std::ranges::is_sorted(cut));
    EXPECT_EQ(made.cost, sum(costs, cut));
    EXPECT_LE(made.cost, budget);
    expect_closed(blob_dag(), cut);
    const std::vector<uint32_t> plain = select(tables, made.view);
    EXPECT_GE(made.cost, sum(costs, plain));
    EXPECT_LE(cut_error(tables, cut), made.view.error);
    fuller += made.cost > sum(costs, plain);
  }
  EXPECT_GT(fuller, 3u);
}

// Where one group is all that is left, the cuts are some seven tenths of each other.
TEST(FillBudget, small_budgets_are_filled_where_one_group_is_left) {
  const Tables& tables = blob_dag().tables;
  const std::vector<uint32_t> costs = triangle_costs(tables);
  std::map<uint32_t, int> groups;
  std::map<uint32_t, uint64_t> triangles;
  for (const Group& group : tables.groups) ++groups[group.level];
  for (uint32_t c = 0; c < tables.clusters.size(); ++c)
    triangles[tables.groups[tables.clusters[c].group].level] += costs[c];
  uint64_t finer = 0;
  int steps = 0;
  for (const auto& [level, count] : triangles) {
    if (level > 6 && groups[level] == 1 && groups[level - 1] == 1) {
      EXPECT_GE(count, finer * 0.6) << "level " << level;
      EXPECT_LE(count, finer * 0.8) << "level " << level;
      ++steps;
    }
    finer = count;
  }
  EXPECT_GE(steps, 3);
}

// No group that may be refined is so cheap that it would still fit.
TEST(FillBudget, nothing_that_fits_is_left) {
  const Tables& tables = blob_dag().tables;
  const std::vector<uint32_t> costs = triangle_costs(tables);
  for (const uint64_t budget : {300ull, 1000ull, 3000ull, 9000ull}) {
    const BudgetCuts made = select_for_budget(tables, view_error(0), costs, budget);
    const std::set<uint32_t> open = refined(tables, made.cuts.clusters);
    for (uint32_t g = 0; g < tables.groups.size(); ++g) {
      if (open.count(g) || tables.groups[g].error == 0) continue;
      int64_t price = 0;
      bool next = true;
      for (uint32_t c = 0; c < tables.clusters.size(); ++c) {
        if (tables.clusters[c].group == g) price += costs[c];
        if (tables.clusters[c].generating_group != g) continue;
        next &= open.count(tables.clusters[c].group) > 0;
        price -= costs[c];
      }
      if (next) EXPECT_GT(price + int64_t(made.cost), int64_t(budget)) << g;
    }
  }
}

// Nor where a budget of groups is used up, but another group takes the place of one.
TEST(FillBudget, nothing_that_fits_is_left_of_a_budget_of_groups) {
  const Tables& tables = blob_dag().tables;
  const std::vector<uint32_t> one_a_group(tables.groups.size(), 1);
  for (uint64_t budget = 1; budget < 100; budget += 3) {
    const BudgetCuts made =
        select_for_budget(tables, view_error(0), Costs({}, one_a_group), budget);
    const std::set<uint32_t> open = refined(tables, made.cuts.clusters);
    std::map<uint32_t, std::set<uint32_t>> above;
    for (const Cluster& cluster : tables.clusters)
      above[cluster.generating_group].insert(cluster.group);
    for (uint32_t g = 0; g < tables.groups.size(); ++g) {
      if (open.count(g) || tables.groups[g].error == 0 || !std::ranges::includes(open, above[g]))
        continue;
      std::set<uint32_t> drawn;
      for (const Cluster& cluster : tables.clusters) {
        const auto is_open = [&](uint32_t group) { return group == g || open.count(group) > 0; };
        if (is_open(cluster.group) && !is_open(cluster.generating_group))
          drawn.insert(cluster.group);
      }
      EXPECT_GT(drawn.size(), budget) << g;
    }
  }
}

// Every threshold refines the groups whose spheres have the eye inside.
TEST(FillBudget, an_eye_inside_keeps_the_budget) {
  const Tables& tables = blob_dag().tables;
  const std::vector<uint32_t> costs = triangle_costs(tables);
  const auto cones = normal_cone_bounds(tables, testing::reader_of(blob_dag()));
  const View inside = view_camera({0.1f, 0.2f, 0.9f}, 1.0f, 1080, 1.0f);
  View large = inside;
  large.threshold = 1e30f;
  const uint64_t by_threshold = sum(costs, select(tables, large));
  const uint64_t coarsest =
      sum(costs, select(tables, view_error(std::numeric_limits<float>::infinity())));
  ASSERT_GT(by_threshold, 2 * coarsest);
  uint64_t last = 0;
  for (const uint64_t budget : {coarsest, (coarsest + by_threshold) / 2, by_threshold - 1}) {
    const View fits = view_for_budget(tables, inside, costs, budget);
    EXPECT_EQ(sum(costs, select(tables, fits)), coarsest);
    const BudgetCuts made = select_for_budget(tables, inside, costs, budget);
    EXPECT_LE(made.cost, budget);
    EXPECT_EQ(made.cost, sum(costs, made.cuts.clusters));
    EXPECT_GT(made.cost, last);
    last = made.cost;
    expect_closed(blob_dag(), made.cuts.clusters);
    // What faces away costs nothing and is left out.
    const BudgetCuts culled = select_for_budget(tables, inside, costs, budget, {{}, cones});
    EXPECT_LE(culled.cost, budget);
    EXPECT_EQ(culled.cost, sum(costs, culled.cuts.clusters));
    for (const uint32_t c : culled.cuts.clusters) {
      const ClusterBounds& b = cones[c];
      const double x = b.sphere.center.x - 0.1, y = b.sphere.center.y - 0.2,
                   z = b.sphere.center.z - 0.9;
      const double along = x * b.cone_axis.x + y * b.cone_axis.y + z * b.cone_axis.z;
      EXPECT_LT(along,
                (b.cone_cutoff + 1e-4) * std::sqrt(x * x + y * y + z * z) + b.sphere.radius + 1e-4);
    }
  }
  EXPECT_GT(select_for_budget(tables, inside, costs, coarsest - 1).cost, coarsest - 1);
}

TEST(FillBudget, counts_clusters_and_groups) {
  const Tables& tables = blob_dag().tables;
  const std::vector<uint32_t> one_a_cluster(tables.clusters.size(), 1);
  const std::vector<uint32_t> one_a_group(tables.groups.size(), 1);
  Random random(4);
  for (const uint64_t budget : {1ull, 7ull, 50ull, 200ull}) {
    const BudgetCuts clusters = select_for_budget(tables, view_error(0), one_a_cluster, budget);
    EXPECT_LE(clusters.cuts.clusters.size(), std::max<size_t>(budget, 1));
    EXPECT_EQ(clusters.cost, clusters.cuts.clusters.size());
    const BudgetCuts groups =
        select_for_budget(tables, view_error(0), Costs({}, one_a_group), budget);
    EXPECT_LE(groups_in(tables, groups.cuts.clusters), budget);
    EXPECT_EQ(groups.cost, groups_in(tables, groups.cuts.clusters));
    const View view = view_for_budget(tables, view_error(0), Costs({}, one_a_group), budget);
    EXPECT_LE(groups_in(tables, select(tables, view)), budget);
    if (view.error > 0) {
      const View finer = view_error(std::nextafter(view.error, 0.0f));
      EXPECT_GT(groups_in(tables, select(tables, finer)), budget);
    }
  }
}

TEST(FillBudget, instances_planes_and_both_costs) {
  const Tables& tables = blob_dag().tables;
  std::vector<Transform> instances(4);
  for (size_t i = 0; i < instances.size(); ++i) {
    instances[i].rows[3] = 3.0f * static_cast<float>(i);
    instances[i].rows[0] = instances[i].rows[5] = instances[i].rows[10] = 0.5f + 0.3f * i;
  }
  const std::vector<uint32_t> costs = triangle_costs(tables);
  const std::vector<uint32_t> fifty_a_group(tables.groups.size(), 50);
  const Plane plane{{1, 0, 0}, -1};
  const View view = testing::camera({-3, 1, 0}, 1e-7f);
  for (const uint64_t budget : {3000ull, 20000ull, 100000ull}) {
    const BudgetCuts made = select_for_budget(tables, view, {costs, fifty_a_group}, budget,
                                              {{&plane, 1}, {}}, instances);
    ASSERT_EQ(made.cuts.offsets.size(), instances.size() + 1);
    uint64_t cost = 0;
    for (size_t i = 0; i < instances.size(); ++i) {
      const auto cut =
          std::span(made.cuts.clusters)
              .subspan(made.cuts.offsets[i], made.cuts.offsets[i + 1] - made.cuts.offsets[i]);
      cost += sum(costs, cut) + 50 * groups_in(tables, cut);
    }
    EXPECT_EQ(made.cost, cost);
    EXPECT_LE(made.cost, budget);
    EXPECT_GT(made.cost, budget / 2);
  }
}

TEST(FillBudget, a_view_that_is_cheap_enough_is_its_cut) {
  const Tables& tables = blob_dag().tables;
  const View view = view_error(0.02f);
  EXPECT_EQ(select_for_budget(tables, view, triangle_costs(tables), 1u << 30).cuts.clusters,
            select(tables, view));
  EXPECT_EQ(select_for_budget(tables, view_error(0), triangle_costs(tables), 1).cuts.clusters,
            select(tables, view_error(std::numeric_limits<float>::max())));
  EXPECT_TRUE(select_for_budget(Tables{}, view, Costs{}, 5).cuts.clusters.empty());
  EXPECT_THROW(select_for_budget(tables, view_level(1), Costs{}, 5), Error);
  const std::vector<uint32_t> few(3, 1);
  EXPECT_THROW(select_for_budget(tables, view, Costs({}, few), 5), Error);
}

}  // namespace
}  // namespace umbel::lod
