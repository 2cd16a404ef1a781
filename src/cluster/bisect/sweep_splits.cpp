#include "cluster/bisect/sweep_splits.hpp"

#include <algorithm>
#include <limits>

namespace umbel::cluster {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kMostLost = 0.6f;    ///< of a cluster's vertices, as duplicates of others'
constexpr float kLastSplits = 2.0f;  ///< how much more what is missing costs near the leaves

}  // namespace

AxisSplit SplitSweep::cheapest(BlockItems& items, BlockVertices* vertices,
                               const SplitConstraints& constraints, uint32_t most_items,
                               uint32_t begin, uint32_t end) {
  const uint32_t n = end - begin;
  for (auto* array : {&left_area_, &right_area_, &extra_, &left_weight_, &right_weight_})
    if (array->size() < n) array->resize(n);
  const Node node{items, constraints, most_items, n,
                  items.normalise(begin, end, items.bounds(begin, end))};
  ClustersOfVertices clusters{};
  uint32_t least = 0;
  if (vertices) {
    vertices->enter(items, begin, end);
    count_vertices(node, begin, *vertices);
    clusters = clusters_of_vertices(node, vertices->node_count());
    // A side of limit / arity items fits whatever they are; smaller ones are a waste.
    least = std::min({std::max(constraints.config.max_vertices / vertices->per_item(), 1u),
                      constraints.config.min_items, std::max(n / 2, 1u)});
  } else {
    weigh_items(node);
  }
  if (has_connections()) connections_.enter(items.order(0) + begin, n);
  AxisSplit best{kInfinity};
  for (int axis = 0; axis < 3; ++axis) {
    const uint32_t* order = items.order(axis) + begin;
    Box4 all;
    sweep(node, order, all);
    if (has_connections())
      add_connections(node, order, all);
    else
      std::fill_n(extra_.begin(), n, 0.0f);
    if (constraints.config.overlap_cost > 0.0f) add_overlap(node, order);
    if (vertices) weigh_vertices(node, axis, vertices->node_count(), clusters, least);
    for (uint32_t i = 0; i + 1 < n; ++i) {
      const float cost =
          left_area_[i] * left_weight_[i] + right_area_[i] * right_weight_[i] + extra_[i];
      if (cost < best.cost) best = {cost, i + 1, axis};
    }
  }
  return best;
}

void SplitSweep::sweep(const Node& node, const uint32_t* order, Box4& all) {
  const uint32_t n = node.n;
  const Box4* boxes = node.items.boxes();
  const Float4 pad = node.pad;
  Box4 left = Box4::empty(), right = left;
  for (uint32_t i = 0; i + 1 < n; ++i) {
    left.extend(boxes[order[i]]);
    left_area_[i] = left.half_area(pad);
    right.extend(boxes[order[n - 1 - i]]);
    right_area_[n - 2 - i] = right.half_area(pad);
  }
  left.extend(boxes[order[n - 1]]);
  all = left;
}

// Scaled as bisect.hpp says: by the area of the node, and as ratio cut.
void SplitSweep::add_connections(const Node& node, const uint32_t* order, const Box4& all) {
  const uint32_t n = node.n;
  connections_.sweep(order, n, extra_.data());
  const float scale = all.half_area(node.pad) * 0.25f * static_cast<float>(n);
  for (uint32_t i = 1; i < n; ++i)
    extra_[i - 1] *=
        scale * (static_cast<float>(n) / static_cast<float>(i)) / static_cast<float>(n - i);
}

void SplitSweep::add_overlap(const Node& node, const uint32_t* order) {
  const uint32_t n = node.n;
  const Box4* boxes = node.items.boxes();
  if (left_boxes_.size() < n) left_boxes_.resize(n);
  Box4 left = Box4::empty(), right = left;
  for (uint32_t i = 0; i + 1 < n; ++i) {
    left.extend(boxes[order[i]]);
    left_boxes_[i] = left;
  }
  const float overlap_cost = node.constraints.config.overlap_cost;
  for (uint32_t i = n - 1; i > 0; --i) {
    right.extend(boxes[order[i]]);
    extra_[i - 1] += overlap_cost * overlap_weight(left_boxes_[i - 1], right, n);
  }
}

