#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

#include "base/exec.hpp"

namespace umbel {
namespace {

const std::vector<size_t> kSizes = {0, 1, 2, 3, 25, 1000, 8192, 8193, 100000, 300007};

template <typename Key>
std::vector<Key> random_keys(size_t n, uint32_t bits, uint32_t seed) {
  std::mt19937_64 random(seed);
  std::vector<Key> keys(n);
  for (Key& key : keys) key = static_cast<Key>(bits == 0 ? 0 : random() >> (64 - bits));
  return keys;
}

/// Compares with a sort by bits [first, last) and then by place.
template <typename Key>
void expect_sorted(const std::vector<Key>& keys, uint32_t first, uint32_t last,
                   uint32_t threads = 0) {
  const uint32_t size = last - first;
  const auto digits = [&](Key key) {
    return size == 0 ? 0 : uint64_t(key) >> first & ((uint64_t(2) << (size - 1)) - 1);
  };
  std::vector<uint32_t> expected(keys.size());
  std::iota(expected.begin(), expected.end(), 0u);
  std::sort(expected.begin(), expected.end(), [&](uint32_t a, uint32_t b) {
    return std::pair(digits(keys[a]), a) < std::pair(digits(keys[b]), b);
  });
  std::vector<Key> sorted = keys;
  std::vector<uint32_t> values(keys.size());
  std::iota(values.begin(), values.end(), 0u);
  with_threads(threads, [&] {
    CpuExec().radix_sort_pairs(sorted.size(), sorted.data(), values.data(), first, last);
  });
  ASSERT_EQ(values, expected);
  for (size_t i = 0; i < keys.size(); ++i) ASSERT_EQ(sorted[i], keys[expected[i]]);
}

TEST(Exec, sort_is_stable_and_by_the_given_bits) {
  for (const size_t n : kSizes) {
    expect_sorted(random_keys<uint32_t>(n, 30, 1), 0, 30);
    expect_sorted(random_keys<uint64_t>(n, 63, 2), 0, 63);
    expect_sorted(random_keys<uint64_t>(n, 64, 3), 0, 64);
    expect_sorted(random_keys<uint32_t>(n, 32, 4), 7, 19);
    expect_sorted(random_keys<uint64_t>(n, 64, 5), 20, 50);
    expect_sorted(random_keys<uint64_t>(n, 64, 6), 33, 33);
  }
}

TEST(Exec, sort_takes_keys_with_few_different_bits) {
  for (const size_t n : {size_t(1000), size_t(100000)}) {
    expect_sorted(random_keys<uint64_t>(n, 0, 1), 0, 63);
    expect_sorted(random_keys<uint64_t>(n, 1, 2), 0, 63);
    expect_sorted(random_keys<uint64_t>(n, 9, 3), 0, 63);
    std::vector<uint64_t> keys = random_keys<uint64_t>(n, 12, 4);
    for (uint64_t& key : keys) key = (key & 7) << 60 | key >> 3;
    expect_sorted(keys, 0, 63);
  }
}

TEST(Exec, sort_does_not_depend_on_the_threads) {
  const auto keys = random_keys<uint32_t>(200000, 14, 9);
  for (const uint32_t threads : {1, 2, 8}) expect_sorted(keys, 2, 30, threads);
}

TEST(Exec, for_each_visits_each_index_once) {
  for (const size_t n : kSizes) {
    std::vector<uint32_t> visits(n);
    CpuExec().for_each(n, [v = visits.data()](size_t i) { atomic_sum(&v[i], 1u); });
    EXPECT_EQ(std::count(visits.begin(), visits.end(), 1u), ptrdiff_t(n));
  }
}

TEST(Exec, layers_follow_each_other_until_one_is_empty) {
  // Each element of a layer makes two of the next one, as long as their numbers are below 100.
  const CpuBuffer<uint32_t> counts(10);
  std::fill_n(counts.data(), 10, 0u);
  const CpuBuffer<uint32_t> layers[2]{CpuBuffer<uint32_t>(200), CpuBuffer<uint32_t>(200)};
  std::vector<uint32_t> seen(100);
  counts.data()[0] = 1;
  layers[0].data()[0] = 1;
  CpuExec().for_each_layer(counts.data(), 9, 200, 2, [&](uint32_t layer, size_t i) {
    const uint32_t number = layers[layer % 2].data()[i / 2];
    if (i % 2 == 0) ++seen[number];
    const auto next = uint32_t(2 * number + i % 2);
    if (next < 100) layers[1 - layer % 2].data()[atomic_count(&counts.data()[layer + 1])] = next;
  });
  for (uint32_t i = 1; i < 100; ++i) EXPECT_EQ(seen[i], 1u) << i;
  EXPECT_EQ(counts.data()[6], 36u);
  EXPECT_EQ(counts.data()[7], 0u);
  // Not more layers than said, and of each not more than there is room for.
  uint32_t calls = 0;
  std::fill_n(counts.data(), 10, 7u);
  with_threads(1, [&] {
    CpuExec().for_each_layer(counts.data(), 3, 5, 2, [&](uint32_t, size_t) { ++calls; });
  });
  EXPECT_EQ(calls, 30u);
}

TEST(Exec, reduce_folds_in_fixed_order) {
  CpuExec exec;
  for (const size_t n : kSizes) {
    const auto map = [](size_t i) { return 1.0f / float(i + 1); };
    const auto sum = [](float a, float b) { return a + b; };
    float results[3];
    for (int k = 0; k < 3; ++k)
      with_threads(uint32_t(k + 1), [&] { exec.reduce(n, 0.0f, map, sum, &results[k]); });
    EXPECT_EQ(results[0], results[1]);
    EXPECT_EQ(results[0], results[2]);
    uint64_t total = 0;
    exec.reduce(
        n, uint64_t(5), [](size_t i) { return uint64_t(i); },
        [](uint64_t a, uint64_t b) { return a + b; }, &total);
    EXPECT_EQ(exec.read(&total), 5 + uint64_t(n) * (n - (n > 0)) / 2);
  }
}

TEST(Exec, scan_gives_the_sums_before_and_the_total) {
  for (const size_t n : kSizes) {
    const auto values = random_keys<uint32_t>(n, 8, 11);
    std::vector<uint32_t> out(n + 1), in_place(n + 1);
    std::copy(values.begin(), values.end(), in_place.begin());
    CpuExec().exclusive_scan(n, [v = values.data()](size_t i) { return v[i]; }, out.data());
    CpuExec().exclusive_scan(n, [v = in_place.data()](size_t i) { return v[i]; }, in_place.data());
    uint32_t sum = 0;
    for (size_t i = 0; i < n; ++i) {
      ASSERT_EQ(out[i], sum);
      sum += values[i];
    }
    EXPECT_EQ(out[n], sum);
    EXPECT_EQ(out, in_place);
  }
}

TEST(Exec, select_keeps_the_order) {
  for (const size_t n : kSizes) {
    const auto values = random_keys<uint32_t>(n, 3, 12);
    std::vector<uint32_t> kept(n), expected;
    for (size_t i = 0; i < n; ++i)
      if (values[i] < 3) expected.push_back(uint32_t(i));
    uint32_t count = 0;
    CpuExec().select(n, [v = values.data()](size_t i) { return v[i] < 3; }, kept.data(), &count);
    kept.resize(count);
    EXPECT_EQ(kept, expected);
  }
}

TEST(Exec, runs_cover_equal_neighbours) {
  for (const size_t n : kSizes) {
    auto keys = random_keys<uint64_t>(n, 10, 13);
    std::sort(keys.begin(), keys.end());
    std::vector<uint32_t> starts(n + 1), expected;
    for (size_t i = 0; i < n; ++i)
      if (i == 0 || keys[i] != keys[i - 1]) expected.push_back(uint32_t(i));
    uint32_t runs = 0;
    CpuExec().run_length(n, keys.data(), starts.data(), &runs);
    ASSERT_EQ(runs, expected.size());
    EXPECT_EQ(starts[runs], n);
    EXPECT_TRUE(std::equal(expected.begin(), expected.end(), starts.begin()));
  }
}

}  // namespace
}  // namespace umbel
