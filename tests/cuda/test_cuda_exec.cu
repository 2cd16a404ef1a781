#include <algorithm>
#include <bit>
#include <numeric>
#include <random>

#include "base/bit_count.hpp"
#include "cuda/cuda_exec.cuh"
#include "device_arrays.cuh"

namespace umbel::cuda {
namespace {

const std::vector<size_t> kSizes = kEmulated
                                       ? std::vector<size_t>{0, 1, 2, 31, 33, 1000}
                                       : std::vector<size_t>{0, 1, 2, 31, 33, 1000, 8193, 300007};

/// Runs `work` twice: once to count the scratch, once over exactly that much.
template <typename Work>
void run(const Work& work) {
  Arena counting;
  CudaExec counted(nullptr, counting);
  work(counted);
  const DeviceArray<unsigned char> scratch(counting.most());
  Arena arena(scratch.data(), counting.most());
  CudaExec exec(nullptr, arena);
  work(exec);
  check(cudaDeviceSynchronize(), "running");
}

template <typename Key>
std::vector<Key> random_keys(size_t n, uint32_t bits) {
  std::mt19937_64 random(n);
  std::vector<Key> keys(n);
  for (Key& key : keys) key = static_cast<Key>(random() >> (64 - bits));
  return keys;
}

class ExecOnDevice : public OnDevice {
 public:
  void for_each(size_t n) {
    const DeviceArray<uint32_t> visits(std::vector<uint32_t>(n, 0));
    run([&](CudaExec& exec) {
      exec.for_each(n, [v = visits.data()] __device__(size_t i) { atomic_sum(&v[i], 1u); });
    });
    EXPECT_EQ(visits.read(), std::vector<uint32_t>(n, 1));
  }
  void reduce(size_t n) {
    const auto keys = random_keys<uint32_t>(n, 32);
    const DeviceArray<uint32_t> values(keys);
    const DeviceArray<uint64_t> sum(1);
    run([&](CudaExec& exec) {
      exec.reduce(
          n, uint64_t(5), [v = values.data()] __device__(size_t i) { return uint64_t(v[i]); },
          [] __device__(uint64_t a, uint64_t b) { return a + b; }, sum.data());
    });
    EXPECT_EQ(sum.read()[0], std::accumulate(keys.begin(), keys.end(), uint64_t(5)));
  }
  void scan(size_t n) {
    const auto keys = random_keys<uint32_t>(n, 8);
    std::vector<uint32_t> expected(n + 1), in_place = keys;
    in_place.push_back(0);
    CpuExec().exclusive_scan(n, [&](size_t i) { return keys[i]; }, expected.data());
    const DeviceArray<uint32_t> values(in_place), out(n + 1);
    run([&](CudaExec& exec) {
      exec.exclusive_scan(n, [v = values.data()] __device__(size_t i) { return v[i]; }, out.data());
    });
    EXPECT_EQ(out.read(), expected);
    run([&](CudaExec& exec) {
      exec.exclusive_scan(
          n, [v = values.data()] __device__(size_t i) { return v[i]; }, values.data());
    });
    EXPECT_EQ(values.read(), expected);
  }
  /// Each element of a layer makes two of the next one, as long as their numbers are below a
  /// million.
  void layers() {
    static constexpr uint32_t kEnd = kEmulated ? 2000 : 1000000, kLayers = 23;
    std::vector<uint32_t> counts_of_layers(kLayers + 1, 0), expected(kEnd, 1);
    counts_of_layers[0] = 1;
    expected[0] = 0;
    const DeviceArray<uint32_t> counts(counts_of_layers), odd(kEnd);
    const DeviceArray<uint32_t> even(std::vector<uint32_t>(kEnd, 1)),
        seen(std::vector<uint32_t>(kEnd, 0));
    run([&](CudaExec& exec) {
      exec.for_each_layer(counts.data(), kLayers, kEnd, 2,
                          [counts = counts.data(), even = even.data(), odd = odd.data(),
                           seen = seen.data()] __device__(uint32_t layer, size_t i) {
                            const uint32_t number = (layer % 2 == 0 ? even : odd)[i / 2];
                            if (i % 2 == 0) ++seen[number];
                            const uint32_t next = 2 * number + uint32_t(i % 2);
                            if (next < kEnd)
                              (layer % 2 == 0 ? odd : even)[atomic_count(&counts[layer + 1])] =
                                  next;
                          });
    });
    EXPECT_EQ(seen.read(), expected);
  }
  /// Lanes of a warp that come to a counter together need not have the same one.
  void counters(size_t n) {
    constexpr uint32_t kCounters = 5;
    const DeviceArray<uint32_t> counts(std::vector<uint32_t>(kCounters, 0)), seen(n);
    run([&](CudaExec& exec) {
      exec.for_each(n, [counts = counts.data(), seen = seen.data()] __device__(size_t i) {
        if (i % 7 != 3) seen[i] = atomic_count(&counts[i % kCounters]);
      });
    });
    const auto numbers = seen.read();
    std::vector<std::vector<uint32_t>> of(kCounters);
    for (size_t i = 0; i < n; ++i)
      if (i % 7 != 3) of[i % kCounters].push_back(numbers[i]);
    const auto ends = counts.read();
    for (uint32_t c = 0; c < kCounters; ++c) {
      std::sort(of[c].begin(), of[c].end());
      std::vector<uint32_t> expected(ends[c]);
      std::iota(expected.begin(), expected.end(), 0u);
      EXPECT_EQ(of[c], expected);
    }
  }
  void select(size_t n) {
    const auto keys = random_keys<uint32_t>(n, 3);
    std::vector<uint32_t> expected(n);
    uint32_t kept = 0;
    CpuExec().select(n, [&](size_t i) { return keys[i] < 3; }, expected.data(), &kept);
    expected.resize(kept);
    const DeviceArray<uint32_t> values(keys), out(n), count(1);
    run([&](CudaExec& exec) {
      exec.select(
          n, [v = values.data()] __device__(size_t i) { return v[i] < 3; }, out.data(),
          count.data());
    });
    ASSERT_EQ(count.read()[0], kept);
    EXPECT_EQ(out.read(kept), expected);
  }
  template <typename Key>
  void run_length(size_t n) {
    auto keys = random_keys<Key>(n, 10);
    std::sort(keys.begin(), keys.end());
    std::vector<uint32_t> expected(n + 1);
    uint32_t runs = 0;
    CpuExec().run_length(n, keys.data(), expected.data(), &runs);
    expected.resize(runs + 1);
    const DeviceArray<Key> values(keys);
    const DeviceArray<uint32_t> starts(n + 1), count(1);
    run([&](CudaExec& exec) { exec.run_length(n, values.data(), starts.data(), count.data()); });
    ASSERT_EQ(count.read()[0], runs);
    EXPECT_EQ(starts.read(runs + 1), expected);
  }
  /// What counts of bits give for a word with any highest and lowest bit.
  template <typename Word>
  void counts_of_bits() {
    std::vector<Word> words{0};
    for (uint32_t high = 0; high < 8 * sizeof(Word); ++high)
      for (uint32_t low = 0; low <= high; ++low)
        words.push_back(static_cast<Word>(Word{1} << high | Word{1} << low));
    std::vector<uint32_t> expected;
    for (const Word w : words)
      expected.insert(expected.end(), {uint32_t(std::popcount(w)), uint32_t(std::countl_zero(w)),
                                       uint32_t(std::countr_zero(Word(w | Word(w == 0))))});
    const DeviceArray<Word> values(words);
    const DeviceArray<uint32_t> counts(expected.size());
    run([&](CudaExec& exec) {
      exec.for_each(words.size(), [v = values.data(), c = counts.data()] __device__(size_t i) {
        c[3 * i] = count_bits(v[i]);
        c[3 * i + 1] = leading_zeros(v[i]);
        c[3 * i + 2] = lowest_bit(Word(v[i] | Word(v[i] == 0)));
      });
    });
    EXPECT_EQ(counts.read(), expected);
  }
  template <typename Key>
  void sort(size_t n, uint32_t first, uint32_t last) {
    auto keys = random_keys<Key>(n, sizeof(Key) * 8);
    std::vector<uint32_t> values(n);
    std::iota(values.begin(), values.end(), 0u);
    DeviceArray<Key> device_keys(keys);
    DeviceArray<uint32_t> device_values(values);
    CpuExec().radix_sort_pairs(n, keys.data(), values.data(), first, last);
    run([&](CudaExec& exec) {
      // The same answer twice: the second time there is nothing left to move.
      exec.radix_sort_pairs(n, device_keys.data(), device_values.data(), first, last);
    });
    EXPECT_EQ(device_keys.read(), keys);
    EXPECT_EQ(device_values.read(), values);
  }
};

TEST_F(ExecOnDevice, for_each_visits_each_index_once) {
  for (const size_t n : kSizes) for_each(n);
}
// The standard library's are wrong there.
TEST_F(ExecOnDevice, bits_are_counted) {
  counts_of_bits<uint16_t>();
  counts_of_bits<uint32_t>();
  counts_of_bits<uint64_t>();
}
TEST_F(ExecOnDevice, layers_follow_each_other_until_one_is_empty) { layers(); }
#if defined(UMBEL_SIMT)
// As under MPS or in a green context. No device can be asked to be so.
TEST_F(ExecOnDevice, layers_run_where_the_device_holds_fewer_blocks_than_it_says) {
  for (const uint32_t blocks : {2u, 1u}) {
    simt::set_blocks_together(blocks);
    layers();
  }
  simt::set_blocks_together(~0u);
}
#endif
TEST_F(ExecOnDevice, lanes_may_count_at_different_counters) {
  for (const size_t n : kSizes) counters(n);
}
TEST_F(ExecOnDevice, reduce_sums) {
  for (const size_t n : kSizes) reduce(n);
}
TEST_F(ExecOnDevice, scan_gives_the_sums_before_and_the_total) {
  for (const size_t n : kSizes) scan(n);
}
TEST_F(ExecOnDevice, select_keeps_the_order) {
  for (const size_t n : kSizes) select(n);
}
TEST_F(ExecOnDevice, runs_cover_equal_neighbours) {
  for (const size_t n : kSizes) {
    run_length<uint32_t>(n);
    run_length<uint64_t>(n);
  }
}
#if defined(UMBEL_SIMT)
TEST_F(ExecOnDevice, cub_is_asked_once_for_each_size) {
  const auto work = [&](size_t n, uint32_t bits) {
    const DeviceArray<uint32_t> keys(std::vector<uint32_t>(n, 7)), values(n), sums(n + 1);
    run([&](CudaExec& exec) {
      exec.radix_sort_pairs(n, keys.data(), values.data(), 0, bits);
      exec.exclusive_scan<uint32_t>(n, [k = keys.data()](size_t i) { return k[i]; }, sums.data());
    });
  };
  const auto asked = [&](size_t n, uint32_t bits) {
    const size_t before = simt::questions;
    work(n, bits);
    return simt::questions - before;
  };
  for (size_t n = 300; n < 310; ++n) work(n, 8);  // of a test before
  EXPECT_EQ(asked(100, 8), 2u);
  EXPECT_EQ(asked(100, 8), 0u);
  EXPECT_EQ(asked(150, 8), 2u);
  EXPECT_EQ(asked(150, 9), 1u);  // the sort alone
  EXPECT_EQ(asked(100, 8), 0u);
  for (size_t n = 200; n < 220; ++n) EXPECT_EQ(asked(n, 8), 2u);
  EXPECT_EQ(asked(100, 8), 2u);  // forgotten
}
#endif

TEST_F(ExecOnDevice, sort_is_stable_and_by_the_given_bits) {
  for (const size_t n : kSizes) {
    sort<uint32_t>(n, 0, 30);
    sort<uint32_t>(n, 7, 19);
    sort<uint64_t>(n, 0, 61);
    sort<uint64_t>(n, 33, 33);
  }
}

/// Folds, counts and ranks by teams, all into a number for each index.
template <uint32_t lanes>
struct Fold {
  static constexpr uint32_t kLanes = lanes;
  struct Shared {
    uint32_t least, sum;
  };
  struct Most {
    UMBEL_HOST_DEVICE uint64_t operator()(uint64_t a, uint64_t b) const { return a > b ? a : b; }
  };
  uint64_t* out;

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t index, Shared& shared) const {
    if (team.rank() == 0) shared.least = ~0u, shared.sum = 0;
    team.sync();
    uint32_t flagged = 0, rank_sum = 0;
    uint64_t most = 0;
    for (uint32_t base = 0; base < 1024; base += team.size()) {
      const uint32_t i = base + team.rank();
      const uint32_t value = (i * 2654435761u + uint32_t(index)) >> 8;
      team.lower(&shared.least, value);
      team.add(&shared.sum, value & 15);
      most = Most()(most, uint64_t(value) << 20 | i);
      const bool flag = value % 3 == 0;
      // Ranks count from the start of all indices, so they do not depend on the team's size.
      const uint32_t rank = flagged + team.rank_among(flag);
      flagged += team.count(flag);
      if (flag) rank_sum += rank * (i + 1);
    }
    team.add(&shared.sum, rank_sum);
    most = team.reduce(most, Most());
    team.sync();
    if (team.rank() == 0)
      out[index] = most ^ uint64_t(shared.least) << 7 ^ uint64_t(shared.sum) << 31 ^ flagged;
  }
};

template <uint32_t lanes>
void expect_teams_to_fold() {
  constexpr size_t n = kEmulated ? 3 : 37;
  std::vector<uint64_t> expected(n);
  CpuExec().for_each_team(n, Fold<lanes>{expected.data()});
  const DeviceArray<uint64_t> out(n);
  run([&](CudaExec& exec) { exec.for_each_team(n, Fold<lanes>{out.data()}); });
  EXPECT_EQ(out.read(), expected);
}

/// Folds and ranks right after each other, and items that the same team takes one after the other:
/// each may overwrite what other lanes still read.
template <uint32_t lanes>
struct InTurn {
  static constexpr uint32_t kLanes = lanes;
  struct Shared {
    uint32_t folded;
  };
  struct Most {
    UMBEL_HOST_DEVICE uint32_t operator()(uint32_t a, uint32_t b) const { return a > b ? a : b; }
  };
  uint32_t* out;  ///< of each item's lanes

