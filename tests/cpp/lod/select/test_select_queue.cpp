#include <gtest/gtest.h>

#include <set>

#include "../../../../bench/ply_reader.hpp"
#include "asset/scratch.hpp"
#include "data_folder.hpp"
#include "lod/select/selection.hpp"
#include "lod/synthetic_dag.hpp"
#include "umbel/asset.hpp"
#include "umbel/stream.hpp"

namespace umbel::cuda {
namespace {

using lod::testing::Extent;
using lod::testing::Random;
using testing::all_room;
using testing::selected;
using testing::Selection;

// Turned, stretched and moved within a cube of `reach`.
Transform random_transform(Random& random, double reach) {
  Transform t;
  const double a = random.between(0, 6.3), b = random.between(0, 6.3);
  const double size = random.log_between(0.2, 5);
  const double s[3] = {size, random.below(3) ? size : size * random.between(0.5, 2),
                       random.below(4) ? size : -size};
  const double turn[3][3] = {{std::cos(a), -std::sin(a), 0},
                             {std::cos(b) * std::sin(a), std::cos(b) * std::cos(a), -std::sin(b)},
                             {std::sin(b) * std::sin(a), std::sin(b) * std::cos(a), std::cos(b)}};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) t.rows[4 * i + j] = static_cast<float>(turn[i][j] * s[j]);
    t.rows[4 * i + 3] = static_cast<float>(random.between(-reach, reach));
  }
  return t;
}

std::vector<Transform> random_transforms(Random& random, size_t count, double reach) {
  std::vector<Transform> all(count);
  for (Transform& t : all) t = random_transform(random, reach);
  return all;
}

std::vector<lod::Plane> random_frustum(Random& random, const Vec3& eye) {
  const Camera camera{eye, random.point(), {0.1f, 0.2f, 1}, 1.0f};
  const auto aspect = static_cast<float>(random.between(0.5, 2));
  return random.below(2) ? lod::frustum_planes(camera, aspect, 0, 30)
                         : lod::frustum_planes(camera, aspect);
}

void expect_same(const lod::InstanceCuts& cuts, const lod::InstanceCuts& expected) {
  EXPECT_EQ(cuts.offsets, expected.offsets);
  EXPECT_EQ(cuts.clusters, expected.clusters);
}

const lod::Dag& blob() {
  static const lod::Dag dag = lod::build(shapes::blob(5, 7).view(), lod::testing::small_config());
  return dag;
}

TEST(DeviceSelect, cuts_of_instances_are_those_of_the_processor) {
  Random random(1);
  const auto normal_cones = lod::normal_cone_bounds(blob().tables, lod::testing::reader_of(blob()));
  std::set<size_t> sizes;
  for (int round = 0; round < 24; ++round) {
    const auto instances = random_transforms(random, 100, 20);
    const Vec3 p = random.point();
    const Vec3 eye{p.x * 20, p.y * 20, p.z * 20};
    const auto planes = random_frustum(random, eye);
    lod::Culling culling;
    if (round % 3) culling.planes = planes;
    if (round % 2) culling.normal_cones = normal_cones;
    const lod::View view =
        lod::testing::camera(eye, static_cast<float>(random.log_between(1e-4, 1e-1)));
    const Selection s = selected({blob().tables, culling.normal_cones}, view, culling.planes,
                                 instances, all_room(blob().tables, instances.size()));
    expect_same(s.cuts, lod::select_instances(blob().tables, view, culling, instances));
    EXPECT_EQ(s.counts.overflow, 0u);
    EXPECT_EQ(s.counts.refused, 0u);
    EXPECT_EQ(s.counts.clusters, s.cuts.clusters.size());
    sizes.insert(s.cuts.clusters.size());
  }
  EXPECT_GT(sizes.size(), 20u);
}

TEST(DeviceSelect, errors_and_levels_are_views_too) {
  Random random(2);
  const auto instances = random_transforms(random, 50, 5);
  const lod::View views[] = {lod::view_error(0), lod::view_error(0.01f), lod::view_level(0),
                             lod::view_level(2), lod::view_level(99)};
  for (const lod::View& view : views)
    expect_same(selected({blob().tables}, view, {}, instances, all_room(blob().tables, 50)).cuts,
                lod::select_instances(blob().tables, view, {}, instances));
}

