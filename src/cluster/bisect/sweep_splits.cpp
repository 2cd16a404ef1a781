#include "cluster/bisect/sweep_splits.hpp"

#include <algorithm>
#include <limits>

namespace umbel::cluster {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

}  // namespace

AxisSplit SplitSweep::cheapest(BlockItems& items, BlockVertices& vertices,
                               const SplitConstraints& constraints, uint32_t begin, uint32_t end,
                               bool by_vertices) {
  const uint32_t n = end - begin;
  for (auto* array : {&left_area_, &right_area_, &extra_, &left_weight_, &right_weight_})
    if (array->size() < n) array->resize(n);
  const Node node{items, constraints, n, items.normalise(begin, end, items.bounds(begin, end))};
  if (by_vertices)
    vertices.enter(items, begin, end);
  else
    weigh_items(node);
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
    if (by_vertices) weigh_vertices(node, order, vertices);
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
  const float scale = node.constraints.config.overlap_cost * static_cast<float>(n);
  for (uint32_t i = n - 1; i > 0; --i) {
    right.extend(boxes[order[i]]);
    Box4 both = right;
    both.intersect(left_boxes_[i - 1]);
    if (both.extent(0) < 0.0f || both.extent(1) < 0.0f || both.extent(2) < 0.0f) continue;
    extra_[i - 1] += scale * both.half_area(Float4{});
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

void SplitSweep::weigh_vertices(const Node& node, const uint32_t* order, BlockVertices& vertices) {
  const ClusterConfig& config = node.constraints.config;
  const uint32_t n = node.n, limit = config.max_vertices;
  const float penalty = config.vertex_underfill_cost * static_cast<float>(n) /
                        static_cast<float>(vertices.node_count());
  // A side of limit / arity items fits whatever they are; smaller ones are a waste.
  const uint32_t least =
      std::min({std::max(limit / vertices.per_item(), 1u), config.min_items, std::max(n / 2, 1u)});
  const auto weight = [&](uint32_t items, uint32_t count) {
    if (items < least) return kInfinity;
    const uint32_t missing = (count + limit - 1) / limit * limit - count;
    return static_cast<float>(items) + penalty * static_cast<float>(missing);
  };
  vertices.reset();
  for (uint32_t i = 0, count = 0; i + 1 < n; ++i)
    left_weight_[i] = weight(i + 1, count += vertices.insert(order[i]));
  vertices.reset();
  for (uint32_t i = n - 1, count = 0; i > 0; --i)
    right_weight_[i - 1] = weight(n - i, count += vertices.insert(order[i]));
}

}  // namespace umbel::cluster
