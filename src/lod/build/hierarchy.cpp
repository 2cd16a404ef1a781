// The selection hierarchy: bounding spheres over the groups of each level, eight children to a
// node, in the order of a k-d tree, and one tree over the levels' roots (as outlined by Karis,
// "Nanite: A Deep Dive", 2021). Trees are kept apart by level because a coarse group's sphere
// contains those of the finer groups below it: mixed, every node would be as large as the mesh.
//
// Why a node that need not be refined hides nothing. Let a child have the sphere (c, r) and the
// error e, its node (C, R) and E, and let u = 2^-24. enclosing_node makes
//     R >= (|c - C| + r)(1 + m) + 4s   with m = 1e-4, s = the smallest subnormal float,
//     E >= e(1 + k) + s                with k = 1e-5, unless all errors below are 0,
// or an infinite E, always refined, where either overflows.
// For any eye, the lengths L = |eye - C| and l = |eye - c| come out with a relative error of at
// most v = 4u (each difference is rounded once, and so are squares, sums and root) and, where
// they are subnormal, an absolute one of at most s. As l >= L - |c - C|, before the subtraction
// of the radius is rounded
//     d' >= L(1 - v) - |c - C| - r - s  >=  L(1 - v) - R/(1 + m) + s,   D' <= L(1 + v) - R + s.
// - If L <= 200 R, then d' - D' >= R m/(1 + m) - 2vL >= R(0.99e-4 - 0.96e-4) > 0, and rounding is
//   monotone: d >= D.
// - Else D' >= 0.99 L, and d' >= D' - 2vL >= D'(1 - 2.1v): d(1 + 7e-7) >= D.
// Limiting lengths to the largest float keeps l >= L - |c - C|, and limiting D and d to 0 from
// below keeps their order. Now let the node need no refinement: E <= T * D, rounded. Then T * d is
// at least (T * D)/(1 + 7e-7), and rounding the products costs a factor (1 + u) each or, where
// they are subnormal, s/2; E exceeds e by more than all of that, so e <= T * d as rounded, and the
// child need not be refined either. (If T * D is infinite, T * d is at least the largest float
// over 1 + 1e-6, and e at most that over 1 + k.) With an infinite T nothing but an infinite error
// is ever too large. By induction the same holds down to the leaves.
#include "lod/build/hierarchy.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <string>

#include "base/math.hpp"
#include "lod/dag/bounds.hpp"