// Where rounding decides, in the meshes' own space and seen through transforms.
TEST(DeviceSelect, cuts_are_the_same_where_rounding_decides) {
  Random random(3);
  for (const double scale : {1e-20, 1.0, 1e20}) {
    const Extent extent{scale, {}};
    const lod::Tables tables = lod::testing::random_tables(4, 300, extent);
    for (int i = 0; i < 100; ++i) {
      const lod::View view = lod::testing::random_camera(random, tables, extent);
      auto instances = random_transforms(random, 3, scale);
      instances.emplace_back();
      expect_same(selected({tables}, view, {}, instances, all_room(tables, 4)).cuts,
                  lod::select_instances(tables, view, {}, instances));
    }
  }
}

TEST(DeviceSelect, the_number_of_threads_changes_nothing) {
  Random random(4);
  const auto instances = random_transforms(random, 2000, 60);
  const lod::View view = lod::testing::camera({1, 2, 3}, 2e-3f);
  const auto planes = random_frustum(random, view.eye);
  const SelectionRoom room = all_room(blob().tables, 2000);
  Selection one, many;
  with_threads(1, [&] { one = selected({blob().tables}, view, planes, instances, room); });
  with_threads(7, [&] { many = selected({blob().tables}, view, planes, instances, room); });
  expect_same(many.cuts, one.cuts);
  expect_same(one.cuts, lod::select_instances(blob().tables, view, {planes, {}}, instances));
  EXPECT_EQ(many.counts.groups, one.counts.groups);
  EXPECT_EQ(many.counts.queue, one.counts.queue);
  EXPECT_GT(one.cuts.clusters.size(), 2000u);
}

TEST(DeviceSelect, what_has_no_room_is_said_and_asked_for) {
  Random random(5);
  const auto instances = random_transforms(random, 40, 4);
  const lod::View view = lod::view_error(0.002f);
  const SelectionRoom room = all_room(blob().tables, 40);
  const Selection all = selected({blob().tables}, view, {}, instances, room);
  const SelectionRoom exact{all.counts.queue, all.counts.groups, all.counts.clusters};
  expect_same(selected({blob().tables}, view, {}, instances, exact).cuts, all.cuts);
  const auto expect_none = [&](SelectionRoom less, uint32_t overflow) {
    const Selection s = selected({blob().tables}, view, {}, instances, less);
    EXPECT_TRUE(s.counts.overflow & overflow) << s.counts.overflow;
    EXPECT_EQ(s.cuts.offsets, std::vector<uint32_t>(41, 0));
    return s.counts;
  };
  EXPECT_EQ(expect_none({exact.queue, exact.groups, exact.clusters - 1}, kClustersFull).clusters,
            exact.clusters);
  EXPECT_EQ(expect_none({exact.queue, exact.groups - 1, exact.clusters}, kGroupsFull).groups,
            exact.groups);
  expect_none({exact.queue - 1, exact.groups, exact.clusters}, kQueueFull);
  expect_none({0, 0, 0}, kQueueFull);
}

TEST(DeviceSelect, instances_that_cannot_be_seen_are_refused_alone) {
  Random random(6);
  auto instances = random_transforms(random, 30, 4);
  const lod::View view = lod::testing::camera({1, 0, 0}, 0.01f);
  instances[3].rows[0] = std::numeric_limits<float>::quiet_NaN();
  instances[7].rows.fill(0);
  instances[9].rows = {1e-38f, 0, 0, 3e38f, 0, 1e-38f, 0, 0, 0, 0, 1e-38f, 0};
  for (const int k : {0, 1, 2}) instances[20].rows[k] = 0;
  const Selection s = selected({blob().tables}, view, {}, instances, all_room(blob().tables, 30));
  EXPECT_EQ(s.counts.refused, 4u);
  for (size_t i = 0; i < instances.size(); ++i) {
    const std::vector<uint32_t> cut(s.cuts.clusters.begin() + s.cuts.offsets[i],
                                    s.cuts.clusters.begin() + s.cuts.offsets[i + 1]);
    const bool is_refused = i == 3 || i == 7 || i == 9 || i == 20;
    EXPECT_EQ(cut, is_refused
                       ? std::vector<uint32_t>{}
                       : lod::select_hierarchy(blob().tables, to_object(view, instances[i])));
  }
}

