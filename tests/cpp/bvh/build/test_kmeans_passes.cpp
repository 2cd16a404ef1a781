// What the passes of k-means promise to executors other than the processor's: nothing depends on
// the order in which the elements of a loop are done, nor on how many lanes do one of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "base/thread_teams.hpp"
#include "bvh/build/kmeans_passes.hpp"
#include "bvh/build/kmeans_treelets.hpp"
#include "bvh/tree_tests.hpp"

namespace umbel::bvh {
namespace {

/// One thread that does the last element of every loop first.
class BackwardExec {
 public:
  static constexpr bool kSerialTeams = true;

  template <typename T>
  using Buffer = CpuBuffer<T>;

  template <typename T>
  Buffer<T> allocate(size_t size) {
    Buffer<T> buffer(size);
    // Memory that was never written is not zero on other devices either.
    if (size > 0) std::memset(static_cast<void*>(buffer.data()), 0xa5, size * sizeof(T));
    return buffer;
  }
  static constexpr bool counts() { return false; }
  template <typename T>
  T read(const T* value) {
    return *value;
  }
  template <typename Body>
  void for_each(size_t n, const Body& body, size_t /*grain*/ = 1) {
    for (size_t i = n; i-- > 0;) body(i);
  }
  template <typename Body>
  void for_each_team(size_t n, const Body& body) {
    for (size_t i = n; i-- > 0;) {
      const Buffer<typename Body::Shared> shared = allocate<typename Body::Shared>(1);
      body(SerialTeam{}, i, *shared.data());
    }
  }
  template <typename T, typename Map, typename Op>
  void reduce(size_t n, T init, const Map& map, const Op& op, T* result) {
    *result = init;
    for (size_t i = n; i-- > 0;) *result = op(*result, map(i));
  }
  template <typename T, typename In>
  void exclusive_scan(size_t n, const In& in, T* out) {
    out[n] = 0;
    for (size_t i = n; i-- > 0;) out[n] += in(i);
    for (size_t i = n; i-- > 0;) out[i] = out[i + 1] - in(i);
  }
  template <typename Keep>
  void select(size_t n, const Keep& keep, uint32_t* out, uint32_t* count) {
    *count = 0;
    for (size_t i = 0; i < n; ++i)
      if (keep(i)) out[(*count)++] = static_cast<uint32_t>(i);
  }
  template <typename Key>
  void radix_sort_pairs(size_t n, Key* keys, uint32_t* values, uint32_t first_bit,
                        uint32_t last_bit) {
    std::vector<size_t> order(n);
    std::iota(order.begin(), order.end(), size_t{0});
    const Key mask =
        last_bit - first_bit == 8 * sizeof(Key) ? ~Key{0} : (Key{1} << (last_bit - first_bit)) - 1;
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
      return ((keys[a] >> first_bit) & mask) < ((keys[b] >> first_bit) & mask);
    });
    const std::vector<Key> old_keys(keys, keys + n);
    const std::vector<uint32_t> old_values(values, values + n);
    for (size_t i = 0; i < n; ++i) keys[i] = old_keys[order[i]], values[i] = old_values[order[i]];
  }
};

struct Made {
  std::vector<uint32_t> clusters;  ///< offsets, sizes and parts
  std::vector<uint32_t> primitives;
  Bvh2 tree;
};

template <typename Exec>
Made make(const std::vector<Aabb>& boxes, const KmeansConfig& config) {
  Exec exec;
  const auto n = static_cast<uint32_t>(boxes.size());
  KmeansPasses<Exec> passes(exec, boxes.data(), n, config, 64);
  passes.run([](double) {});
  Made made;
  const std::vector<uint32_t>& levels = passes.levels();
  for (size_t level = 0; level + 1 < levels.size(); ++level)
    for (uint32_t i = levels[level]; i < levels[level + 1]; ++i) {
      const KmeansCluster& c = passes.clusters()[i];
      for (const uint32_t value : {c.offset, c.count, c.first, c.parts})
        made.clusters.push_back(value);
      if (c.parts > 0) continue;
      const uint32_t* items = passes.items(level).primitives + c.offset;
      made.primitives.insert(made.primitives.end(), items, items + c.count);
    }
  BigVector<Merge> merges(n);
  KmeansTreelets<Exec> treelets(exec, passes, LeafRule(Config{}), kMostJoined / config.clusters,
                                merges.data());
  Subtree root{};
  treelets.run(&root);
  made.tree = emit(merges, root, boxes);
  return made;
}

