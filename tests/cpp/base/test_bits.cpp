#include <gtest/gtest.h>

#include <random>

#include "base/bits.hpp"

namespace umbel {
namespace {

struct Item {
  uint32_t value, parameter;
  bool is_rice;
};

std::vector<Item> random_items(uint32_t seed, size_t count) {
  std::mt19937 random(seed);
  std::vector<Item> items;
  for (size_t i = 0; i < count; ++i) {
    const uint32_t bits = random() % 33;
    const auto value = static_cast<uint32_t>(random() & ((uint64_t{1} << bits) - 1));
    const bool is_rice = random() % 2 == 0;
    const uint32_t k = random() % 31;
    items.push_back({value, is_rice ? k : bits, is_rice});
  }
  return items;
}

std::vector<std::byte> written(const std::vector<Item>& items) {
  std::vector<std::byte> bytes;
  BitWriter out(bytes);
  for (const Item& item : items)
    item.is_rice ? out.rice(item.value, item.parameter) : out.write(item.value, item.parameter);
  out.finish();
  return bytes;
}

TEST(Bits, come_back_as_they_were_written) {
  for (uint32_t seed = 0; seed < 200; ++seed) {
    const std::vector<Item> items = random_items(seed, seed);
    const std::vector<std::byte> bytes = written(items);
    BitReader in(bytes);
    for (const Item& item : items)
      ASSERT_EQ(item.is_rice ? in.rice(item.parameter) : in.read(item.parameter), item.value);
    EXPECT_NO_THROW(in.finish());
  }
}

TEST(Bits, take_as_many_as_rice_bits_says) {
  for (const Item& item : random_items(1, 1000)) {
    const uint32_t bits = rice_bits(item.value, item.parameter % 31);
    const auto bytes = written({{item.value, item.parameter % 31, true}});
    EXPECT_EQ(bytes.size(), (bits + 7) / 8) << item.value << " with " << item.parameter % 31;
  }
}

TEST(Bits, must_end_where_they_end) {
  const std::vector<Item> items = random_items(7, 100);
  std::vector<std::byte> bytes = written(items);
  const auto read_all = [&] {
    BitReader in(bytes);
    for (const Item& item : items) item.is_rice ? in.rice(item.parameter) : in.read(item.parameter);
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
