// What a residency keeps from step to step is what a traversal from the roots finds.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "asset/edit_file.hpp"
#include "lod/select/cull.hpp"
#include "stream/world.hpp"

namespace umbel {
namespace {

using testing::seen_from;
using testing::Streamed;
using testing::world;

/// docs/format.md, "How to show an asset", from the roots, of the pages that are there.
class Traversal {
 public:
  Traversal(const Residency& residency, StreamView view)
      : residency_(residency), view_(std::move(view)) {
    for (const GroupRef& root : world().asset().roots()) track(root);
    for (size_t k = 0; k < open_.size(); ++k)
      for (const GroupRef& child : open_[k].children) track(child);
    for (const PageGroup& group : open_)
      for (uint32_t c = 0; c < group.clusters.size(); ++c)
        if (!is_open_.contains(group.clusters[c].generating_group))
          cut.push_back(group.group.clusters.offset + c);
    std::sort(cut.begin(), cut.end());
  }

  std::vector<uint32_t> cut;
  std::set<uint32_t> wanted_pages;
  std::set<uint32_t> missing;
  float worst = 0;
  size_t open() const { return open_.size(); }

 private:
  void track(const GroupRef& group) {
    const bool outside = group.error != std::numeric_limits<float>::infinity() &&
                         lod::is_outside(group.sphere, view_.planes);
    const float ratio = lod::times_too_large(group.sphere, group.error, view_.view);
    if (outside || ratio == 0) return;
    wanted_pages.insert(group.page);
    const auto page = residency_.page(group.page);
    if (!page) {
      missing.insert(group.group);
      worst = std::max(worst, ratio);
    }
    if (++met_[group.group] < group.parents || !page || is_open_.contains(group.group)) return;
    for (const PageGroup& there : page->groups)
      if (there.id == group.group) open_.push_back(there);
    is_open_.insert(group.group);
  }

