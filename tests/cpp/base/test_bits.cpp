#include <gtest/gtest.h>

#include <random>

#include "base/bits.hpp"

namespace umbel {
namespace {

struct Item {
  uint32_t value, bits;
};

std::vector<Item> random_items(uint32_t seed, size_t count) {
  std::mt19937 random(seed);
  std::vector<Item> items;
  for (size_t i = 0; i < count; ++i) {
    const uint32_t bits = random() % 33;
    const auto value = static_cast<uint32_t>(random() & ((uint64_t{1} << bits) - 1));
    items.push_back({value, bits});
  }
  return items;
}

std::vector<std::byte> written(const std::vector<Item>& items) {
  std::vector<std::byte> bytes;
  BitWriter out(bytes);
  for (const auto& [value, bits] : items) out.write(value, bits);
  out.finish();
  return bytes;
}

TEST(Bits, come_back_as_they_were_written) {
  for (uint32_t seed = 0; seed < 200; ++seed) {
    const std::vector<Item> items = random_items(seed, seed);
    const std::vector<std::byte> bytes = written(items);
    BitReader in(bytes);
    for (const Item& item : items) ASSERT_EQ(in.read(item.bits), item.value);
    EXPECT_NO_THROW(in.finish());
  }
}

TEST(Bits, of_nothing_are_no_bytes) {
  std::vector<std::byte> bytes;
  BitWriter out(bytes);
  out.finish();
  EXPECT_TRUE(bytes.empty());
}

TEST(Bits, must_end_where_they_end) {
  const std::vector<Item> items = random_items(7, 100);
  std::vector<std::byte> bytes = written(items);
  const auto read_all = [&] {
    BitReader in(bytes);
    for (const Item& item : items) in.read(item.bits);
    in.finish();
  };
  bytes.push_back(std::byte{0});
  EXPECT_THROW(read_all(), Error);
  bytes.resize(bytes.size() - 2);
  EXPECT_THROW(read_all(), Error);
  bytes.clear();
  EXPECT_THROW(read_all(), Error);
}

TEST(Zigzag, makes_small_numbers_of_either_sign_small) {
  EXPECT_EQ(zigzag(0), 0u);
  EXPECT_EQ(zigzag(-1), 1u);
  EXPECT_EQ(zigzag(1), 2u);
  for (const int32_t value : {0, 1, -1, 77, -12345, INT32_MAX, INT32_MIN})
    EXPECT_EQ(unzigzag(zigzag(value)), value);
}

}  // namespace
}  // namespace umbel