namespace umbel::lod {
namespace {

constexpr uint32_t kMostChildren = 8;
constexpr double kRadiusMargin = 1e-4;
constexpr double kSmallest = std::numeric_limits<float>::denorm_min();

double distance(const Vec3& a, const Vec3& b) {
  const double x = double{a.x} - b.x, y = double{a.y} - b.y, z = double{a.z} - b.z;
  return std::sqrt(x * x + y * y + z * z);
}

float axis(const Vec3& v, int i) { return i == 0 ? v.x : i == 1 ? v.y : v.z; }

int longest_axis(const std::vector<Node>& nodes, std::span<const uint32_t> order) {
  int best = 0;
  double longest = -1;
  for (int i = 0; i < 3; ++i) {
    float low = std::numeric_limits<float>::max(), high = std::numeric_limits<float>::lowest();
    for (const uint32_t n : order) {
      low = std::min(low, axis(nodes[n].sphere.center, i));
      high = std::max(high, axis(nodes[n].sphere.center, i));
    }
    if (double{high} - low > longest) longest = double{high} - low, best = i;
  }
  return best;
}

/// Orders nodes so that every aligned run of 8, of 64, of 512... is a cell of a k-d tree.
void order_spatially(const std::vector<Node>& nodes, std::span<uint32_t> order) {
  if (order.size() <= kMostChildren) return;
  size_t run = kMostChildren;
  while (run * kMostChildren < order.size()) run *= kMostChildren;
  const size_t runs = (order.size() + run - 1) / run;
  const size_t middle = runs / 2 * run;
  const int a = longest_axis(nodes, order);
  std::nth_element(order.begin(), order.begin() + middle, order.end(), [&](uint32_t x, uint32_t y) {
    const float fx = axis(nodes[x].sphere.center, a);
    const float fy = axis(nodes[y].sphere.center, a);
    return fx != fy ? fx < fy : x < y;
  });
  order_spatially(nodes, order.first(middle));
  order_spatially(nodes, order.subspan(middle));
}

/// Puts parents over `layer` until one is left, which is returned. A parent's children are
/// consecutive in `nodes`.
Node build_tree(std::vector<Node> layer, std::vector<Node>& nodes) {
  while (layer.size() > 1) {
    std::vector<Node> parents;
    parents.reserve((layer.size() + kMostChildren - 1) / kMostChildren);
    for (size_t i = 0; i < layer.size(); i += kMostChildren) {
      const size_t count = std::min<size_t>(kMostChildren, layer.size() - i);
      parents.push_back(count == 1 ? layer[i] : enclosing_node(&layer[i], count));
      if (count == 1) continue;
      parents.back().children = {static_cast<uint32_t>(nodes.size()), static_cast<uint32_t>(count)};
      nodes.insert(nodes.end(), layer.begin() + i, layer.begin() + i + count);
    }
    layer = std::move(parents);
  }
  return layer.front();
}

std::vector<Node> leaves_of_level(const Tables& tables, const Range& level) {
  std::vector<Node> leaves;
  leaves.reserve(level.count);
  for (uint32_t g = level.offset; g < level.offset + level.count; ++g)
    leaves.push_back({tables.groups[g].sphere, tables.groups[g].error, g, {0, 0}});
  std::vector<uint32_t> order(leaves.size());
  std::iota(order.begin(), order.end(), 0u);
  order_spatially(leaves, order);
  std::vector<Node> ordered;
  ordered.reserve(leaves.size());
  for (const uint32_t i : order) ordered.push_back(leaves[i]);
  return ordered;
}

void check_groups(const Tables& tables) {
  for (size_t l = 0; l < tables.levels.size(); ++l) {
    const Range& level = tables.levels[l];
    if (level.offset > tables.groups.size() || level.count > tables.groups.size() - level.offset)
      throw Error(ErrorCode::kCorrupt,
                  "level " + std::to_string(l) + " has groups from " +
                      std::to_string(level.offset) + " on, " + std::to_string(level.count) +
                      " of them, but there are " + std::to_string(tables.groups.size()));
  }
  for (size_t g = 0; g < tables.groups.size(); ++g) {
    const Group& group = tables.groups[g];
    if (!is_finite(group.sphere.center) || !(group.sphere.radius >= 0) || !(group.error >= 0))
      throw Error(ErrorCode::kCorrupt, "group " + std::to_string(g) +
                                           " has a sphere or an error that is not a number, or "
                                           "below 0");
  }
}

/// The same tree, breadth first from its root.
std::vector<Node> breadth_first(const Node& root, const std::vector<Node>& nodes) {
  std::vector<Node> out{root};
  out.reserve(nodes.size() + 1);
  for (size_t i = 0; i < out.size(); ++i) {
    const Range children = out[i].children;
    out[i].children.offset = children.count ? static_cast<uint32_t>(out.size()) : 0;
    out.insert(out.end(), nodes.begin() + children.offset,
               nodes.begin() + children.offset + children.count);
  }
  return out;
}

}  // namespace

Node enclosing_node(const Node* children, size_t count) {
  const std::span<const Node> all(children, count);
  double low[3], high[3];
  for (int i = 0; i < 3; ++i) {
    low[i] = std::numeric_limits<double>::max();
    high[i] = std::numeric_limits<double>::lowest();
    for (const Node& child : all) {
      low[i] = std::min(low[i], double{axis(child.sphere.center, i)} - child.sphere.radius);
      high[i] = std::max(high[i], double{axis(child.sphere.center, i)} + child.sphere.radius);
    }
  }
  Node node{};
  node.group = kNone;
  node.sphere.center = {static_cast<float>(0.5 * (low[0] + high[0])),
                        static_cast<float>(0.5 * (low[1] + high[1])),
                        static_cast<float>(0.5 * (low[2] + high[2]))};
  double radius = 0, error = 0;
  for (const Node& child : all) {
    radius = std::max(
        radius, distance(node.sphere.center, child.sphere.center) + double{child.sphere.radius});
    error = std::max(error, double{child.error});
  }
  node.sphere.radius = round_up(radius * (1 + kRadiusMargin) + 4 * kSmallest);
  node.error = error == 0 ? 0.0f : round_up(error * (1 + kErrorMargin) + kSmallest);
  if (!std::isfinite(node.sphere.radius)) {
    node.sphere.radius = std::numeric_limits<float>::max();
    node.error = std::numeric_limits<float>::infinity();
  }
  return node;
}

std::vector<Node> build_hierarchy(const Tables& tables) {
  check_groups(tables);
  std::vector<Node> nodes, roots;
  for (const Range& level : tables.levels)
    if (level.count) roots.push_back(build_tree(leaves_of_level(tables, level), nodes));
  if (roots.empty()) return {};
  const Node root = build_tree(std::move(roots), nodes);
  return breadth_first(root, nodes);
}

void complete(Tables& tables) {
  if (tables.levels.empty())
    for (uint32_t g = 0; g < tables.groups.size(); ++g) {
      const uint32_t level = tables.groups[g].level;
      if (level + uint64_t{1} < tables.levels.size() || level > tables.groups.size())
        throw Error(ErrorCode::kCorrupt, "group " + std::to_string(g) + " is of level " +
                                             std::to_string(level) +
                                             ", but levels must not fall, and rise one by one");
      while (tables.levels.size() <= level) tables.levels.push_back({g, 0});
      ++tables.levels.back().count;
    }
  if (tables.nodes.empty()) tables.nodes = build_hierarchy(tables);
}

}  // namespace umbel::lod