TEST(DeviceSelect, nothing_gives_nothing) {
  const lod::Tables none;
  const Selection empty =
      selected({none}, lod::view_error(1), {}, std::vector<Transform>(3), {5, 5, 5});
  EXPECT_EQ(empty.cuts.offsets, std::vector<uint32_t>(4, 0));
  const Selection no_instances = selected({blob().tables}, lod::view_error(1), {}, {}, {5, 5, 5});
  EXPECT_EQ(no_instances.cuts.offsets, std::vector<uint32_t>(1, 0));
  EXPECT_EQ(no_instances.counts.overflow, 0u);
}

// ---- real meshes --------------------------------------------------------------------------

lod::Dag real_dag(const char* name) {
  const std::filesystem::path path = umbel::testing::data_folder() / name;
  if (!std::filesystem::exists(path)) return {};
  return lod::build(bench::read_ply(path.string()).view());
}

TEST(DeviceSelect, thousands_of_instances_of_a_real_mesh) {
  const lod::Dag dag = real_dag("bunny_69k.ply");
  if (dag.tables.groups.empty()) GTEST_SKIP() << "there are no meshes here";
  Random random(8);
  const auto instances = random_transforms(random, 4000, 3);
  for (const float threshold : {1e-6f, 1e-4f}) {
    const lod::View view = lod::testing::camera({0.5f, 2, 1}, threshold);
    const auto planes = random_frustum(random, view.eye);
    const Selection s =
        selected({dag.tables}, view, planes, instances, all_room(dag.tables, instances.size()));
    expect_same(s.cuts, lod::select_instances(dag.tables, view, {planes, {}}, instances));
    EXPECT_GT(s.counts.clusters, 1000u);
  }
}

// ---- residency ----------------------------------------------------------------------------

/// An asset in small pages, and which page each group is in.
struct Paged {
  umbel::testing::Scratch scratch;
  Asset asset = written();
  std::vector<uint32_t> page_of_group = std::vector<uint32_t>(asset.tables().groups.size());

  Paged() {
    for (uint32_t p = 0; p < asset.info().pages; ++p)
      for (const PageGroup& group : asset.read_page(p).groups) page_of_group[group.id] = p;
  }
  testing::Pages with(const std::vector<uint32_t>& resident) const {
    testing::Pages pages{page_of_group, std::vector<uint8_t>(asset.info().pages, 0)};
    for (const uint32_t p : resident) pages.resident[p] = 1;
    return pages;
  }

 private:
  Asset written() {
    AssetConfig stored;
    stored.page_bytes = 8192;
    write_asset(scratch / "a.umbel",
                lod::build(shapes::blob(6, 3).view(), lod::testing::small_config()), "{}", {},
                stored);
    return Asset(scratch / "a.umbel");
  }
};

std::vector<uint32_t> cut_of(const Residency& residency) {
  std::vector<uint32_t> cut;
  for (const StreamCluster& c : residency.cut())
    cut.push_back(residency.page(c.page)->groups[c.group].group.clusters.offset + c.cluster);
  std::sort(cut.begin(), cut.end());
  return cut;
}