  const Residency& residency_;
  StreamView view_;
  std::vector<PageGroup> open_;
  std::set<uint32_t> is_open_;
  std::map<uint32_t, uint32_t> met_;
};

void expect_as_traversed(const Streamed& s, const StreamView& view, const StreamStep& step) {
  const Traversal expected(s.residency, view);
  ASSERT_TRUE(step.caught_up);
  ASSERT_EQ(world().clusters(s.residency), expected.cut);
  ASSERT_EQ(step.open_groups, expected.open());
  ASSERT_EQ(step.missing_groups, expected.missing.size());
  ASSERT_NEAR(step.worst_error, expected.worst, 0.03f * expected.worst);
  const std::vector<uint32_t> wanted = s.residency.wanted_pages();
  ASSERT_EQ(std::set<uint32_t>(wanted.begin(), wanted.end()), expected.wanted_pages);
}

StreamView looking(const Vec3& eye, const Vec3& at, float pixels) {
  return {0, seen_from(eye, pixels), lod::frustum_planes({eye, at, {0, 0, 1}, 1.0f})};
}

using Path = std::function<StreamView(int)>;

Vec3 round_about(float turn, float radius) {
  return {radius * std::cos(turn), radius * std::sin(turn), 0.4f * std::sin(3 * turn)};
}

/// Ways of moving, by frame.
std::vector<Path> paths() {
  const auto circling = [](int i) {
    const float t = 0.004f * static_cast<float>(i);
    return StreamView{0, seen_from(round_about(t, 1.2f + 0.3f * std::sin(5 * t)), 0.4f), {}};
  };
  const auto looking_ahead = [](int i) {
    const float t = 0.01f * static_cast<float>(i);
    return looking(round_about(t, 1.5f), round_about(t + 1, 0.7f), 0.5f);
  };
  const auto turning = [](int i) {
    const float t = 0.03f * static_cast<float>(i);
    return looking({1.4f, 0, 0.1f}, {1.4f - std::cos(t), std::sin(t), 0.1f}, 0.3f);
  };
  const auto approaching = [](int i) {
    return looking({4 - 0.02f * static_cast<float>(i), 0.1f, 0}, {0, 0, 0}, 0.5f);
  };
  const auto asking_more_and_less = [](int i) {
    const float t = 0.02f * static_cast<float>(i);
    return StreamView{0, seen_from(round_about(0.1f * t, 1.5f), 1 + 0.8f * std::sin(t)), {}};
  };
  const auto leaping = [](int i) {
    std::minstd_rand random(static_cast<uint32_t>(i / 7 + 1));
    const auto any = [&] { return static_cast<float>(random() % 1000) / 250 - 2; };
    if (i % 21 == 20) return StreamView{0, lod::view_error(0.01f), {}};
    return looking({any(), any(), any()}, {any(), any(), any()}, 0.2f + std::abs(any()));
  };
  return {circling, looking_ahead, turning, approaching, asking_more_and_less, leaping};
}

TEST(CutTracker, shows_what_a_traversal_from_the_roots_does_at_every_step_of_any_path) {
  size_t number = 0;
  for (const Path& path : paths()) {
    SCOPED_TRACE("path " + std::to_string(number++));
    for (const double share : {0.15, 0.4, 2.0}) {
      ResidencyConfig config;
      config.budget_bytes = static_cast<uint64_t>(share * static_cast<double>(world().bytes()));
      config.groups_per_step = 1u << 30;
      Streamed s(config);
      s.postman->per_poll = 2;
      for (int i = 0; i < 200; ++i) {
        const StreamView view[] = {path(i)};
        const StreamStep step = s.residency.step(view, s.now += 1.0 / 60);
        ASSERT_NO_FATAL_FAILURE(expect_as_traversed(s, view[0], step)) << "frame " << i;
      }
      world().expect_whole(s.residency);
    }
  }
}

TEST(CutTracker, is_whole_and_in_time_the_same_if_each_step_evaluates_few_groups) {
  for (const Path& path : paths()) {
    ResidencyConfig config;
    config.groups_per_step = 20;
    config.budget_bytes = world().bytes() / 2;
    Streamed s(config);
    int behind = 0;
    StreamView view[1];
    for (int i = 0; i < 100; ++i) {
      view[0] = path(i);
      behind += !s.residency.step(view, s.now += 1.0 / 60).caught_up;
      world().expect_whole(s.residency);
    }
    EXPECT_GT(behind, 0);
    StreamStep step;
    for (int i = 0; i < 1000; ++i) step = s.residency.step(view, s.now += 1.0 / 60);
    ASSERT_NO_FATAL_FAILURE(expect_as_traversed(s, view[0], step));
  }
}

TEST(CutTracker, evaluates_few_groups_again_when_a_camera_circles) {
  ResidencyConfig config;
  Streamed s(config);
  const Path circling = paths()[0];
  StreamView view[] = {circling(0)};
  StreamStep step;
  for (int i = 0; i < 400; ++i) step = s.residency.step(view, s.now += 1.0 / 60);
  ASSERT_EQ(step.missing_groups, 0u);
  EXPECT_EQ(step.evaluated, 0u);  // at rest, at nothing
  uint64_t evaluated = 0;
  const auto eye = view[0].view.eye;
  for (int i = 1; i <= 200; ++i) {
    view[0].view.eye = {eye.x + 0.0005f * static_cast<float>(i), eye.y, eye.z};
    evaluated += s.residency.step(view, s.now += 1.0 / 60).evaluated;
  }
  EXPECT_GT(evaluated, 0u);
  EXPECT_LT(evaluated / 200, step.open_groups / 10);
}

TEST(CutTracker, follows_views_that_come_change_and_go) {
  Streamed s;
  std::mt19937 random(5);
  std::vector<StreamView> views;
  for (int i = 0; i < 200; ++i) {
    if (random() % 5 == 0) views.resize(random() % 5);
    for (StreamView& view : views)
      if (random() % 3 == 0)
        view = paths()[random() % paths().size()](static_cast<int>(random() % 200));
    s.residency.step(views, s.now += 1.0 / 60);
    std::vector<std::vector<uint32_t>> cuts(views.size());
    for (const StreamCluster& c : s.residency.cut())
      cuts.at(c.view).push_back(s.residency.page(c.page)->groups[c.group].group.clusters.offset +
                                c.cluster);
    for (size_t v = 0; v < views.size(); ++v) {
      std::sort(cuts[v].begin(), cuts[v].end());
      ASSERT_EQ(cuts[v], Traversal(s.residency, views[v]).cut) << "step " << i;
    }
  }
}

TEST(CutTracker, follows_a_camera_that_comes_from_far_away) {
  for (const float far : {1e5f, 1e12f, 1e17f, 1e30f}) {
    Streamed s;
    StreamView view[] = {{0, seen_from({far, 0, 0}), {}}};
    StreamStep step;
    for (int i = 0; i < 30; ++i) s.residency.step(view, s.now += 1.0 / 60);
    for (const float near : {2.0f, 1.2f, 1.1f}) {
      view[0].view = seen_from({near, 0, 0});
      for (int i = 0; i < 300; ++i) step = s.residency.step(view, s.now += 1.0 / 60);
      ASSERT_NO_FATAL_FAILURE(expect_as_traversed(s, view[0], step)) << far;
    }
  }
}

/// References that lie: of groups that are elsewhere, in circles, with other parents.
TEST(CutTracker, shows_something_of_any_file_whose_checksums_are_right) {
  const testing::Scratch scratch;
  testing::write_pages(scratch / "a.umbel", shapes::blob(4, 1), {16, 2, 4, 4096});
  const std::vector<char> whole = testing::read_bytes(scratch / "a.umbel");
  const size_t header_end = testing::get(whole, 24, 8);
  std::mt19937 random(3);
  size_t shown = 0;
  for (int run = 0; run < 150; ++run) {
    std::vector<char> bytes = whole;
    for (int change = 0; change < 40; ++change) {
      // A group, a page, or a number of parents or references becomes another that is in range.
      const size_t page = header_end + random() % ((bytes.size() - header_end) / 4096) * 4096;
      const size_t at = page + 16 + random() % 200 * 4;
      const uint64_t old = testing::get(bytes, at, 4);
      if (old < 1000) testing::put(bytes, at, 4, random() % 3 == 0 ? random() % 60 : old + 1);
    }
    testing::repair_checksums(bytes);
    testing::write_bytes(scratch / "b.umbel", bytes);
    try {
      const Asset asset(scratch / "b.umbel");
      uint64_t all = 0;
      for (uint32_t p = 0; p < asset.info().pages; ++p) all += asset.page_bytes(p);
      ResidencyConfig config;
      config.budget_bytes = all / 2;
      config.attempts = 1;
      auto* postman = new testing::Postman(asset);
      postman->forgives = true;
      Residency residency(asset, config, std::unique_ptr<PageLoader>(postman));
      for (int i = 0; i < 60; ++i) {
        const StreamView views[] = {paths()[static_cast<size_t>(i / 10)](i)};
        residency.step(views, i);
        for (const StreamCluster& c : residency.cut()) ASSERT_NE(residency.page(c.page), nullptr);
        shown += residency.cut().size();
      }
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCorrupt) << error.what();
    }
  }
  EXPECT_GT(shown, 10'000u);
}

}  // namespace
}  // namespace umbel
