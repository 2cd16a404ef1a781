// Connections count in nodes of any size, also in those that are split by cells of a grid.
#include <gtest/gtest.h>

#include "cluster/cluster_cases.hpp"

namespace umbel {
namespace {

using namespace cluster_cases;

// Boxes in a row, each connected to the next, but for free cuts after every `run`.
Items chain(uint32_t count, uint32_t run) {
  Items items;
  for (uint32_t i = 0; i < count; ++i) {
    items.boxes.push_back({{float(i), 0, 0}, {float(i) + 1, 1, 1}});
    const auto first = uint32_t(items.targets.size());
    const auto connect = [&](uint32_t to, bool free) {
      items.targets.push_back(to);
      items.weights.push_back(free ? 0.0f : 1000.0f);
    };
    if (i > 0) connect(i - 1, i % run == 0);
    if (i + 1 < count) connect(i + 1, (i + 1) % run == 0);
    items.ranges.push_back({first, uint32_t(items.targets.size()) - first});
  }
  return items;
}

TEST(CellConnections, a_chain_of_a_million_items_is_cut_where_it_costs_nothing) {
  const Items items = chain(101 * 9901, 101);
  const Clusters made = checked(items, cluster_preset("quality", 128));
  for (const Range& range : made.ranges) {
    uint32_t low = kNone, high = 0;
    for (uint32_t i = range.offset; i < range.offset + range.count; ++i) {
      low = std::min(low, made.items[i]);
      high = std::max(high, made.items[i]);
    }
    EXPECT_EQ(low % 101, 0u);
    EXPECT_EQ(high % 101, 100u);
  }
}

// Columns along z that are a little longer than the field is wide, so that areas alone would cut
// them; two more vertices a box make sheets of constant x.
struct Field {
  static constexpr uint32_t kSide = 64;
  Items items;

  explicit Field(float length) {
    for (uint32_t z = 0; z < kSide; ++z)
      for (uint32_t y = 0; y < kSide; ++y)
        for (uint32_t x = 0; x < kSide; ++x) {
          const Vec3 low{float(x), float(y), length * float(z)};
          items.boxes.push_back({low, low + Vec3{1, 1, length}});
        }
  }
  static uint32_t number(uint32_t x, uint32_t y, uint32_t z) { return (z * kSide + y) * kSide + x; }

  void connect_along_z(float weight) {
    for (uint32_t z = 0; z < kSide; ++z)
      for (uint32_t i = 0; i < kSide * kSide; ++i) {
        const auto first = uint32_t(items.targets.size());
        if (z > 0) items.targets.push_back((z - 1) * kSide * kSide + i);
        if (z + 1 < kSide) items.targets.push_back((z + 1) * kSide * kSide + i);
        items.ranges.push_back({first, uint32_t(items.targets.size()) - first});
      }
    items.weights.assign(items.targets.size(), weight);
  }
  // The vertices of a box are those of its ends, and one of its own.
  void share_vertices_along_z() {
    for (uint32_t z = 0; z < kSide; ++z)
      for (uint32_t i = 0; i < kSide * kSide; ++i) {
        const uint32_t n = kSide * kSide;
        items.vertices.insert(items.vertices.end(),
                              {z * n + i, (z + 1) * n + i, (kSide + 1 + z) * n + i});
      }
  }
  // Two halves: whether each has whole columns.
  static bool keeps_columns(const Clusters& halves) {
    EXPECT_EQ(halves.ranges.size(), 2u);
    std::vector<uint8_t> half(kSide * kSide * kSide);
    for (uint32_t i = 0; i < halves.ranges[1].count; ++i)
      half[halves.items[halves.ranges[1].offset + i]] = 1;
    for (uint32_t i = 0; i < half.size(); ++i)
      if (half[i] != half[i % (kSide * kSide)]) return false;
    return true;
  }
};

TEST(CellConnections, the_largest_nodes_are_split_across_few_connections) {
  constexpr uint32_t kHalf = Field::kSide * Field::kSide * Field::kSide / 2;
  const ClusterConfig halves = limits(kHalf, kHalf);
  Field field(1.2f);
  EXPECT_FALSE(Field::keeps_columns(checked(field.items, halves)));
  field.connect_along_z(20.0f);
  EXPECT_TRUE(Field::keeps_columns(checked(field.items, halves)));
}

TEST(CellConnections, the_largest_nodes_are_split_across_few_shared_vertices) {
  constexpr uint32_t kHalf = Field::kSide * Field::kSide * Field::kSide / 2;
  const ClusterConfig halves = limits(kHalf, kHalf);
  Field field(1.2f);
  field.share_vertices_along_z();
  ClusterInput input = field.items.input();
  EXPECT_FALSE(Field::keeps_columns(build_clusters(input, halves)));
  input.shared_vertex_weight = 20.0f;
  EXPECT_TRUE(Field::keeps_columns(build_clusters(input, halves)));
}

TEST(CellConnections, clusters_do_not_depend_on_threads_or_on_the_order_of_crowded_items) {
  Items items = chain(150000, 101);
  // A crowd in one cell gets a grid of its own, whose items are connected to the others'.
  for (uint32_t i = 0; i < 80000; ++i) {
    const uint32_t row = i / 400;
    const float x = 7e4f + 1e-3f * float(i % 400), y = 1e-3f * float(row);
    items.boxes.push_back({{x, y, 0}, {x + 1e-3f, y + 1e-3f, 1}});
    items.ranges.push_back({uint32_t(items.targets.size()), 1});
    items.targets.push_back(i);
    items.weights.push_back(5.0f);
  }
  const Clusters one = checked(items, limits(32, 128), 1);
  EXPECT_TRUE(same(one, checked(items, limits(32, 128), 4)));
}

}  // namespace
}  // namespace umbel