TEST(DeviceSelect, what_is_shown_and_wanted_is_what_residency_shows_and_wants) {
  const Paged paged;
  const lod::Tables& tables = paged.asset.tables();
  uint64_t bytes = 0;
  for (uint32_t p = 0; p < paged.asset.info().pages; ++p) bytes += paged.asset.page_bytes(p);
  ResidencyConfig config;
  config.budget_bytes = bytes / 4;
  config.threads = 1;
  config.loads_in_flight = 3;
  LinkModel link;
  const auto clock = std::make_shared<double>(0);
  Residency residency(paged.asset, config, make_model_loader(paged.asset, link, clock));
  Random random(9);
  size_t missing = 0, partial = 0;
  for (int step = 0; step < 120; ++step) {
    const auto a = static_cast<float>(0.05 * step);
    const lod::View view = lod::view_camera({2 * std::cos(a), 2 * std::sin(a), 0.3f}, 1, 600, 1);
    const StreamView seen[] = {{0, view, {}}};
    residency.step(seen, *clock);
    *clock += 1.0 / 30;
    testing::Pages pages = paged.with(residency.resident_pages());
    const Transform here[1];
    const Selection s = selected({tables}, view, {}, here, all_room(tables, 1), &pages);
    ASSERT_EQ(s.cuts.clusters, cut_of(residency));
    std::vector<uint32_t> wanted;
    for (uint32_t p = 0; p < s.urgencies.size(); ++p)
      if (s.urgencies[p] > 0) wanted.push_back(p);
    ASSERT_EQ(wanted, residency.wanted_pages());
    std::vector<uint32_t> absent;
    for (const uint32_t p : wanted)
      if (!pages.resident[p]) absent.push_back(p);
    ASSERT_EQ(s.requests, absent);
    missing += absent.size();
    partial += s.cuts.clusters != lod::select(tables, view);
  }
  EXPECT_GT(missing, 100u);
  EXPECT_GT(partial, 10u);
}

// Whatever pages are there, by the definition.
TEST(DeviceSelect, residency_and_urgency_are_as_defined) {
  const Paged paged;
  const lod::Tables& tables = paged.asset.tables();
  Random random(10);
  for (int round = 0; round < 12; ++round) {
    testing::Pages pages = paged.with({});
    for (uint8_t& r : pages.resident) r = random.below(10) < 3u + round % 7;
    // Groups made from a group.
    std::vector<std::set<uint32_t>> coarser(tables.groups.size());
    for (const lod::Cluster& c : tables.clusters)
      if (c.generating_group != kNone) coarser[c.generating_group].insert(c.group);
    std::vector<bool> shown(tables.groups.size());
    std::vector<bool> reachable(tables.groups.size());
    for (size_t g = tables.groups.size(); g-- > 0;) {  // coarser ones come later
      shown[g] = pages.resident[pages.of_group[g]];
      reachable[g] = coarser[g].empty();
      for (const uint32_t c : coarser[g]) {
        shown[g] = shown[g] && shown[c];
        reachable[g] = reachable[g] || shown[c];
      }
    }
    const auto instances = random_transforms(random, 20, 5);
    const lod::View view =
        lod::testing::camera({1, 2, 0}, static_cast<float>(random.log_between(1e-3, 1e-2)));
    const auto planes = random_frustum(random, view.eye);
    const Selection s =
        selected({tables}, view, planes, instances, all_room(tables, instances.size()), &pages);
    std::vector<float> urgencies(pages.resident.size(), 0);
    for (size_t i = 0; i < instances.size(); ++i) {
      const lod::View seen = to_object(view, instances[i]);
      const auto own = lod::to_object(planes, instances[i]);
      std::vector<uint32_t> cut;
      for (uint32_t g = 0; g < tables.groups.size(); ++g) {
        const lod::Group& group = tables.groups[g];
        if (!must_refine(group, seen) || lod::is_outside(group.sphere, own)) continue;
        if (reachable[g])
          urgencies[pages.of_group[g]] = std::max(
              urgencies[pages.of_group[g]], lod::times_too_large(group.sphere, group.error, seen));
        if (!shown[g]) continue;
        for (uint32_t c = group.clusters.offset; c < group.clusters.offset + group.clusters.count;
             ++c) {
          const uint32_t from = tables.clusters[c].generating_group;
          const bool is_finer =
              from != kNone && shown[from] && must_refine(tables.groups[from], seen);
          if (!is_finer && !lod::is_outside(tables.clusters[c].box, own)) cut.push_back(c);
        }
      }
      const std::vector<uint32_t> found(s.cuts.clusters.begin() + s.cuts.offsets[i],
                                        s.cuts.clusters.begin() + s.cuts.offsets[i + 1]);
      ASSERT_EQ(found, cut);
    }
    EXPECT_EQ(s.urgencies, urgencies);
  }
}

}  // namespace
}  // namespace umbel::cuda