  UMBEL_HOST_DEVICE static uint32_t first(uint32_t index, uint32_t rank) {
    return (rank * 7 + index) % 61;
  }
  UMBEL_HOST_DEVICE static uint32_t second(uint32_t index, uint32_t rank) {
    return (rank * 5 + index) % 67;
  }
  UMBEL_HOST_DEVICE static bool is_third(uint32_t rank) { return rank % 3 == 0; }
  UMBEL_HOST_DEVICE static bool is_odd(uint32_t rank) { return rank % 2 == 1; }

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t index, Shared& shared) const {
    const uint32_t rank = team.rank(), item = uint32_t(index);
    const uint32_t one = team.reduce(first(item, rank), Most());
    const uint32_t other = team.reduce(second(item, rank), Most());
    const uint32_t thirds = team.rank_among(is_third(rank));
    const uint32_t odds = team.rank_among(is_odd(rank));
    if (rank == 0) shared.folded = one + 100 * other;
    team.sync();
    out[index * lanes + rank] = shared.folded ^ thirds << 14 ^ odds << 23;
  }
};

/// Writes at once what lanes may still read of the team's last item.
template <uint32_t lanes>
struct HandOver {
  static constexpr uint32_t kLanes = lanes;
  struct Shared {
    uint32_t value;
  };
  uint32_t* out;  ///< of each item's lanes

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t index, Shared& shared) const {
    if (team.rank() == lanes - 1) shared.value = uint32_t(index) * 7;
    team.sync();
    out[index * lanes + team.rank()] = shared.value + team.rank();
  }
};

