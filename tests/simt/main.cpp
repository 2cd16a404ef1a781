// Runs tests on the emulated device over seeds: SEEDS=50 with 50, FIRST_SEED=7 from the seventh on.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <string>

#include "machine.hpp"

// ThreadSanitizer asks for it. The processor's side is not compiled with it.
// NOLINTBEGIN(bugprone-reserved-identifier,readability-identifier-naming): its name
extern "C" const char* __tsan_default_options();
extern "C" const char* __tsan_default_options() {
  return "halt_on_error=1:exitcode=66:ignore_noninstrumented_modules=1:history_size=2";
}
// NOLINTEND(bugprone-reserved-identifier,readability-identifier-naming)

namespace {

uint64_t number_in(const char* name, uint64_t otherwise) {
  const char* text = getenv(name);
  return text ? strtoull(text, nullptr, 10) : otherwise;
}

/// Every test begins with the seed of its round, so that it can be repeated by itself.
class Seeds : public testing::EmptyTestEventListener {
 public:
  explicit Seeds(uint64_t first) : first_(first) {}

  void OnTestIterationStart(const testing::UnitTest&, int round) override {
    seed_ = first_ + uint64_t(round);
    // Seen where a machine ends the program.
    fprintf(stderr, "seed %llu\n", static_cast<unsigned long long>(seed_));
  }
  void OnTestStart(const testing::TestInfo&) override { umbel::simt::set_seed(seed_); }

 private:
  uint64_t first_, seed_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  testing::GTEST_FLAG(repeat) = int(number_in("SEEDS", 1));
  testing::GTEST_FLAG(break_on_failure) = false;
  testing::UnitTest::GetInstance()->listeners().Append(new Seeds(number_in("FIRST_SEED", 1)));
  return RUN_ALL_TESTS();
}
