// Fuzzes the C interface of hierarchies, of kd-trees and of trees that change: the bytes become a
// mesh (NaN, infinite and huge positions, indices out of range, triangles without area among them),
// settings, rays, points and a tree that may be none. Whatever is accepted must give the hits that
// another tree over the same mesh gives, and a tree that changes must hold what went in and did not
// come out.
#include <algorithm>
#include <limits>
#include <map>
#include <memory>
#include <vector>

#include "c_interface.hpp"
#include "umbel/umbel_bvh.h"
#include "umbel/umbel_dynamic_bvh.h"
#include "umbel/umbel_kdtree.h"

namespace {

using umbel::fuzz::expect;
using umbel::fuzz::Input;
using umbel::fuzz::went_well;

struct Free {
  void operator()(umbel_bvh* bvh) const { umbel_bvh_free(bvh); }
};
using Bvh = std::unique_ptr<umbel_bvh, Free>;

class Case : public Input {
 public:
  Case(const uint8_t* data, size_t size) : Input(data, size) {
    umbel_bvh_config_init(&config);
    read_config();
    read_mesh();
    umbel_build_options_init(&options);
    options.threads = 1 + bytes.integral<uint8_t>() % 2;
    for (uint32_t i = bytes.integral_in_range<uint32_t>(0, 24); i-- > 0;) {
      rays.push_back({point(), 0, point(), std::numeric_limits<float>::infinity()});
      if (likes(4)) rays.back().t_min = number(), rays.back().t_max = number();
      points.push_back(rays.back().origin);
    }
    umbel_ray_options_init(&ray_options);
    if (likes(5)) ray_options.mask = bytes.integral<uint8_t>();
    ray_options.cull_back_faces = likes(6) ? 1 : 0;
    ray_options.threads = 1;
  }

  Bvh build(const umbel_bvh_config* with) const {
    umbel_bvh* bvh = nullptr;
    const bool ok = went_well(umbel_bvh_build(&mesh, with, &options, &bvh));
    expect(ok == (bvh != nullptr), "success without a hierarchy, or the other way around");
    return Bvh(bvh);
  }

  uint32_t triangle_count() const { return static_cast<uint32_t>(triangles_.size() / 3); }

  umbel_kdtree_config kdtree_config() {
    umbel_kdtree_config kd;
    umbel_kdtree_config_init(&kd);
    kd.builder = bytes.integral<uint8_t>() % 3;
    kd.traversal = bytes.integral<uint8_t>() % 4;
    kd.drop_invalid = config.drop_invalid;
    kd.compact = config.compact;
    kd.simd = config.simd;
    if (likes(2)) {
      kd.max_depth = bytes.integral<uint8_t>();
      kd.bad_refines = bytes.integral<uint8_t>();
      kd.bins = bytes.integral<uint8_t>();
      kd.max_references = 2 * number();
      kd.empty_bonus = number();
    }
    return kd;
  }

  void move_positions() {
    for (umbel_vec3& p : positions_)
      if (bytes.integral<uint8_t>() % 2) p = point();
    mesh.positions = positions_.data();
  }
  /// Overwrites a few words of a tree.
  template <typename Node>
  void spoil(std::vector<Node>& nodes, std::vector<uint32_t>& primitives) {
    for (uint32_t i = bytes.integral_in_range<uint32_t>(0, 3); i-- > 0;) {
      const auto value = bytes.integral<uint32_t>() >> bytes.integral<uint8_t>() % 32;
      const auto at = bytes.integral<uint16_t>();
      if (nodes.empty() || primitives.empty()) return;
      Node& node = nodes[at % nodes.size()];
      switch (bytes.integral<uint8_t>() % 4) {
        case 0:
          node.first = value;
          break;
        case 1:
          node.count = value;
          break;
        case 2:
          primitives[at % primitives.size()] = value;
          break;
        default:
          node.min = point();
      }
    }
  }

  umbel_bvh_config config;
  umbel_bvh_mesh mesh;
  umbel_build_options options;
  umbel_ray_options ray_options;
  std::vector<umbel_ray> rays;
  std::vector<umbel_vec3> points;