template <uint32_t lanes>
void expect_items_to_be_handed_over() {
  constexpr uint32_t n = (kEmulated ? 2 : 1) * 4 * detail::kMostBlocks + 3;
  std::vector<uint32_t> expected;
  for (uint32_t i = 0; i < n; ++i)
    for (uint32_t rank = 0; rank < lanes; ++rank) expected.push_back(i * 7 + rank);
  const DeviceArray<uint32_t> out(expected.size()), count(std::vector<uint32_t>{n});
  run([&](CudaExec& exec) { exec.for_each_team_of(count.data(), n, HandOver<lanes>{out.data()}); });
  EXPECT_EQ(out.read(), expected);
}

template <uint32_t lanes>
void expect_turns_to_be_apart() {
  using Body = InTurn<lanes>;
  constexpr uint32_t n = (kEmulated ? 2 : 1) * 4 * detail::kMostBlocks + 3;
  std::vector<uint32_t> expected;
  for (uint32_t i = 0; i < n; ++i) {
    uint32_t one = 0, other = 0, thirds = 0, odds = 0;
    for (uint32_t rank = 0; rank < lanes; ++rank) {
      one = std::max(one, Body::first(i, rank));
      other = std::max(other, Body::second(i, rank));
    }
    for (uint32_t rank = 0; rank < lanes; ++rank) {
      expected.push_back((one + 100 * other) ^ thirds << 14 ^ odds << 23);
      thirds += Body::is_third(rank);
      odds += Body::is_odd(rank);
    }
  }
  const DeviceArray<uint32_t> out(expected.size()), count(std::vector<uint32_t>{n});
  run([&](CudaExec& exec) { exec.for_each_team_of(count.data(), n, Body{out.data()}); });
  EXPECT_EQ(out.read(), expected);
}