// The same on every axis.
void SplitSweep::weigh_items(const Node& node) {
  const uint32_t n = node.n;
  const bool feasible = node.constraints.feasible(n);
  const float underfill_cost = node.constraints.underfill_cost(n);
  for (uint32_t i = 1; i < n; ++i) {
    const bool legal = node.constraints.legal(i, n, feasible);
    left_weight_[i - 1] = legal ? node.constraints.weight(i, underfill_cost) : kInfinity;
    right_weight_[i - 1] = node.constraints.weight(n - i, underfill_cost);
  }
}

// Unique vertices of both sides of every position.
void SplitSweep::count_vertices(const Node& node, uint32_t begin, BlockVertices& vertices) {
  const uint32_t n = node.n;
  for (int axis = 0; axis < 3; ++axis) {
    const uint32_t* order = node.items.order(axis) + begin;
    std::vector<uint32_t>&left = left_vertices_[axis], &right = right_vertices_[axis];
    if (left.size() < n) left.resize(n);
    if (right.size() < n) right.resize(n);
    vertices.reset();
    for (uint32_t i = 0, count = 0; i + 1 < n; ++i) left[i] = count += vertices.insert(order[i]);
    vertices.reset();
    for (uint32_t i = n - 1, count = 0; i > 0; --i)
      right[i - 1] = count += vertices.insert(order[i]);
  }
}

// A cut through the middle duplicates vertices in proportion to the root of their number. Two
// clusters have one such border between them, and k in a plane some k - sqrt(k), in units of the
// border that a cluster has on two of four sides.
SplitSweep::ClustersOfVertices SplitSweep::clusters_of_vertices(const Node& node,
                                                                uint32_t node_vertices) const {
  const float limit = static_cast<float>(node.constraints.config.max_vertices);
  uint32_t duplicates = kNone;
  for (int axis = 0; axis < 3; ++axis) {
    const uint32_t middle = node.n / 2 - 1;
    duplicates = std::min(
        duplicates, left_vertices_[axis][middle] + right_vertices_[axis][middle] - node_vertices);
  }
  const float halves = std::sqrt(static_cast<float>(node_vertices) / (2.0f * limit));
  const float lost = static_cast<float>(duplicates) / ((2.0f - std::sqrt(2.0f)) * halves);
  const float per_item = static_cast<float>(node_vertices) / static_cast<float>(node.n);
  const float usable = std::max(std::floor(limit / per_item + 1e-3f) * per_item, 0.5f * limit);
  return {limit, usable, std::min(lost, kMostLost * usable)};
}

void SplitSweep::ClustersNeeded::grow_to(float items, float vertices) {
  const float before = clusters;
  while (clusters * most_items < items) clusters += 1.0f;
  if (clusters != before) capacity = of.capacity(clusters);
  // The capacity grows with the clusters, by usable - lost at least.
  while (vertices > of.limit && capacity < vertices) capacity = of.capacity(clusters += 1.0f);
}

// Both kinds of what is missing count for the clusters that a side needs. Prices may exceed 1 here,
// where every position is evaluated.
void SplitSweep::weigh_vertices(const Node& node, int axis, uint32_t node_vertices,
                                const ClustersOfVertices& clusters, uint32_t least) {
  const ClusterConfig& config = node.constraints.config;
  const uint32_t n = node.n;
  const float items_per_vertex = static_cast<float>(n) / static_cast<float>(node_vertices);
  const float item_price = kLastSplits * config.underfill_cost;
  // Less than in proportion: at the highest prices clusters fill up with duplicates.
  const float cost = config.vertex_underfill_cost;
  const float vertex_price =
      kLastSplits * cost * (4.0f - 2.0f * cost) * (1.0f / 3.0f) * items_per_vertex;
  const float most = static_cast<float>(node.most_items);
  const float full = static_cast<float>(std::min(node.most_items, config.max_items));
  const auto weight = [&](uint32_t items, uint32_t vertices, ClustersNeeded& needed) {
    if (items < least) return kInfinity;
    const float i = static_cast<float>(items), v = static_cast<float>(vertices);
    needed.grow_to(i, v);
    return i + item_price * std::max(needed.clusters * full - i, 0.0f) +
           vertex_price * std::max(needed.capacity - v, 0.0f);
  };
  ClustersNeeded on_left{clusters, most}, on_right = on_left;
  for (uint32_t i = 0; i + 1 < n; ++i)
    left_weight_[i] = weight(i + 1, left_vertices_[axis][i], on_left);
  for (uint32_t i = n - 1; i-- > 0;)
    right_weight_[i] = weight(n - i - 1, right_vertices_[axis][i], on_right);
}

}  // namespace umbel::cluster
