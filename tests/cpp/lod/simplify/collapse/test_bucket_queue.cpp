#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "lod/simplify/collapse/bucket_queue.hpp"

namespace umbel::lod {
namespace {

TEST(BucketQueue, gives_keys_in_the_order_of_their_values_to_within_a_bucket) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> exponent(-60.0f, 60.0f);
  BucketQueue queue;
  queue.reset(1000);
  std::vector<float> values(1000);
  for (int round = 0; round < 3; ++round)
    for (uint32_t key = 0; key < 1000; ++key)
      queue.set(key, values[key] = std::exp2(exponent(random)));
  for (uint32_t key = 0; key < 1000; key += 7) queue.remove(key);
  float last = 0.0f;
  size_t count = 0;
  for (; !queue.empty(); ++count) {
    const uint32_t key = queue.pop();
    EXPECT_NE(key % 7, 0u);
    EXPECT_FALSE(queue.contains(key));
    EXPECT_GT(values[key], last / 1.0625f);
    last = std::max(last, values[key]);
  }
  EXPECT_EQ(count, 1000u - 143u);
}

TEST(BucketQueue, takes_zero_and_infinity) {
  BucketQueue queue;
  queue.reset(3);
  queue.set(0, std::numeric_limits<float>::infinity());
  queue.set(1, 1.0f);
  queue.set(2, 0.0f);
  EXPECT_EQ(queue.pop(), 2u);
  EXPECT_EQ(queue.pop(), 1u);
  EXPECT_EQ(queue.pop(), 0u);
  EXPECT_TRUE(queue.empty());
}

}  // namespace
}  // namespace umbel::lod