 private:
  void read_config() {
    config.builder = bytes.integral<uint8_t>() % 12;
    config.width = likes(1) ? 2u << bytes.integral<uint8_t>() % 3 : bytes.integral<uint8_t>();
    config.compact = bytes.integral<uint8_t>() % 2;
    config.drop_invalid = bytes.integral<uint8_t>() % 2;
    config.simd = bytes.integral<uint8_t>() % 4;
    uint32_t* const counts[] = {
        &config.max_leaf_size,   &config.max_depth,         &config.bins,
        &config.morton_bits,     &config.hlbvh_bits,        &config.ploc_radius,
        &config.treelet_size,    &config.treelet_rounds,    &config.reinsertion_rounds,
        &config.kmeans_clusters, &config.kmeans_candidates, &config.kmeans_iterations,
        &config.aac_leaf_size};
    float* const numbers[] = {&config.traversal_cost, &config.intersection_cost,
                              &config.spatial_budget, &config.spatial_overlap, &config.aac_epsilon};
    for (uint32_t i = bytes.integral_in_range<uint32_t>(0, 5); i-- > 0;)
      *counts[bytes.integral<uint8_t>() % std::size(counts)] = bytes.integral<uint8_t>();
    if (likes(2))
      *numbers[bytes.integral<uint8_t>() % std::size(numbers)] =
          bytes.integral<uint8_t>() % 2 ? bytes.probability() : number();
  }

  void read_mesh() {
    umbel_bvh_mesh_init(&mesh);
    const auto vertices = bytes.integral_in_range<uint32_t>(0, 60);
    for (uint32_t i = 0; i < vertices; ++i) positions_.push_back(point());
    const auto count = vertices == 0 ? 0 : bytes.integral_in_range<uint32_t>(0, 80);
    for (uint32_t i = 0; i < 3 * count; ++i)
      triangles_.push_back(bytes.integral<uint8_t>() % vertices);
    if (likes(7) && !triangles_.empty())
      triangles_[bytes.integral<uint8_t>() % triangles_.size()] = bytes.integral<uint32_t>();
    mesh.positions = positions_.data();
    mesh.position_count = positions_.size();
    mesh.triangles = triangles_.data();
    mesh.triangle_count = count;
    if (!likes(3)) return;
    for (uint32_t i = 0; i < count; ++i) masks_.push_back(bytes.integral<uint8_t>());
    mesh.masks = masks_.data();
  }

