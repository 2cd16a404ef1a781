// Trees over boxes that come and go from C, beside the C++ interface, and a caller's mistakes.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cfloat>
#include <cmath>
#include <cstring>
#include <functional>

#include "bvh/tree_tests.hpp"
#include "capi/bvh_call.hpp"
#include "umbel/dynamic_bvh.hpp"
#include "umbel/umbel_dynamic_bvh.h"

namespace umbel {
namespace {

using namespace bvh_call;
using bvh::DynamicTree;
using bvh::random_boxes;

struct FreeTree {
  void operator()(umbel_dynamic_tree* tree) const { umbel_dynamic_tree_free(tree); }
};
using OwnedTree = std::unique_ptr<umbel_dynamic_tree, FreeTree>;

const umbel_aabb* as_c(const std::vector<Aabb>& boxes) {
  return reinterpret_cast<const umbel_aabb*>(boxes.data());
}

OwnedTree built(const std::vector<Aabb>& boxes, const umbel_bvh_config* config = nullptr) {
  umbel_dynamic_tree* made = nullptr;
  EXPECT_EQ(umbel_dynamic_tree_build(as_c(boxes), boxes.size(), config, nullptr, &made), UMBEL_OK)
      << umbel_last_error();
  return OwnedTree(made);
}

umbel_dynamic_tree_quality quality_of(const OwnedTree& tree) {
  umbel_dynamic_tree_quality found;
  umbel_dynamic_tree_quality_init(&found);
  EXPECT_EQ(umbel_dynamic_tree_get_quality(tree.get(), &found), UMBEL_OK) << umbel_last_error();
  return found;
}

std::vector<uint32_t> overlaps(const OwnedTree& tree, const Aabb& region) {
  const auto given = std::bit_cast<umbel_aabb>(region);
  size_t count = 0;
  EXPECT_EQ(umbel_dynamic_tree_overlaps_box(tree.get(), &given, nullptr, 0, &count), UMBEL_OK);
  std::vector<uint32_t> found(count);
  EXPECT_EQ(umbel_dynamic_tree_overlaps_box(tree.get(), &given, found.data(), count, &count),
            UMBEL_OK);
  return found;
}

void expect_same(const OwnedTree& tree, const DynamicTree& known) {
  ASSERT_EQ(umbel_dynamic_tree_size(tree.get()), known.size());
  const umbel_dynamic_tree_quality quality = quality_of(tree);
  EXPECT_EQ(quality.sah_cost, known.quality().sah_cost);
  EXPECT_EQ(quality.built_sah_cost, known.quality().built_sah_cost);
  EXPECT_EQ(quality.rebuild_advised != 0, known.quality().rebuild_advised);
  umbel_aabb bounds;
  ASSERT_EQ(umbel_dynamic_tree_get_bounds(tree.get(), &bounds), UMBEL_OK);
  EXPECT_EQ(std::bit_cast<Aabb>(bounds), known.bounds());
  Tree arrays(known.size());
  ASSERT_EQ(umbel_dynamic_tree_snapshot(tree.get(), 4, &arrays.tree), UMBEL_OK)
      << umbel_last_error();
  const bvh::Bvh2 snapshot = known.snapshot(4);
  ASSERT_EQ(arrays.tree.node_count, snapshot.nodes.size());
  ASSERT_EQ(arrays.tree.primitive_count, snapshot.primitives.size());
  arrays.primitives.resize(snapshot.primitives.size());
  EXPECT_EQ(arrays.primitives, snapshot.primitives);
  if (!snapshot.nodes.empty())
    EXPECT_EQ(std::memcmp(arrays.nodes.data(), snapshot.nodes.data(),
                          snapshot.nodes.size() * sizeof(bvh::Node)),
              0);
}

TEST(CapiDynamicTree, changes_give_the_trees_of_cpp) {
  const std::vector<Aabb> boxes = random_boxes(1500, 1);
  const OwnedTree tree = built({});
  DynamicTree known;
  expect_same(tree, known);
  for (const Aabb& box : boxes) {
    const auto given = std::bit_cast<umbel_aabb>(box);
    uint32_t number = kNone;
    ASSERT_EQ(umbel_dynamic_tree_insert(tree.get(), &given, &number), UMBEL_OK);
    ASSERT_EQ(number, known.insert(box));
  }
  expect_same(tree, known);
  for (uint32_t i = 0; i < boxes.size(); i += 3) {
    ASSERT_EQ(umbel_dynamic_tree_remove(tree.get(), i), UMBEL_OK);
    known.remove(i);
  }
  EXPECT_EQ(umbel_dynamic_tree_contains(tree.get(), 3), 0);
  EXPECT_EQ(umbel_dynamic_tree_contains(tree.get(), 4), 1);
  for (uint32_t i = 1; i < boxes.size(); i += 3) {
    const auto given = std::bit_cast<umbel_aabb>(boxes[i - 1]);
    ASSERT_EQ(umbel_dynamic_tree_move(tree.get(), i, &given), UMBEL_OK);
    known.move(i, boxes[i - 1]);
  }
  expect_same(tree, known);
  umbel_aabb box;
  ASSERT_EQ(umbel_dynamic_tree_get_box(tree.get(), 4, &box), UMBEL_OK);
  EXPECT_EQ(std::bit_cast<Aabb>(box), boxes[3]);
  for (const Aabb& region : random_boxes(40, 2, 0.3f))
    ASSERT_EQ(overlaps(tree, region), known.overlaps(region));
}

TEST(CapiDynamicTree, builds_refits_and_rebuilds_are_those_of_cpp) {
  const std::vector<Aabb> boxes = random_boxes(3000, 3), other = random_boxes(1000, 4);
  umbel_bvh_config config;
  umbel_bvh_config_init(&config);
  ASSERT_EQ(umbel_bvh_config_builder(&config, "lbvh"), UMBEL_OK);
  config.traversal_cost = 1;
  bvh::Config same;
  same.builder = bvh::Builder::kLbvh;
  same.cost.traversal = 1;
  const OwnedTree tree = built(boxes, &config);
  DynamicTree known = DynamicTree::build(boxes, same);
  expect_same(tree, known);
  std::vector<uint32_t> some;
  for (uint32_t i = 0; i < other.size(); ++i) some.push_back(2 * i);
  ASSERT_EQ(umbel_dynamic_tree_refit(tree.get(), some.data(), as_c(other), other.size()), UMBEL_OK);
  known.refit(some, other);
  expect_same(tree, known);
  EXPECT_EQ(quality_of(tree).rebuild_advised, 1u);
  ASSERT_EQ(umbel_dynamic_tree_rebuild(tree.get(), nullptr, nullptr), UMBEL_OK);
  known.rebuild();
  expect_same(tree, known);
  EXPECT_EQ(quality_of(tree).rebuild_advised, 0u);
}

/// What a traversal's functions are given.
struct Search {
  std::vector<uint32_t> seen;
  size_t most = SIZE_MAX;
  umbel_aabb region{};
  const std::vector<Aabb>* boxes = nullptr;
  double best = INFINITY;
};

Search& search_of(void* user) { return *static_cast<Search*>(user); }

int enters(void* user, const umbel_aabb* box) {
  const umbel_aabb &a = *box, &b = search_of(user).region;
  return a.min.x <= b.max.x && a.max.x >= b.min.x && a.min.y <= b.max.y && a.max.y >= b.min.y &&
         a.min.z <= b.max.z && a.max.z >= b.min.z;
}

int visit(void* user, uint32_t primitive) {
  Search& s = search_of(user);
  s.seen.push_back(primitive);
  return s.seen.size() < s.most;
}

/// The squared distance from the region's corner.
double key(void* user, const umbel_aabb* box) {
  const umbel_vec3& p = search_of(user).region.min;
  const auto outside = [](double low, double high, double at) {
    return std::max({low - at, at - high, 0.0});
  };
  const double x = outside(box->min.x, box->max.x, p.x), y = outside(box->min.y, box->max.y, p.y),
               z = outside(box->min.z, box->max.z, p.z);
  return x * x + y * y + z * z;
}

double nearest(void* user, uint32_t primitive) {
  Search& s = search_of(user);
  s.seen.push_back(primitive);
  if (s.seen.size() >= s.most) return -INFINITY;
  const auto box = std::bit_cast<umbel_aabb>((*s.boxes)[primitive]);
  s.best = std::min(s.best, key(user, &box));
  return s.best;
}

TEST(CapiDynamicTree, traversals_visit_what_is_let_through_until_told_to_stop) {
  const std::vector<Aabb> boxes = random_boxes(2000, 5);
  const OwnedTree tree = built(boxes);
  Search search;
  search.region = {{0.2f, 0.2f, 0.2f}, {0.6f, 0.5f, 0.7f}};
  ASSERT_EQ(umbel_dynamic_tree_traverse(tree.get(), enters, visit, &search), UMBEL_OK);
  std::sort(search.seen.begin(), search.seen.end());
  EXPECT_EQ(search.seen, overlaps(tree, std::bit_cast<Aabb>(search.region)));
  ASSERT_GT(search.seen.size(), 20u);
  search.seen.clear();
  search.most = 7;
  ASSERT_EQ(umbel_dynamic_tree_traverse(tree.get(), enters, visit, &search), UMBEL_OK);
  EXPECT_EQ(search.seen.size(), 7u);
}

TEST(CapiDynamicTree, the_nearest_box_is_found_in_order) {
  const std::vector<Aabb> boxes = random_boxes(2000, 6);
  const OwnedTree tree = built(boxes);
  for (const Aabb& at : random_boxes(30, 7)) {
    Search search;
    search.region = std::bit_cast<umbel_aabb>(at);
    search.boxes = &boxes;
    double limit = 0, expected = INFINITY;
    ASSERT_EQ(umbel_dynamic_tree_traverse_ordered(tree.get(), key, nearest, &search, &limit),
              UMBEL_OK);
    for (const Aabb& box : boxes) {
      const auto given = std::bit_cast<umbel_aabb>(box);
      expected = std::min(expected, key(&search, &given));
    }
    EXPECT_EQ(search.best, expected);
    EXPECT_EQ(limit, expected);
    EXPECT_LT(search.seen.size(), 200u);
    search.seen.clear();
    search.most = 1;
    ASSERT_EQ(umbel_dynamic_tree_traverse_ordered(tree.get(), key, nearest, &search, nullptr),
              UMBEL_OK);
    EXPECT_EQ(search.seen.size(), 1u);
  }
}

/// Where the ray of a search enters boxes; nothing else is in them.
struct RaySearch {
  const std::vector<Aabb>& boxes;
  umbel_ray ray;
  std::vector<uint32_t> seen;
  float nearest = INFINITY;
};

/// In doubles; infinite where the ray passes the box.
float entry(const umbel_ray& ray, const Aabb& box) {
  double from = ray.t_min, to = ray.t_max;
  const auto clip = [&](double low, double high, double origin, double direction) {
    const double a = (low - origin) / direction, b = (high - origin) / direction;
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  };
  clip(box.min.x, box.max.x, ray.origin.x, ray.direction.x);
  clip(box.min.y, box.max.y, ray.origin.y, ray.direction.y);
  clip(box.min.z, box.max.z, ray.origin.z, ray.direction.z);
  return from <= to ? static_cast<float>(from) : INFINITY;
}

float all_hits(void* user, uint32_t primitive) {
  auto& s = *static_cast<RaySearch*>(user);
  s.seen.push_back(primitive);
  return INFINITY;
}

float nearest_hit(void* user, uint32_t primitive) {
  auto& s = *static_cast<RaySearch*>(user);
  s.seen.push_back(primitive);
  s.nearest = std::min(s.nearest, entry(s.ray, s.boxes[primitive]));
  return s.nearest;
}

float first_hit(void* user, uint32_t primitive) {
  auto& s = *static_cast<RaySearch*>(user);
  s.seen.push_back(primitive);
  return -1;
}

TEST(CapiDynamicTree, rays_meet_the_boxes_that_brute_force_finds) {
  const std::vector<Aabb> boxes = random_boxes(1500, 8, 0.1f);
  const OwnedTree tree = built(boxes);
  size_t met = 0, visited = 0;
  for (const Ray& ray : random_rays(200, 9)) {
    RaySearch all{boxes, std::bit_cast<umbel_ray>(ray), {}}, one = all, first = all;
    float limit = 0;
    ASSERT_EQ(umbel_dynamic_tree_traverse_ray(tree.get(), &all.ray, all_hits, &all, &limit),
              UMBEL_OK);
    EXPECT_EQ(limit, all.ray.t_max);
    std::sort(all.seen.begin(), all.seen.end());
    EXPECT_EQ(std::adjacent_find(all.seen.begin(), all.seen.end()), all.seen.end());
    float expected = INFINITY;
    for (uint32_t i = 0; i < boxes.size(); ++i) {
      const float t = entry(all.ray, boxes[i]);
      expected = std::min(expected, t);
      if (t < INFINITY) ASSERT_TRUE(std::binary_search(all.seen.begin(), all.seen.end(), i));
    }
    ASSERT_EQ(umbel_dynamic_tree_traverse_ray(tree.get(), &one.ray, nearest_hit, &one, &limit),
              UMBEL_OK);
    EXPECT_EQ(one.nearest, expected);
    EXPECT_EQ(limit, expected);
    ASSERT_EQ(umbel_dynamic_tree_traverse_ray(tree.get(), &first.ray, first_hit, &first, nullptr),
              UMBEL_OK);
    EXPECT_EQ(first.seen.size(), std::min<size_t>(all.seen.size(), 1));
    met += all.seen.size();
    visited += one.seen.size();
  }
  EXPECT_LT(visited, met / 2);
  RaySearch none{boxes, {{0, 0, 0}, 0, {0, 0, 0}, 2}, {}};
  float limit = 0;
  for (const umbel_ray& ray : {none.ray, umbel_ray{{kNan, 0, 0}, 0, {1, 0, 0}, 2}}) {
    ASSERT_EQ(umbel_dynamic_tree_traverse_ray(tree.get(), &ray, all_hits, &none, &limit), UMBEL_OK);
    EXPECT_EQ(limit, 2);
  }
  EXPECT_TRUE(none.seen.empty());
}

TEST(CapiDynamicTree, rays_may_have_any_finite_origin_and_direction) {
  const std::vector<Aabb> boxes{{{1e38f, 1e38f, 1e38f}, {2e38f, 2e38f, 2e38f}}};
  const OwnedTree tree = built(boxes);
  for (const umbel_ray& ray : {umbel_ray{{1.5e38f, 1.5e38f, 1.5e38f}, 0, {0, 0, -1}, INFINITY},
                               umbel_ray{{0, 0, 0}, 0, {1.5e38f, 1.5e38f, 1.5e38f}, INFINITY}}) {
    RaySearch search{boxes, ray, {}};
    ASSERT_EQ(umbel_dynamic_tree_traverse_ray(tree.get(), &ray, all_hits, &search, nullptr),
              UMBEL_OK);
    EXPECT_EQ(search.seen.size(), 1u);
  }
}

TEST(CapiDynamicTree, mistakes_are_told_and_change_nothing) {
  const std::vector<Aabb> boxes = random_boxes(100, 10);
  const OwnedTree tree = built(boxes);
  const DynamicTree known = DynamicTree::build(boxes);
  const auto box = std::bit_cast<umbel_aabb>(boxes[0]);
  umbel_aabb bad = box, inverted = box;
  bad.max.y = kNan;
  std::swap(inverted.min, inverted.max);
  uint32_t number = 7;
  expect_failure(umbel_dynamic_tree_insert(tree.get(), &bad, &number), UMBEL_ERROR_INVALID_MESH,
                 "box");
  EXPECT_EQ(number, kNone);
  expect_failure(umbel_dynamic_tree_move(tree.get(), 3, &inverted), UMBEL_ERROR_INVALID_MESH,
                 "box");
  const uint32_t some[] = {1, 100};
  expect_failure(umbel_dynamic_tree_refit(tree.get(), some, as_c(boxes), 2),
                 UMBEL_ERROR_INVALID_ARGUMENT, "100");
  expect_failure(umbel_dynamic_tree_remove(tree.get(), 100), UMBEL_ERROR_INVALID_ARGUMENT, "100");
  expect_failure(umbel_dynamic_tree_move(tree.get(), 100, &box), UMBEL_ERROR_INVALID_ARGUMENT,
                 "100");
  umbel_aabb found;
  expect_failure(umbel_dynamic_tree_get_box(tree.get(), kNone, &found),
                 UMBEL_ERROR_INVALID_ARGUMENT, "primitive");
  umbel_bvh_config config;
  umbel_bvh_config_init(&config);
  config.bins = 3;
  expect_failure(umbel_dynamic_tree_rebuild(tree.get(), &config, nullptr),
                 UMBEL_ERROR_INVALID_ARGUMENT, "bins");
  Tree arrays(boxes.size());
  expect_failure(umbel_dynamic_tree_snapshot(tree.get(), 256, &arrays.tree),
                 UMBEL_ERROR_INVALID_ARGUMENT, "max_leaf_size");
  arrays.tree.node_capacity = 10;
  expect_failure(umbel_dynamic_tree_snapshot(tree.get(), 1, &arrays.tree), UMBEL_ERROR_CAPACITY,
                 "snapshot");
  EXPECT_EQ(arrays.tree.node_count, 199u);
  arrays.expect_untouched();
  size_t count = 0;
  const umbel_aabb all{{-9, -9, -9}, {9, 9, 9}};
  expect_failure(umbel_dynamic_tree_overlaps_box(tree.get(), &all, &number, 1, &count),
                 UMBEL_ERROR_CAPACITY, "primitives");
  EXPECT_EQ(count, boxes.size());
  umbel_dynamic_tree_quality quality{};
  expect_failure(umbel_dynamic_tree_get_quality(tree.get(), &quality), UMBEL_ERROR_INVALID_ARGUMENT,
                 "quality->struct_size");
  umbel_dynamic_tree* made = tree.get();
  expect_failure(umbel_dynamic_tree_build(&bad, 1, nullptr, nullptr, &made),
                 UMBEL_ERROR_INVALID_MESH, "box");
  EXPECT_EQ(made, nullptr);
  expect_same(tree, known);
}

TEST(CapiDynamicTree, null_is_refused_by_name) {
  const OwnedTree owned = built(random_boxes(10, 11));
  umbel_dynamic_tree* const tree = owned.get();
  const umbel_aabb box{{0, 0, 0}, {1, 1, 1}};
  const umbel_ray ray{{0, 0, 0}, 0, {1, 0, 0}, 1};
  umbel_aabb out;
  uint32_t number = 0;
  size_t count = 0;
  umbel_dynamic_tree_quality quality;
  umbel_dynamic_tree_quality_init(&quality);
  umbel_bvh2 arrays;
  umbel_bvh2_init(&arrays);
  umbel_dynamic_tree* made = nullptr;
  const std::pair<std::function<umbel_result()>, const char*> calls[] = {
      {[&] { return umbel_dynamic_tree_build(nullptr, 1, nullptr, nullptr, &made); }, "boxes"},
      {[&] { return umbel_dynamic_tree_build(&box, 1, nullptr, nullptr, nullptr); }, "tree"},
      {[&] { return umbel_dynamic_tree_insert(nullptr, &box, &number); }, "tree"},
      {[&] { return umbel_dynamic_tree_insert(tree, nullptr, &number); }, "box"},
      {[&] { return umbel_dynamic_tree_insert(tree, &box, nullptr); }, "primitive"},
      {[&] { return umbel_dynamic_tree_remove(nullptr, 0); }, "tree"},
      {[&] { return umbel_dynamic_tree_move(nullptr, 0, &box); }, "tree"},
      {[&] { return umbel_dynamic_tree_move(tree, 0, nullptr); }, "box"},
      {[&] { return umbel_dynamic_tree_refit(nullptr, nullptr, nullptr, 0); }, "tree"},
      {[&] { return umbel_dynamic_tree_refit(tree, nullptr, &box, 1); }, "primitives"},
      {[&] { return umbel_dynamic_tree_refit(tree, &number, nullptr, 1); }, "boxes"},
      {[&] { return umbel_dynamic_tree_rebuild(nullptr, nullptr, nullptr); }, "tree"},
      {[&] { return umbel_dynamic_tree_get_box(nullptr, 0, &out); }, "tree"},
      {[&] { return umbel_dynamic_tree_get_box(tree, 0, nullptr); }, "box"},
      {[&] { return umbel_dynamic_tree_get_bounds(nullptr, &out); }, "tree"},
      {[&] { return umbel_dynamic_tree_get_bounds(tree, nullptr); }, "bounds"},
      {[&] { return umbel_dynamic_tree_get_quality(nullptr, &quality); }, "tree"},
      {[&] { return umbel_dynamic_tree_get_quality(tree, nullptr); }, "quality"},
      {[&] { return umbel_dynamic_tree_snapshot(nullptr, 1, &arrays); }, "tree"},
      {[&] { return umbel_dynamic_tree_snapshot(tree, 1, nullptr); }, "snapshot"},
      {[&] { return umbel_dynamic_tree_overlaps_box(nullptr, &box, nullptr, 0, &count); }, "tree"},
      {[&] { return umbel_dynamic_tree_overlaps_box(tree, nullptr, nullptr, 0, &count); }, "box"},
      {[&] { return umbel_dynamic_tree_overlaps_box(tree, &box, nullptr, 0, nullptr); }, "count"},
      {[&] { return umbel_dynamic_tree_traverse(nullptr, enters, visit, nullptr); }, "tree"},
      {[&] { return umbel_dynamic_tree_traverse(tree, nullptr, visit, nullptr); }, "enters"},
      {[&] { return umbel_dynamic_tree_traverse(tree, enters, nullptr, nullptr); }, "visit"},
      {[&] {
         return umbel_dynamic_tree_traverse_ordered(tree, nullptr, nearest, nullptr, nullptr);
       },
       "key"},
      {[&] { return umbel_dynamic_tree_traverse_ordered(tree, key, nullptr, nullptr, nullptr); },
       "search"},
      {[&] { return umbel_dynamic_tree_traverse_ray(tree, nullptr, all_hits, nullptr, nullptr); },
       "ray"},
      {[&] { return umbel_dynamic_tree_traverse_ray(tree, &ray, nullptr, nullptr, nullptr); },
       "hit"}};
  for (const auto& [call, name] : calls) {
    SCOPED_TRACE(name);
    expect_failure(call(), UMBEL_ERROR_INVALID_ARGUMENT, name);
  }
  EXPECT_EQ(made, nullptr);
  EXPECT_EQ(umbel_dynamic_tree_size(tree), 10u);
  EXPECT_EQ(umbel_dynamic_tree_size(nullptr), 0u);
  EXPECT_EQ(umbel_dynamic_tree_contains(nullptr, 0), 0);
  umbel_dynamic_tree_free(nullptr);
}

TEST(CapiDynamicTree, an_empty_tree_answers_every_query) {
  const OwnedTree tree = built({});
  Search search;
  double limit = 0;
  EXPECT_EQ(umbel_dynamic_tree_traverse(tree.get(), enters, visit, &search), UMBEL_OK);
  EXPECT_EQ(umbel_dynamic_tree_traverse_ordered(tree.get(), key, nearest, &search, &limit),
            UMBEL_OK);
  EXPECT_EQ(limit, DBL_MAX);
  const umbel_ray ray{{0, 0, 0}, 0, {1, 0, 0}, 5};
  float last = 0;
  EXPECT_EQ(umbel_dynamic_tree_traverse_ray(tree.get(), &ray, all_hits, nullptr, &last), UMBEL_OK);
  EXPECT_EQ(last, 5);
  EXPECT_TRUE(overlaps(tree, {{-1, -1, -1}, {1, 1, 1}}).empty());
  umbel_aabb bounds;
  ASSERT_EQ(umbel_dynamic_tree_get_bounds(tree.get(), &bounds), UMBEL_OK);
  EXPECT_GT(bounds.min.x, bounds.max.x);
  EXPECT_EQ(quality_of(tree).built_sah_cost, 0);
}

}  // namespace
}  // namespace umbel
