// HashIndex and Interner: as std::unordered_map numbers keys.
#include <gtest/gtest.h>

#include <random>
#include <unordered_map>
#include <vector>

#include "base/hash_index.hpp"
#include "base/interner.hpp"

namespace umbel {
namespace {

// All in one slot, so that only probing tells keys apart.
struct OneSlot {
  uint64_t operator()(uint64_t) const { return 0; }
};

template <typename Hash>
void expect_numbers_of_first_appearance(uint64_t distinct, int inserts) {
  std::mt19937_64 random(7);
  std::unordered_map<uint64_t, uint32_t> known;
  Interner<uint64_t, Hash> interner;
  for (int i = 0; i < inserts; ++i) {
    const uint64_t key = random() % distinct << 32;
    EXPECT_EQ(interner.contains(key), known.contains(key));
    const auto [expected, is_new] = known.insert({key, static_cast<uint32_t>(known.size())});
    EXPECT_EQ(interner.insert(key), std::pair(expected->second, is_new));
  }
  ASSERT_EQ(interner.keys().size(), known.size());
  for (const auto& [key, number] : known) EXPECT_EQ(interner.keys()[number], key);
}

TEST(Interner, numbers_keys_by_first_appearance_as_it_grows) {
  expect_numbers_of_first_appearance<IntegerHash>(3000, 20000);
}

TEST(Interner, tells_keys_apart_whose_hashes_are_equal) {
  expect_numbers_of_first_appearance<OneSlot>(100, 500);
}

TEST(Interner, reserving_keeps_what_it_has) {
  Interner<uint64_t, IntegerHash> interner;
  for (uint64_t key = 0; key < 50; ++key) interner.insert(key * key);
  interner.reserve(10000);
  for (uint64_t key = 0; key < 50; ++key)
    EXPECT_EQ(interner.insert(key * key), std::pair(static_cast<uint32_t>(key), false));
}

TEST(HashIndex, finds_the_first_equal_entry_and_forgets_on_reset) {
  const std::vector<int> values = {4, 7, 4, 9, 7, 4};
  HashIndex index(values.size());
  const auto insert = [&](uint32_t i) {
    return index.find_or_insert(IntegerHash()(values[i]), i,
                                [&](uint32_t j) { return values[j] == values[i]; });
  };
  std::vector<uint32_t> first;
  for (uint32_t i = 0; i < values.size(); ++i) first.push_back(insert(i));
  EXPECT_EQ(first, (std::vector<uint32_t>{0, 1, 0, 3, 1, 0}));
  index.reset(values.size());
  EXPECT_EQ(insert(5), 5u);
  EXPECT_EQ(index.find(IntegerHash()(9), [&](uint32_t j) { return values[j] == 9; }), kNone);
}

}  // namespace
}  // namespace umbel