  std::vector<umbel_vec3> positions_;
  std::vector<uint32_t> triangles_, masks_;
};

std::vector<umbel_hit> nearest_hits(const Case& c, const umbel_bvh* bvh) {
  std::vector<umbel_hit> hits(c.rays.size());
  expect(went_well(
             umbel_bvh_intersect(bvh, c.rays.data(), c.rays.size(), &c.ray_options, hits.data())),
         "rays are refused");
  return hits;
}

bool are_equal(const umbel_hit& a, const umbel_hit& b) {
  return a.t == b.t && a.primitive == b.primitive && a.u == b.u && a.v == b.v;
}

/// Leaves of a spoilt tree may have boxes that their triangles reach out of: what is nearest is
/// then not always found.
void ask(const Case& c, const umbel_bvh* bvh, bool is_spoilt = false) {
  const size_t n = c.rays.size();
  const std::vector<umbel_hit> hits = nearest_hits(c, bvh);
  std::vector<uint8_t> flags(n);
  expect(umbel_bvh_occluded(bvh, c.rays.data(), n, &c.ray_options, flags.data()) == UMBEL_OK,
         "rays are refused");
  constexpr size_t kRoom = 3;
  std::vector<umbel_hit> all(kRoom * n);
  std::vector<uint32_t> counts(n);
  expect(umbel_bvh_all_hits(bvh, c.rays.data(), n, &c.ray_options, kRoom, all.data(),
                            counts.data()) == UMBEL_OK,
         "rays are refused");
  for (size_t i = 0; i < n; ++i) {
    const bool is_hit = hits[i].primitive != UMBEL_NONE;
    expect(!is_hit || hits[i].primitive < c.triangle_count(), "a hit of no triangle");
    expect(is_hit == (flags[i] != 0), "closest and any hit disagree");
    expect(is_hit == (counts[i] > 0), "closest and all hits disagree");
    expect(!is_hit || is_spoilt || are_equal(hits[i], all[kRoom * i]),
           "the first of all hits is another");
  }
  std::vector<umbel_closest_point> closest(n);
  std::vector<float> distances(n);
  expect(umbel_bvh_closest_point(bvh, c.points.data(), n, std::numeric_limits<float>::infinity(), 1,
                                 closest.data()) == UMBEL_OK &&
             umbel_bvh_contains(bvh, c.points.data(), n, 1, flags.data()) == UMBEL_OK &&
             umbel_bvh_signed_distance(bvh, c.points.data(), n, 1, distances.data()) == UMBEL_OK,
         "points are refused");
  for (size_t i = 0; i + 1 < n; ++i) {
    const umbel_aabb box{c.points[i], c.points[i + 1]};
    size_t count = 0;
    if (!went_well(umbel_bvh_overlaps_box(bvh, &box, nullptr, 0, &count))) continue;
    std::vector<uint32_t> found(count);
    expect(umbel_bvh_overlaps_box(bvh, &box, found.data(), count, &count) == UMBEL_OK,
           "a box is refused the second time");
    for (const uint32_t triangle : found)
      expect(triangle < c.triangle_count(), "an overlap of no triangle");
  }
  umbel_bvh_statistics statistics;
  umbel_bvh_statistics_init(&statistics);
  expect(umbel_bvh_get_statistics(bvh, &statistics) == UMBEL_OK, "no statistics");
}

void compare(const Case& c, const umbel_bvh* bvh, const umbel_bvh* other) {
  const std::vector<umbel_hit> one = nearest_hits(c, bvh), two = nearest_hits(c, other);
  for (size_t i = 0; i < one.size(); ++i)
    expect(are_equal(one[i], two[i]), "two trees give different hits");
}

/// A tree of the caller, binary or not, spoilt or not.
template <typename Node, typename Tree, typename Build, typename Make>
void widen(Case& c, Tree tree, const Build& build, const Make& make) {
  umbel_bvh2_capacity capacity;
  umbel_bvh2_capacity_init(&capacity);
  if (!went_well(umbel_bvh2_requirements(c.mesh.triangle_count, &c.config, &capacity))) return;
  std::vector<Node> nodes(capacity.nodes);
  std::vector<uint32_t> primitives(capacity.primitives);
  tree.nodes = nodes.data();
  tree.node_capacity = nodes.size();
  tree.primitives = primitives.data();
  tree.primitive_capacity = primitives.size();
  if (!went_well(build(&c.mesh, &c.config, &c.options, &tree))) return;
  nodes.resize(tree.node_count);
  primitives.resize(tree.primitive_count);
  c.spoil(nodes, primitives);
  umbel_bvh* bvh = nullptr;
  if (went_well(make(&tree, &c.mesh, &c.config, &c.options, &bvh))) ask(c, bvh, true);
  umbel_bvh_free(bvh);
}

void widen(Case& c) {
  umbel_bvh2 binary;
  umbel_bvh2_init(&binary);
  umbel_kary kary;
  umbel_kary_init(&kary);
  if (c.below(2))
    widen<umbel_bvh2_node>(c, binary, umbel_bvh2_build_triangles, umbel_bvh_from_bvh2);
  else
    widen<umbel_kary_node>(c, kary, umbel_kary_build_triangles, umbel_bvh_from_kary);
}

/// A kd-tree gives the hits that the hierarchy gives.
void compare_kdtree(Case& c, const umbel_bvh* bvh) {
  const umbel_kdtree_config config = c.kdtree_config();
  umbel_kdtree* made = nullptr;
  if (!went_well(umbel_kdtree_build(&c.mesh, &config, &c.options, &made))) return;
  const std::unique_ptr<umbel_kdtree, void (*)(umbel_kdtree*)> tree(made, umbel_kdtree_free);
  const std::vector<umbel_hit> expected = nearest_hits(c, bvh);
  const size_t n = c.rays.size();
  std::vector<umbel_hit> hits(n);
  std::vector<uint8_t> flags(n);
  for (uint32_t traversal = 0; traversal < 3; ++traversal) {
    expect(
        umbel_kdtree_set_traversal(made, traversal) == UMBEL_OK &&
            umbel_kdtree_intersect(made, c.rays.data(), n, &c.ray_options, hits.data()) ==
                UMBEL_OK &&
            umbel_kdtree_occluded(made, c.rays.data(), n, &c.ray_options, flags.data()) == UMBEL_OK,
        "rays are refused");
    for (size_t i = 0; i < n; ++i) {
      const bool is_hit = hits[i].primitive != UMBEL_NONE;
      expect(is_hit == (flags[i] != 0), "closest and any hit disagree");
      expect(!is_hit || hits[i].primitive < c.triangle_count(), "a hit of no triangle");
      if (c.is_tame()) expect(are_equal(hits[i], expected[i]), "kd-tree and hierarchy disagree");
    }
  }
  umbel_kdtree_statistics statistics;
  umbel_kdtree_statistics_init(&statistics);
  expect(umbel_kdtree_get_statistics(made, &statistics) == UMBEL_OK, "no statistics");
}

bool is_empty(const umbel_aabb& a) {
  return a.min.x > a.max.x || a.min.y > a.max.y || a.min.z > a.max.z;
}
bool meet(const umbel_aabb& a, const umbel_aabb& b) {
  return a.min.x <= b.max.x && a.max.x >= b.min.x && a.min.y <= b.max.y && a.max.y >= b.min.y &&
         a.min.z <= b.max.z && a.max.z >= b.min.z;
}

/// Boxes between points of the case, often with their corners in order.
umbel_aabb some_box(Case& c) {
  umbel_aabb box{c.point(), c.point()};
  if (c.below(8) == 0) return box;
  for (const auto side : {&umbel_vec3::x, &umbel_vec3::y, &umbel_vec3::z})
    if (box.max.*side < box.min.*side) std::swap(box.min.*side, box.max.*side);
  return box;
}

void expect_holds(Case& c, const umbel_dynamic_tree* tree,
                  const std::map<uint32_t, umbel_aabb>& boxes) {
  expect(umbel_dynamic_tree_size(tree) == boxes.size(), "a tree of another size");
  const umbel_aabb region = some_box(c);
  std::vector<uint32_t> expected, found(boxes.size());
  for (const auto& [number, box] : boxes)
    if (!is_empty(region) && meet(box, region)) expected.push_back(number);
  size_t count = 0;
  expect(umbel_dynamic_tree_overlaps_box(tree, &region, found.data(), found.size(), &count) ==
             UMBEL_OK,
         "a box is refused");
  found.resize(count);
  expect(found == expected, "other boxes overlap");
  umbel_dynamic_tree_quality quality;
  umbel_dynamic_tree_quality_init(&quality);
  expect(umbel_dynamic_tree_get_quality(tree, &quality) == UMBEL_OK, "no quality");
}

void change(Case& c) {
  umbel_dynamic_tree* made = nullptr;
  expect(umbel_dynamic_tree_build(nullptr, 0, nullptr, nullptr, &made) == UMBEL_OK, "no tree");
  const std::unique_ptr<umbel_dynamic_tree, void (*)(umbel_dynamic_tree*)> tree(
      made, umbel_dynamic_tree_free);
  std::map<uint32_t, umbel_aabb> boxes;
  for (uint32_t i = c.below(100); i-- > 0;) {
    uint32_t number = c.below(32);
    const bool is_there = boxes.count(number) > 0;
    const umbel_aabb box = some_box(c);
    switch (c.below(5)) {
      case 0:
        expect(went_well(umbel_dynamic_tree_remove(made, number)) == is_there, "taken out of none");
        boxes.erase(number);
        break;
      case 1:
        if (went_well(umbel_dynamic_tree_move(made, number, &box))) boxes.at(number) = box;
        break;
      case 2:
        if (went_well(umbel_dynamic_tree_refit(made, &number, &box, 1))) boxes.at(number) = box;
        break;
      default:
        if (!went_well(umbel_dynamic_tree_insert(made, &box, &number))) break;
        expect(boxes.emplace(number, box).second, "a number is given twice");
    }
    if (c.below(16) == 0)
      expect(umbel_dynamic_tree_rebuild(made, nullptr, &c.options) == UMBEL_OK, "no new build");
    expect_holds(c, made, boxes);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Case c(data, size);
  const Bvh bvh = c.build(&c.config);
  if (bvh) {
    ask(c, bvh.get());
    umbel_bvh_config usual;
    umbel_bvh_config_init(&usual);
    usual.drop_invalid = c.config.drop_invalid;
    const Bvh other = c.build(&usual);
    expect(other != nullptr, "one tree can be built and another not");
    if (c.is_tame()) compare(c, bvh.get(), other.get());
    compare_kdtree(c, bvh.get());
  }
  widen(c);
  if (bvh) {
    c.move_positions();
    went_well(umbel_bvh_refit(bvh.get(), &c.mesh, &c.options, nullptr));
    ask(c, bvh.get());
  }
  change(c);
  return 0;
}
