#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include "asset/codec/choose_code.hpp"
#include "asset/codec/remainder_code.hpp"

namespace umbel::asset {
namespace {

std::vector<RemainderCode> valid_codes() {
  std::vector<RemainderCode> codes;
  for (uint8_t kind = 0; kind < RemainderCode::kKinds; ++kind)
    for (uint8_t parameter = 0; parameter < kAllZero; ++parameter)
      if (const RemainderCode code{parameter, kind}; code.is_valid()) codes.push_back(code);
  return codes;
}

/// Of any size, small ones more often.
std::vector<uint32_t> random_numbers(uint32_t seed, size_t count) {
  std::mt19937 random(seed);
  std::vector<uint32_t> numbers{0, 1, 2, ~0u, ~0u - 1, 1u << 31, 1u << 16};
  while (numbers.size() < count)
    numbers.push_back(static_cast<uint32_t>(random() >> (random() % 33 % 32)) * (random() % 3 > 0));
  return numbers;
}

std::vector<std::byte> written(const std::vector<uint32_t>& numbers, const RemainderCode& code) {
  std::vector<std::byte> bytes;
  BitWriter out(bytes);
  for (const uint32_t number : numbers) write_remainder(number, code, out);
  out.finish();
  return bytes;
}

TEST(RemainderCode, gives_back_any_numbers) {
  const std::vector<uint32_t> numbers = random_numbers(1, 2000);
  for (const RemainderCode& code : valid_codes()) {
    const std::vector<std::byte> bytes = written(numbers, code);
    BitReader in(bytes);
    for (const uint32_t number : numbers)
      ASSERT_EQ(in.in_class(unary_classes(code).data()), number)
          << int{code.kind} << " " << int{code.parameter};
    EXPECT_NO_THROW(in.finish());
  }
}

TEST(RemainderCode, of_kind_0_is_what_rice_reads) {
  const std::vector<uint32_t> numbers = random_numbers(2, 2000);
  for (uint8_t parameter = 0; parameter < kAllZero; ++parameter) {
    const std::vector<std::byte> bytes = written(numbers, {parameter, 0});
    BitReader in(bytes);
    for (const uint32_t number : numbers) ASSERT_EQ(in.rice(parameter), number);
    EXPECT_NO_THROW(in.finish());
  }
}

TEST(RemainderCode, of_zeros_reads_no_bits) {
  BitReader in({});
  for (uint8_t kind = 0; kind < RemainderCode::kKinds; ++kind)
    EXPECT_EQ(in.in_class(unary_classes({kAllZero, kind}).data()), 0u);
  EXPECT_NO_THROW(in.finish());
}

TEST(CodeChooser, knows_how_many_bits_its_codes_take) {
  CodeChooser chooser;
  std::mt19937 random(3);
  for (uint32_t seed = 0; seed < 300; ++seed) {
    std::vector<uint32_t> numbers = random_numbers(seed, 1 + seed);
    if (seed % 2 == 0)
      for (uint32_t& number : numbers) number >>= random() % 32;
    const CodeChoices choices = chooser.choose(numbers);
    for (const CodeChoice& choice : {choices.rice, choices.any}) {
      EXPECT_TRUE(choice.code.is_valid());
      if (choice.code.is_all_zero()) {
        EXPECT_EQ(std::accumulate(numbers.begin(), numbers.end(), uint64_t{0}), 0u);
        EXPECT_EQ(choice.bits, 0u);
      } else {
        EXPECT_EQ(written(numbers, choice.code).size(), (choice.bits + 7) / 8) << seed;
      }
    }
    EXPECT_EQ(choices.rice.code.kind, 0);
    EXPECT_LE(choices.any.bits, choices.rice.bits);
  }
}

TEST(CodeChooser, sets_zero_apart_where_it_is_frequent_and_doubles_where_few_are_large) {
  CodeChooser chooser;
  std::vector<uint32_t> flat(64, 0), tail;
  for (uint32_t i = 0; i < 16; ++i) flat[4 * i] = 200 + i;
  for (uint32_t i = 0; i < 64; ++i) tail.push_back(i % 8 == 0 ? 1000 * i : i % 4);
  const CodeChoices of_flat = chooser.choose(flat), of_tail = chooser.choose(tail);
  EXPECT_TRUE(of_flat.any.code.is_zero_apart());
  EXPECT_LT(2 * of_flat.any.bits, of_flat.rice.bits);
  EXPECT_TRUE(of_tail.any.code.is_exponential());
  EXPECT_LT(3 * of_tail.any.bits, 2 * of_tail.rice.bits);
}

}  // namespace
}  // namespace umbel::asset
