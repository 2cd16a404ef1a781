#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "lod/synthetic_dag.hpp"
#include "lod/verify/table_structure.hpp"

namespace umbel::lod {
namespace {

std::string fault_after(const std::function<void(Tables&)>& damage) {
  Tables tables = testing::random_tables(1, 9, {});
  EXPECT_EQ(structure_fault(tables), "");
  damage(tables);
  return structure_fault(tables);
}

TEST(TableStructure, tables_without_anything_are_sound) { EXPECT_EQ(structure_fault({}), ""); }

TEST(TableStructure, ranges_and_links_stay_within_their_tables) {
  EXPECT_EQ(fault_after([](Tables& t) { t.levels[0].count = 1000; }).substr(0, 7), "level 0");
  EXPECT_EQ(fault_after([](Tables& t) { t.groups[2].clusters.offset = kNone; }).substr(0, 7),
            "group 2");
  EXPECT_EQ(fault_after([](Tables& t) { t.clusters[3].group = 1000; }).substr(0, 9), "cluster 3");
  EXPECT_EQ(fault_after([](Tables& t) { t.clusters[4].generating_group = 1000; }).substr(0, 9),
            "cluster 4");
  EXPECT_EQ(fault_after([](Tables& t) { t.nodes[0].children.count = 1000; }).substr(0, 6),
            "node 0");
  EXPECT_EQ(fault_after([](Tables& t) { t.nodes[0].group = 1000; }).substr(0, 6), "node 0");
}

TEST(TableStructure, every_cluster_is_in_one_group) {
  EXPECT_EQ(fault_after([](Tables& t) { --t.groups[1].clusters.offset; }),
            "cluster 1 is in the cluster ranges of two groups");
  EXPECT_EQ(fault_after([](Tables& t) { --t.groups[0].clusters.count; }),
            "cluster 1 is in no group's cluster range");
}

TEST(TableStructure, methods_are_known) {
  EXPECT_NE(fault_after([](Tables& t) { t.groups[0].method = static_cast<SimplifyMethod>(9); }),
            "");
}

TEST(TableStructure, nodes_are_a_tree) {
  EXPECT_EQ(fault_after([](Tables& t) { t.nodes[0].children = {0, 1}; }),
            "node 0 has the root as a child");
  EXPECT_NE(fault_after([](Tables& t) {
              t.nodes.push_back(t.nodes[0]);  // the same children again
            }).find("has two parents"),
            std::string::npos);
}

}  // namespace
}  // namespace umbel::lod
