#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <map>
#include <mutex>
#include <random>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>

#include "heap_peak.hpp"
#include "stream/world.hpp"

namespace umbel {
namespace {

using testing::seen_from;
using testing::Streamed;
using testing::world;

TEST(Residency, shows_the_ideal_cut_once_all_is_there) {
  Streamed s;
  for (const lod::View& view : {seen_from({0, 0, 3}), seen_from({1.1f, 0, 0}),
                                lod::view_error(0.01f), lod::view_error(0)}) {
    const StreamStep last = s.settle(view);
    EXPECT_EQ(last.missing_groups, 0u);
    EXPECT_LE(last.worst_error, 1);
    EXPECT_EQ(world().clusters(s.residency), lod::select(world().asset().tables(), view));
  }
}

TEST(Residency, shows_a_whole_surface_within_its_budget_at_every_step) {
  for (const double share : {0.1, 0.25, 0.6}) {
    ResidencyConfig config;
    config.budget_bytes = static_cast<uint64_t>(share * static_cast<double>(world().bytes()));
    config.loads_in_flight = 3;
    Streamed s(config);
    s.postman->per_poll = 1;
    for (int i = 0; i < 150; ++i) {
      const float angle = 0.05f * static_cast<float>(i);
      const float r = 1.1f + 0.8f * std::sin(3 * angle);
      s.step(seen_from({r * std::cos(angle), r * std::sin(angle), 0.3f}, 0.5f));
      world().expect_whole(s.residency);
      EXPECT_LE(s.residency.statistics().resident_bytes, config.budget_bytes);
    }
    EXPECT_GT(s.residency.statistics().loads, 5u);
    if (share < 0.5) {
      EXPECT_GT(s.residency.statistics().evictions, 0u);
    }
  }
}

TEST(Residency, keeps_the_roots_and_starts_with_them) {
  Streamed s;
  s.postman->per_poll = 0;
  s.step(seen_from({0, 0, 1.2f}));
  world().expect_whole(s.residency);
  EXPECT_GT(s.residency.statistics().pinned_bytes, 0u);
  const uint32_t root = world().asset().roots()[0].page;
  EXPECT_NE(s.residency.page(root), nullptr);
}

TEST(Residency, comes_to_rest_when_the_camera_does) {
  for (const double share : {0.08, 0.15, 0.3}) {
    ResidencyConfig config;
    config.budget_bytes = static_cast<uint64_t>(share * static_cast<double>(world().bytes()));
    Streamed s(config);
    const lod::View view = seen_from({1.3f, 0, 0}, 0.2f);
    EXPECT_GT(s.settle(view).missing_groups, 0u);
    const uint64_t loads = s.residency.statistics().loads;
    s.settle(view);
    EXPECT_EQ(s.residency.statistics().loads, loads) << share;
    EXPECT_EQ(s.residency.statistics().in_flight, 0u);
  }
}

TEST(Residency, asks_for_parents_before_their_children) {
  Streamed s;
  s.postman->per_poll = 1;
  std::set<std::pair<uint32_t, uint32_t>> known;  // groups by mesh that something referred to
  for (int i = 0; i < 50; ++i) {
    s.step(seen_from({1.1f, 0, 0}));
    std::set<uint32_t> referred;
    for (const uint32_t page : s.residency.resident_pages())
      for (const PageGroup& group : s.residency.page(page)->groups)
        for (const GroupRef& child : group.children) referred.insert(child.page);
    for (const uint32_t page : s.postman->asked) EXPECT_TRUE(referred.contains(page));
  }
}

TEST(Residency, cancels_what_is_not_wanted_any_more) {
  ResidencyConfig config;
  config.loads_in_flight = 20;
  Streamed s(config);
  s.postman->per_poll = 2;
  for (int i = 0; i < 4; ++i) s.step(seen_from({1.1f, 0, 0}, 0.3f));
  EXPECT_FALSE(s.postman->asked.empty());
  const StreamStep away = s.step(seen_from({1000, 0, 0}));
  EXPECT_GT(away.cancelled, 0u);
  EXPECT_TRUE(s.postman->asked.empty());
}

TEST(Residency, bounds_what_a_step_does) {
  ResidencyConfig config;
  config.loads_in_flight = 50;
  config.bytes_per_step = 40000;
  config.evictions_per_step = 1;
  config.budget_bytes = world().bytes() / 4;
  Streamed s(config);
  s.postman->per_poll = 50;
  for (int i = 0; i < 60; ++i) {
    const StreamStep step =
        s.step(seen_from({1.2f * std::cos(0.1f * static_cast<float>(i)), 1.2f, 0}, 0.3f));
    EXPECT_LE(step.loaded, 3u);
    EXPECT_LE(step.evicted, 1u);
    EXPECT_LE(s.residency.statistics().resident_bytes, config.budget_bytes);
    EXPECT_LE(s.residency.statistics().in_flight, 50u);
  }
}

TEST(Residency, limits_of_zero_are_none) {
  ResidencyConfig config;
  config.budget_bytes = config.bytes_per_step = 0;
  config.loads_in_flight = config.evictions_per_step = config.groups_per_step = 0;
  Streamed s(config);
  s.postman->per_poll = 1'000'000;
  // Each step brings all that the last one has found, down to the next level.
  const auto levels = static_cast<int>(world().asset().tables().levels.size());
  StreamStep last;
  for (int i = 0; i <= levels; ++i) {
    last = s.step(lod::view_error(0));
    EXPECT_TRUE(last.caught_up);
  }
  EXPECT_EQ(last.missing_groups, 0u);
  EXPECT_EQ(s.residency.statistics().resident_bytes, world().bytes());
  s.residency.set_budget(0);
}

TEST(Residency, evicts_without_a_limit_where_that_is_zero) {
  ResidencyConfig config;
  config.budget_bytes = world().bytes() / 3;
  config.evictions_per_step = 0;
  config.bytes_per_step = 0;
  Streamed s(config);
  s.settle(seen_from({1.1f, 0, 0}, 0.5f));
  s.settle(seen_from({-1.1f, 0, 0}, 0.5f));
  EXPECT_GT(s.residency.statistics().evictions, 0u);
}

TEST(Residency, never_gives_up_without_a_limit_of_attempts) {
  ResidencyConfig config;
  config.attempts = 0;
  config.backoff_seconds = 0;
  Streamed s(config);
  for (uint32_t p = 1; p < world().asset().info().pages; ++p) s.postman->broken.insert(p);
  s.settle(lod::view_error(0));
  EXPECT_GT(s.residency.statistics().failures, 100u);
  EXPECT_TRUE(s.residency.statistics().given_up.empty());
}

TEST(Residency, tries_broken_pages_again_later_and_then_stays_coarse) {
  ResidencyConfig config;
  config.attempts = 3;
  config.backoff_seconds = 0.2;
  Streamed s(config);
  const lod::View view = lod::view_error(0);
  std::mt19937 random(1);
  for (uint32_t p = 1; p < world().asset().info().pages; ++p)
    if (random() % 4 == 0) s.postman->broken.insert(p);
  for (int i = 0; i < 400; ++i) {
    s.step(view);
    if (i % 20 == 0) world().expect_whole(s.residency);
  }
  const ResidencyStatistics said = s.residency.statistics();
  EXPECT_FALSE(said.given_up.empty());
  EXPECT_EQ(said.failures, 3 * said.given_up.size());
  EXPECT_NE(said.last_problem.find("is broken"), std::string::npos);
  for (const uint32_t page : said.given_up) {
    EXPECT_TRUE(s.postman->broken.contains(page));
    EXPECT_EQ(s.postman->requests[page], 3u);
  }
  // Repaired and forgiven, all comes.
  s.postman->broken.clear();
  s.residency.retry_failed();
  EXPECT_EQ(s.settle(view).missing_groups, 0u);
  EXPECT_TRUE(s.residency.statistics().given_up.empty());
}

TEST(Residency, waits_twice_as_long_before_each_further_try) {
  ResidencyConfig config;
  config.attempts = 4;
  config.backoff_seconds = 0.5;
  Streamed s(config);
  const uint32_t page = world().asset().roots()[0].page == 0 ? 1 : 0;
  s.postman->broken.insert(page);
  std::vector<double> tries;
  for (int i = 0; i < 600; ++i) {
    s.step(lod::view_error(0));
    if (s.postman->requests[page] > tries.size()) tries.push_back(s.now);
  }
  ASSERT_EQ(tries.size(), 4u);
  for (size_t i = 0; i < 3; ++i) {
    const double pause = tries[i + 1] - tries[i], backoff = 0.5 * std::exp2(i);
    EXPECT_GE(pause, backoff);
    EXPECT_LE(pause, backoff + 0.3);  // until it has failed
  }
}

TEST(Residency, asks_again_for_what_never_comes) {
  ResidencyConfig config;
  config.slow_seconds = 0.1;
  config.attempts = 4;
  config.backoff_seconds = 0.05;
  Streamed s(config);
  for (uint32_t p = 1; p < world().asset().info().pages; p += 3) s.postman->lost.insert(p);
  const lod::View view = lod::view_error(0);
  s.settle(view);
  world().expect_whole(s.residency);
  const ResidencyStatistics said = s.residency.statistics();
  EXPECT_GT(said.slow_loads, 0u);
  EXPECT_FALSE(said.given_up.empty());
  s.postman->lost.clear();
  s.residency.retry_failed();
  EXPECT_EQ(s.settle(view).missing_groups, 0u);
}

TEST(Residency, loads_on_threads_while_the_camera_moves) {
  ResidencyConfig config;
  config.budget_bytes = world().bytes() / 3;
  config.threads = 3;
  Residency residency(world().asset(), config);
  // As many steps as a slow machine needs for one load to arrive.
  for (int i = 0; i < 100 || (residency.statistics().loads == 0 && i < 20'000); ++i) {
    const float angle = 0.06f * static_cast<float>(i);
    const StreamView views[] = {
        {0, seen_from({1.3f * std::cos(angle), 1.3f * std::sin(angle), 0}), {}},
        {0, seen_from({0, 0, 4}), {}}};
    residency.step(views, 0.01 * i);
    if (i % 10 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  // And comes to its end with loads under way.
  EXPECT_GT(residency.statistics().loads, 0u);
}

/// The world's bytes. The first reads of each page fail: one ends early, one has a wrong byte.
class Unreliable : public ByteSource {
 public:
  explicit Unreliable(std::shared_ptr<const ByteSource> source) : source_(std::move(source)) {}
  uint64_t size() const override { return source_->size(); }
  void read(uint64_t offset, std::span<std::byte> out) const override {
    const std::lock_guard lock(mutex_);
    const uint32_t attempt = is_reliable ? 2 : attempts_[offset]++;
    if (attempt == 0) throw std::runtime_error("the file ends early");
    source_->read(offset, out);
    if (attempt == 1) out[out.size() / 2] ^= std::byte{4};
  }
  bool is_reliable = true;

 private:
  std::shared_ptr<const ByteSource> source_;
  mutable std::mutex mutex_;
  mutable std::map<uint64_t, uint32_t> attempts_;
};

TEST(Residency, reads_again_what_came_short_or_corrupt) {
  const auto source = std::make_shared<Unreliable>(open_file(world().path()));
  const Asset asset(source);
  Residency residency(asset);
  source->is_reliable = false;
  const StreamView all[] = {{0, lod::view_error(0), {}}};
  std::set<std::string> problems;
  // As many steps as a slow machine needs.
  for (int i = 0; i < 20'000; ++i) {
    if (residency.step(all, 0.2 * i).missing_groups == 0) break;
    world().expect_whole(residency);
    problems.insert(residency.statistics().last_problem);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  const ResidencyStatistics said = residency.statistics();
  EXPECT_EQ(world().clusters(residency), lod::select(world().asset().tables(), all[0].view));
  EXPECT_EQ(said.failures, 2 * (said.loads - 1));  // all but the roots' page, twice each
  EXPECT_TRUE(said.given_up.empty());
  EXPECT_TRUE(problems.contains("the file ends early"));
}

TEST(Residency, goes_on_after_steps_for_which_there_was_no_memory) {
  if (!testing::FailingAllocation::works()) GTEST_SKIP() << "operator new is another's";
  ResidencyConfig config;
  config.budget_bytes = world().bytes() / 3;
  Streamed s(config);
  const lod::View views[] = {seen_from({1.2f, 0, 0}), seen_from({0, 1.2f, 0.3f})};
  size_t others = 0, failures = 0;
  for (int i = 0; i < 800; ++i) {
    const lod::View& view = views[i / 20 % 2];
    bool has_failed = false;
    if (i % 3 == 0) {
      const testing::FailingAllocation failing(others);
      try {
        s.step(view);
      } catch (const std::bad_alloc&) {
        has_failed = true;
      }
    } else {
      s.step(view);
    }
    others = has_failed ? others + 1 : 0;
    failures += has_failed;
    if (has_failed)
      EXPECT_TRUE(s.residency.cut().empty());
    else
      world().expect_whole(s.residency);
    EXPECT_LE(s.residency.statistics().resident_bytes, config.budget_bytes);
  }
  EXPECT_GT(failures, 100u);
  const StreamStep last = s.settle(lod::view_error(0.02f));
  EXPECT_EQ(last.missing_groups, 0u);
  EXPECT_EQ(world().clusters(s.residency),
            lod::select(world().asset().tables(), lod::view_error(0.02f)));
}

TEST(Residency, shows_several_views_of_what_it_has) {
  Streamed s;
  const StreamView views[] = {{0, lod::view_error(0.02f), {}}, {0, lod::view_error(0.001f), {}}};
  for (int i = 0; i < 400; ++i) s.residency.step(views, s.now += 0.01);
  std::vector<uint32_t> cuts[2];
  for (const StreamCluster& c : s.residency.cut())
    cuts[c.view].push_back(s.residency.page(c.page)->groups[c.group].group.clusters.offset +
                           c.cluster);
  for (int v = 0; v < 2; ++v) {
    std::sort(cuts[v].begin(), cuts[v].end());
    EXPECT_EQ(cuts[v], lod::select(world().asset().tables(), views[v].view));
  }
}

TEST(Residency, keeps_what_is_out_of_sight_coarse) {
  const Vec3 eye{3, 0, 0};
  const std::vector<lod::Plane> planes = lod::frustum_planes({eye, {3, 1, 0}, {0, 0, 1}, 1.0f});
  Streamed s;
  const StreamView away[] = {{0, seen_from(eye, 0.1f), planes}};
  for (int i = 0; i < 100; ++i) s.residency.step(away, s.now += 0.01);
  world().expect_whole(s.residency);
  const size_t far_off = s.residency.cut().size();
  const StreamView towards[] = {
      {0, seen_from(eye, 0.1f), lod::frustum_planes({eye, {0, 0, 0}, {0, 0, 1}, 1.0f})}};
  for (int i = 0; i < 400; ++i) s.residency.step(towards, s.now += 0.01);
  world().expect_whole(s.residency);
  EXPECT_EQ(world().clusters(s.residency), lod::select(world().asset().tables(), towards[0].view));
  EXPECT_LT(4 * far_off, s.residency.cut().size());
}

TEST(Residency, over_a_simulated_link_takes_the_time_that_it_takes) {
  const auto clock = std::make_shared<double>(0);
  const LinkModel link{0.05, 1e6, 0.1, 0.1};
  Residency residency(world().asset(), {}, make_model_loader(world().asset(), link, clock));
  const StreamView all[] = {{0, lod::view_error(0), {}}};
  int frame = 0;
  std::set<std::string> problems;
  for (; frame < 1200; ++frame) {
    *clock = frame / 60.0;
    if (residency.step(all, *clock).missing_groups == 0) break;
    problems.insert(residency.statistics().last_problem);
    world().expect_whole(residency);
  }
  // Two pages are not as much as a second's bytes, and none comes before the latency has passed.
  EXPECT_GT(*clock, static_cast<double>(world().bytes() - 40000) / 1e6);
  EXPECT_LT(frame, 1200);
  EXPECT_GT(residency.statistics().failures, 0u);
  for (const char* part : {"the link failed", "bytes, but there are", "checksum of page"})
    EXPECT_TRUE(std::any_of(problems.begin(), problems.end(), [&](const std::string& problem) {
      return problem.find(part) != std::string::npos;
    })) << part;
  EXPECT_THROW(make_model_loader(world().asset(), {-1}, clock), Error);
  EXPECT_THROW(make_model_loader(world().asset(), {.failure_rate = 1.1}, clock), Error);
  EXPECT_THROW(make_model_loader(world().asset(), {.slow_rate = -0.1}, clock), Error);
}

template <typename Work>
void expect_refusal(const char* sentence, const Work& work) {
  try {
    work();
    ADD_FAILURE() << "not refused: " << sentence;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
    EXPECT_STREQ(error.what(), sentence);
  }
}

TEST(Residency, refuses_what_cannot_be_by_its_name) {
  const auto refuses = [](const char* sentence, auto change) {
    ResidencyConfig config;
    change(config);
    expect_refusal(sentence, [&] { Residency(world().asset(), config); });
  };
  refuses("hysteresis is 0.5, but must be at least 1", [](auto& c) { c.hysteresis = 0.5f; });
  refuses("backoff_seconds is nan, but must be at least 0",
          [](auto& c) { c.backoff_seconds = std::nan(""); });
  refuses("slow_seconds is -1, but must be at least 0", [](auto& c) { c.slow_seconds = -1; });
  Residency residency(world().asset());
  const std::string pinned = std::to_string(residency.statistics().pinned_bytes);
  const std::string small = " bytes is too small: the pages of the root groups take " + pinned;
  refuses(("a budget of 100" + small).c_str(), [](auto& c) { c.budget_bytes = 100; });
  expect_refusal(("a budget of 1" + small).c_str(), [&] { residency.set_budget(1); });
  const auto refuses_view = [&](const char* sentence, const StreamView& view) {
    const StreamView views[] = {{0, lod::view_error(1), {}}, view};
    expect_refusal(sentence, [&] { residency.step(views, 0); });
  };
  const float nan = std::nanf("");
  refuses_view("views[1] is of mesh 7, but the asset has 1", {7, lod::view_error(1), {}});
  refuses_view("views[1] must be by error or by camera", {0, lod::view_level(1), {}});
  refuses_view("views[1].planes[0] is not finite", {0, lod::view_error(1), {{{nan, 0, 0}, 0}}});
  lod::View view = seen_from({0, 0, 3});
  view.eye.y = nan;
  refuses_view("views[1] has an eye that is not finite", {0, view, {}});
  view = seen_from({0, 0, 3});
  view.threshold = -1;
  refuses_view("views[1] has the threshold -1, but it must not be negative", {0, view, {}});
  view = lod::view_error(0);
  view.error = nan;
  refuses_view("views[1] has the error nan, but it must not be negative", {0, view, {}});
  expect_refusal("now is nan, but must be finite", [&] { residency.step({}, std::nan("")); });
}

TEST(Residency, takes_eyes_and_planes_of_any_finite_values) {
  Streamed s;
  const StreamView views[] = {{0, seen_from({3e38f, 3e38f, 0}), {{{3e38f, 3e38f, 3e38f}, 3e38f}}}};
  s.residency.step(views, 0);
}

}  // namespace
}  // namespace umbel
