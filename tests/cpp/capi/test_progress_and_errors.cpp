// Progress, errors and versions of the C interface.
#include <gtest/gtest.h>

#include <cstdlib>
#include <new>
#include <stdexcept>
#include <string>
#include <thread>

#include "capi/cluster_call.hpp"
#include "capi/newer.hpp"
#include "umbel/version.hpp"

namespace umbel {
namespace {

using namespace cluster_call;

struct Heard {
  std::vector<float> fractions;
  std::thread::id thread;
  int most = 1 << 30;
};

int listen(float fraction, const char* stage, void* user) {
  auto* heard = static_cast<Heard*>(user);
  EXPECT_NE(std::string(stage), "");
  EXPECT_EQ(std::this_thread::get_id(), heard->thread);
  heard->fractions.push_back(fraction);
  return int(heard->fractions.size()) < heard->most;
}

TEST(CapiErrors, progress_rises_to_one_and_may_cancel) {
  const Mesh mesh = shapes::blob(5, 1);
  Call call;
  set_mesh(call, mesh);
  Heard heard;
  heard.thread = std::this_thread::get_id();
  call.options.progress = listen;
  call.options.progress_user = &heard;
  ASSERT_EQ(call.run(), UMBEL_OK);
  ASSERT_FALSE(heard.fractions.empty());
  EXPECT_TRUE(std::is_sorted(heard.fractions.begin(), heard.fractions.end()));
  EXPECT_EQ(heard.fractions.back(), 1.0f);

  for (const int most : {1, 2}) {
    heard.fractions.clear();
    heard.most = most;
    expect_failure(call.run(), UMBEL_ERROR_CANCELLED, "cancelled");
    EXPECT_EQ(call.output.range_count, 0u);
    EXPECT_EQ(call.items[0], kNone);
  }
}

template <typename Exception>
int throwing(float, const char*, void*) {
  if constexpr (std::is_constructible_v<Exception, const char*>) {
    throw Exception("thrown by the callback");
  } else {
    throw Exception();
  }
}

TEST(CapiErrors, no_exception_crosses_the_border) {
  GoodCall call;
  call.options.progress = throwing<std::bad_alloc>;
  expect_failure(call.build(), UMBEL_ERROR_OUT_OF_MEMORY, "out of memory");
  call.options.progress = throwing<std::length_error>;
  expect_failure(call.build(), UMBEL_ERROR_OUT_OF_MEMORY, "out of memory");
  call.options.progress = throwing<std::logic_error>;
  expect_failure(call.build(), UMBEL_ERROR_INTERNAL, "thrown by the callback");
  call.options.progress = throwing<int>;
  expect_failure(call.build(), UMBEL_ERROR_INTERNAL, "unknown");
}

TEST(CapiErrors, last_error_belongs_to_its_thread) {
  Call call;
  call.input.struct_size = 0;
  ASSERT_NE(call.build(), UMBEL_OK);
  const std::string here = umbel_last_error();
  EXPECT_NE(here, "");
  std::thread([] {
    EXPECT_STREQ(umbel_last_error(), "");
    EXPECT_EQ(umbel_cluster_config_preset(nullptr, "fast", 1), UMBEL_ERROR_INVALID_ARGUMENT);
  }).join();
  EXPECT_EQ(umbel_last_error(), here);
}

TEST(CapiErrors, sentences_longer_than_their_memory_are_cut) {
  Call call;
  const std::string name(5000, 'x');
  EXPECT_EQ(umbel_cluster_config_preset(&call.config, name.c_str(), 1),
            UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_GT(std::string(umbel_last_error()).size(), 100u);
  EXPECT_LT(std::string(umbel_last_error()).size(), 5000u);
}

TEST(CapiErrors, any_number_of_threads_is_legal) {
  for (const uint32_t threads : {3u, 100000u, 0x7fffffffu, 0x80000000u, 0xffffffffu}) {
    GoodCall call;
    call.options.threads = threads;
    EXPECT_EQ(call.build(), UMBEL_OK) << threads << ": " << umbel_last_error();
  }
}

TEST(CapiErrors, callers_of_a_newer_version_are_served_while_what_is_new_is_zero) {
  auto config = testing::newer(umbel_cluster_config_init_sized);
  EXPECT_EQ(config.known.max_items, 128u);
  GoodCall call;
  ASSERT_EQ(umbel_cluster_build(&call.input, &config.known, nullptr, &call.output), UMBEL_OK);
  config.fresh[2] = 1;
  expect_failure(umbel_cluster_build(&call.input, &config.known, nullptr, &call.output),
                 UMBEL_ERROR_UNSUPPORTED, "config");
}

TEST(CapiErrors, results_have_names) {
  for (int i = 0; i <= UMBEL_ERROR_DEVICE; ++i)
    EXPECT_STRNE(umbel_result_name(umbel_result(i)), "unknown result") << i;
  EXPECT_STREQ(umbel_result_name(umbel_result(UMBEL_ERROR_DEVICE + 1)), "unknown result");
}

TEST(CapiErrors, version_is_the_version) { EXPECT_STREQ(umbel_version(), UMBEL_VERSION); }

}  // namespace
}  // namespace umbel