/// Each number of a layer makes eight of the next one, a lane one of them, and a fold of what its
/// lanes know.
struct OctetTree {
  static constexpr uint32_t kLanes = 8;
  struct Shared {
    uint32_t values[8];
  };
  struct Sum {
    UMBEL_HOST_DEVICE uint32_t operator()(uint32_t a, uint32_t b) const { return a + b; }
  };
  uint32_t end;
  uint32_t* lists[2];
  uint32_t* counts;
  uint32_t* folds;  ///< of each number

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, uint32_t layer, size_t index,
                                    Shared& shared) const {
    const uint32_t number = lists[layer % 2][index];
    for (uint32_t lane = team.rank(); lane < 8; lane += team.size())
      shared.values[lane] = number * 3 + lane;
    team.sync();
    uint32_t fold = 0;
    for (uint32_t lane = team.rank(); lane < 8; lane += team.size())
      fold += shared.values[7 - lane] * (lane + 1);
    fold = team.reduce(fold, Sum());
    // Read after the last sync: who writes next has to wait.
    if (team.rank() == 0) folds[number] = fold + shared.values[7];
    for (uint32_t lane = team.rank(); lane < 8; lane += team.size()) {
      const uint32_t next = 8 * number + lane + 1;
      if (next < end) lists[(layer + 1) % 2][atomic_count(&counts[layer + 1])] = next;
    }
  }
};

