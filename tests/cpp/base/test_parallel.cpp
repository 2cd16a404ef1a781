// How parallel loops end where one thread throws.
#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>

#include "base/parallel.hpp"

namespace umbel {
namespace {

TEST(Parallel, a_thrown_exception_ends_the_ranges_of_other_threads) {
  constexpr size_t kCount = size_t{1} << 22;
  std::atomic<size_t> done{0};
  const auto loop = [&] {
    with_threads(4, [&] {
      parallel_for(kCount, 1, [&](size_t) {
        if (done.fetch_add(1) == 100) throw std::runtime_error("enough");
      });
    });
  };
  EXPECT_THROW(loop(), std::runtime_error);
  EXPECT_LT(done.load(), kCount / 2);
}

TEST(Parallel, a_loop_inside_one_that_has_ended_throws) {
  std::atomic<bool> is_ending{false};
  const auto loop = [&] {
    with_threads(2, [&] {
      parallel_for(2, 1, [&](size_t i) {
        if (i == 0) {
          is_ending = true;
          throw std::runtime_error("enough");
        }
        // On another thread, if the first is about to throw by now.
        while (is_ending) parallel_for(100, 1, [](size_t) {});
      });
    });
  };
  EXPECT_THROW(loop(), std::runtime_error);
}

}  // namespace
}  // namespace umbel
