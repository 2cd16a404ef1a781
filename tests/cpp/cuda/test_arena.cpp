#include <gtest/gtest.h>

#include "cuda/arena.hpp"

namespace umbel::cuda {
namespace {

/// Takes and gives back as an algorithm does.
size_t use(Arena& arena) {
  const ArenaBuffer<uint32_t> a(arena, 100);
  {
    ArenaBuffer<double> b(arena, 1000), c(arena, 10);
    std::swap(b, c);
  }
  const ArenaBuffer<uint8_t> d(arena, 3);
  EXPECT_TRUE(arena.counts() || static_cast<void*>(d.data()) > static_cast<void*>(a.data()));
  return arena.most();
}

alignas(256) char memory[16384];

TEST(Arena, counting_tells_how_much_the_same_calls_need) {
  Arena counting;
  const size_t needed = use(counting);
  EXPECT_EQ(needed, 512 + 8192 + 256);
  Arena enough(memory, needed);
  EXPECT_EQ(use(enough), needed);
  Arena short_of_one(memory, needed - 1);
  EXPECT_THROW(use(short_of_one), Error);
}

TEST(Arena, what_is_taken_is_aligned_and_apart) {
  Arena arena(memory, sizeof memory);
  const ArenaBuffer<char> a(arena, 1), b(arena, 300), c(arena, 0), d(arena, 1);
  for (const char* p : {a.data(), b.data(), d.data()})
    EXPECT_EQ(reinterpret_cast<uintptr_t>(p) % Arena::kAlignment, 0u);
  EXPECT_GE(b.data() - a.data(), 1);
  EXPECT_GE(d.data() - b.data(), 300);
}

TEST(Arena, memory_is_used_again_after_a_scope) {
  Arena arena(memory, sizeof memory);
  char* first = nullptr;
  {
    const ArenaBuffer<char> a(arena, 1000);
    first = a.data();
  }
  const ArenaBuffer<char> b(arena, 1000);
  EXPECT_EQ(b.data(), first);
}

TEST(Arena, refuses_memory_that_is_null_or_not_aligned) {
  EXPECT_THROW(Arena(memory + 16, 100), Error);
  EXPECT_THROW(Arena(nullptr, 100), Error);
}

}  // namespace
}  // namespace umbel::cuda