class TeamsOnDevice : public OnDevice {};

TEST_F(TeamsOnDevice, eight_lanes_do_what_one_thread_does_layer_by_layer) {
  constexpr uint32_t kEnd = kEmulated ? 2000 : 1000000, kLayers = 8;
  std::vector<uint32_t> counts(kLayers + 1, 0), expected(kEnd, 0);
  counts[0] = 1;
  for (uint32_t number = 0; number < kEnd; ++number)
    for (uint32_t lane = 0; lane < 8; ++lane)
      expected[number] += (number * 3 + 7 - lane) * (lane + 1) + (lane == 7 ? number * 3 + 7 : 0);
  const DeviceArray<uint32_t> counts_there(counts), odd(kEnd), folds(kEnd);
  const DeviceArray<uint32_t> even(std::vector<uint32_t>(kEnd, 0));
  run([&](CudaExec& exec) {
    exec.for_each_layer_team(
        counts_there.data(), kLayers, kEnd,
        OctetTree{kEnd, {even.data(), odd.data()}, counts_there.data(), folds.data()});
  });
  EXPECT_EQ(folds.read(), expected);
}

TEST_F(TeamsOnDevice, what_follows_waits_for_those_that_still_read) {
  expect_turns_to_be_apart<32>();
  expect_turns_to_be_apart<64>();
  expect_turns_to_be_apart<256>();
  expect_items_to_be_handed_over<32>();
  expect_items_to_be_handed_over<256>();
}

TEST_F(TeamsOnDevice, warps_and_blocks_do_what_one_thread_does) {
  expect_teams_to_fold<32>();
  expect_teams_to_fold<256>();
  expect_teams_to_fold<1024>();
}

TEST(WithoutDevice, errors_end_with_the_words_of_cuda) {
  if (has_device()) GTEST_SKIP() << "there is a CUDA device here";
  Arena arena;
  CudaExec exec(nullptr, arena);
  uint32_t* none = nullptr;
  try {
    exec.radix_sort_pairs(100, none, none, 0, 30);
    FAIL() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kDevice);
    EXPECT_NE(std::string(error.what()).find("CUDA says: "), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace umbel::cuda
