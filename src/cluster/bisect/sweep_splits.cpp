#include "cluster/bisect/sweep_splits.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

namespace umbel::cluster {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr uint32_t kPadding = 4;     ///< of arrays that are read four at a time
constexpr float kMostLost = 0.6f;    ///< of a cluster's vertices, as duplicates of others'
constexpr float kLastSplits = 2.0f;  ///< how much more what is missing costs near the leaves

}  // namespace

AxisSplit SplitSweep::cheapest(BlockItems& items, BlockVertices* vertices,
                               const SplitConstraints& constraints, uint32_t most_items,
                               uint32_t begin, uint32_t end) {
  const uint32_t n = end - begin;
  for (auto* array : {&left_area_, &right_area_, &extra_, &left_weight_, &right_weight_, &bounds_})
    if (array->size() < n + kPadding) array->resize(n + kPadding);
  const Node node{items, constraints, most_items, n,
                  items.normalise(begin, end, items.bounds(begin, end))};
  uint32_t least = 0;
  if (vertices) {
    vertices->enter(items, begin, end);
    count_vertices(node, begin, *vertices);
    const uint32_t node_vertices = left_vertices_[0][n - 1];
    weights_.reset(node, clusters_of_vertices(node, node_vertices), node_vertices);
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
    if (vertices) {
      search_by_vertices(node, axis, least, best);
      continue;
    }
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
    std::vector<uint32_t>&left = left_vertices_[axis], &right = right_vertices_[axis];
    if (left.size() < n + kPadding) left.resize(n + kPadding);
    if (right.size() < n + kPadding) right.resize(n + kPadding);
    vertices.count_sides(node.items.order(axis) + begin, n, left.data(), right.data());
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

// Both kinds of what is missing count for the clusters that a side needs. Prices may exceed 1 here,
// where every position is a candidate.
void SplitSweep::VertexWeights::reset(const Node& node, const ClustersOfVertices& clusters,
                                      uint32_t node_vertices) {
  const ClusterConfig& config = node.constraints.config;
  node_vertices_ = static_cast<float>(node_vertices);
  items_per_vertex_ = static_cast<float>(node.n) / node_vertices_;
  clusters_ = clusters;
  most_ = static_cast<float>(node.most_items);
  full_ = static_cast<float>(std::min(node.most_items, config.max_items));
  item_price_ = kLastSplits * config.underfill_cost;
  // Less than in proportion: at the highest prices clusters fill up with duplicates.
  const float cost = config.vertex_underfill_cost;
  vertex_price_ = kLastSplits * cost * (4.0f - 2.0f * cost) * (1.0f / 3.0f) * items_per_vertex_;
  const size_t count = node.n + 1 + 2 * kPadding;
  if (items_.size() < count) items_.resize(count), capacities_.resize(count);
  float clusters_needed = 1.0f, capacity = clusters_.capacity(1.0f);
  for (uint32_t items = 0; items <= node.n; ++items) {
    const float i = static_cast<float>(items);
    while (clusters_needed * most_ < i) capacity = clusters_.capacity(clusters_needed += 1.0f);
    items_[kPadding + items] = i + item_price_ * std::max(clusters_needed * full_ - i, 0.0f);
    capacities_[kPadding + items] = capacity;
  }
}

float SplitSweep::VertexWeights::operator()(uint32_t items, uint32_t vertices) const {
  const float i = static_cast<float>(items), v = static_cast<float>(vertices);
  float clusters = 1.0f;
  while (clusters * most_ < i) clusters += 1.0f;
  // The capacity grows with the clusters, by usable - lost at least.
  float capacity = clusters_.capacity(clusters);
  while (v > clusters_.limit && capacity < v) capacity = clusters_.capacity(clusters += 1.0f);
  return i + item_price_ * std::max(clusters * full_ - i, 0.0f) +
         vertex_price_ * std::max(capacity - v, 0.0f);
}

// Below what splits cost, four at once.
void SplitSweep::bound_costs(const Node& node, int axis) {
  const uint32_t n = node.n;
  const uint32_t *left = left_vertices_[axis].data(), *right = right_vertices_[axis].data();
  const auto count4 = [](const uint32_t* p) {
    Int4 counts;
    memcpy(&counts, p, sizeof counts);
    return __builtin_convertvector(counts, Float4);
  };
  for (uint32_t i = 0; i + 1 < n; i += 4) {
    const uint32_t on_left = i + 1, on_right = n - i - 1;
    const Float4 of_left = count4(left + i), of_right = count4(right + i);
    const Float4 doubled = weights_.of_doubled(of_left, of_right);
    const Float4 left_weight =
        weights_.least(weights_.items(on_left), weights_.capacities(on_left), of_left);
    const Float4 right_weight =
        weights_.least(weights_.items_down(on_right), weights_.capacities_down(on_right), of_right);
    const Float4 cost = load4(&left_area_[i]) * (left_weight + doubled) +
                        load4(&right_area_[i]) * (right_weight + doubled);
    store4(&bounds_[i], cost + load4(&extra_[i]));
  }
}

// Few positions cost so little that it has to be known exactly. A side of less than `least` items
// is not legal.
void SplitSweep::search_by_vertices(const Node& node, int axis, uint32_t least, AxisSplit& best) {
  bound_costs(node, axis);
  const uint32_t n = node.n, begin = least - 1, end = n - least;
  const uint32_t *left = left_vertices_[axis].data(), *right = right_vertices_[axis].data();
  const float* const bounds = bounds_.data();
  const auto cost_at = [&](uint32_t i) {
    const float doubled = weights_.of_doubled(left[i], right[i]);
    return left_area_[i] * (weights_(i + 1, left[i]) + doubled) +
           right_area_[i] * (weights_(n - i - 1, right[i]) + doubled) + extra_[i];
  };
  const auto lowest = std::min_element(bounds + begin, bounds + end) - bounds;
  if (!(bounds[lowest] < best.cost)) return;
  float most = std::min(best.cost, cost_at(static_cast<uint32_t>(lowest)));
  for (uint32_t i = begin; i < end; ++i) {
    if (!(bounds[i] <= most)) continue;
    const float cost = cost_at(i);
    if (!(cost < best.cost)) continue;
    best = {cost, i + 1, axis, left[i], right[i]};
    most = std::min(most, cost);
  }
}

}  // namespace umbel::cluster
