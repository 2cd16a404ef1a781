#include <gtest/gtest.h>

#include <atomic>
#include <numeric>
#include <vector>

#include "base/in_order.hpp"
#include "base/parallel.hpp"

namespace umbel {
namespace {

struct Scratch {
  std::atomic<int> users{0};
  size_t value = 0;
};

/// Squares, appended in the order of their numbers and then doubled where they lie.
std::vector<size_t> doubled_squares(size_t count) {
  std::vector<size_t> all;
  all.reserve(count);
  size_t* const places = all.data();
  in_order<Scratch>(
      count,
      [](size_t i, Scratch& scratch) {
        EXPECT_EQ(scratch.users++, 0) << "a scratch serves one number at a time";
        scratch.value = i * i;
      },
      [&](size_t i, Scratch& scratch) {
        EXPECT_EQ(all.size(), i);
        all.push_back(scratch.value);
      },
      [&](size_t i, Scratch& scratch) {
        places[i] *= 2;
        EXPECT_EQ(scratch.value, i * i);
        --scratch.users;
      });
  return all;
}

TEST(InOrder, each_number_is_made_placed_in_turn_and_finished_for_any_threads) {
  for (const uint32_t threads : {1u, 2u, 8u}) {
    for (const size_t count : {size_t{0}, size_t{1}, size_t{2}, size_t{1000}}) {
      SCOPED_TRACE(testing::Message() << threads << " threads, " << count);
      with_threads(threads, [&] {
        const std::vector<size_t> all = doubled_squares(count);
        ASSERT_EQ(all.size(), count);
        for (size_t i = 0; i < count; ++i) EXPECT_EQ(all[i], 2 * i * i);
      });
    }
  }
}

}  // namespace
}  // namespace umbel