void expect_same(const Made& made, const Made& expected) {
  EXPECT_EQ(made.clusters, expected.clusters);
  EXPECT_EQ(made.primitives, expected.primitives);
  expect_same(made.tree, expected.tree);
}

class KmeansPassesTest : public ::testing::TestWithParam<KmeansDistance> {};
INSTANTIATE_TEST_SUITE_P(Distances, KmeansPassesTest,
                         ::testing::Values(KmeansDistance::kEuclidean, KmeansDistance::kManhattan));

TEST_P(KmeansPassesTest, give_the_same_in_any_order) {
  std::vector<NamedBoxes> inputs = nasty_boxes();
  inputs.push_back({"random", random_boxes(20000, 1)});
  for (const uint32_t k : {2u, 8u, 64u})
    for (const NamedBoxes& input : inputs) {
      SCOPED_TRACE(input.name);
      const KmeansConfig config{.clusters = k, .distance = GetParam()};
      expect_same(make<BackwardExec>(input.boxes, config), make<CpuExec>(input.boxes, config));
    }
}

TEST_P(KmeansPassesTest, give_the_same_by_teams) {
  for (NamedBoxes input : nasty_boxes()) {
    SCOPED_TRACE(input.name);
    if (input.boxes.size() > 130) input.boxes.resize(130);
    const KmeansConfig config{.clusters = 3, .distance = GetParam()};
    expect_same(make<ThreadTeamExec>(input.boxes, config), make<CpuExec>(input.boxes, config));
  }
  // Of several chunks.
  const std::vector<Aabb> boxes = random_boxes(600, 1);
  for (const uint32_t k : {8u, 64u}) {
    const KmeansConfig config{.clusters = k, .distance = GetParam()};
    expect_same(make<ThreadTeamExec>(boxes, config), make<CpuExec>(boxes, config));
  }
}

TEST_P(KmeansPassesTest, items_at_one_place_are_divided_evenly) {
  // Two places, so far apart that the means of both round to one: and then each by itself.
  std::vector<Aabb> boxes(1000, Aabb{{1, 1, 1}, {1, 1, 1}});
  for (size_t i = 0; i < 10; ++i) boxes[100 * i] = {{1e9f, 1, 1}, {1e9f, 1, 1}};
  const KmeansConfig config{.clusters = 8, .distance = GetParam()};
  const Made made = make<CpuExec>(boxes, config);
  for (size_t i = 0; i < made.clusters.size(); i += 4)
    if (made.clusters[i + 3] == 0) EXPECT_LE(made.clusters[i + 1], kFewForKmeans);
  expect_same(make<ThreadTeamExec>(boxes, config), made);
}

TEST(KmeansDistanceTest, medians_of_a_group_are_its_middle) {
  // One cluster of two groups on a line: the representatives end at their medians.
  CpuExec exec;
  std::vector<float> columns[6];
  std::vector<uint32_t> primitives(7);
  for (auto& column : columns) column = {1, 9, 2, 100, 140, 3, 110};
  const KmeansPoints points{{columns[0].data(), columns[1].data(), columns[2].data(),
                             columns[3].data(), columns[4].data(), columns[5].data()},
                            primitives.data()};
  const std::vector<uint8_t> labels{0, 0, 0, 1, 1, 0, 1};
  const KmeansChunk chunk{0, 0, 7};
  const uint32_t counts[2] = {4, 3};
  KmeansPoint representatives[2] = {};
  KmeansMedians<CpuExec>(exec).run(points, 7, &chunk, 1, labels.data(), counts, 1, 2,
                                   representatives);
  for (int v = 0; v < 6; ++v) {
    EXPECT_EQ(representatives[0].v[v], 2.5f);
    EXPECT_EQ(representatives[1].v[v], 110.0f);
  }
}

}  // namespace
}  // namespace umbel::bvh
