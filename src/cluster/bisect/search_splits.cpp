#include "cluster/bisect/search_splits.hpp"

#include <algorithm>
#include <bit>
#include <limits>

namespace umbel::cluster {
namespace {

// The box of each chunk, and of all chunks before each.
__attribute__((always_inline)) inline void reduce(const Box4* boxes, const uint32_t* order,
                                                  uint32_t n, uint32_t step, Box4* chunk,
                                                  Box4* before) {
  const Float8* const all_boxes = reinterpret_cast<const Float8*>(boxes);
  *before = Box4::empty();
  Float8 all = *reinterpret_cast<const Float8*>(before);
  for (uint32_t i = 0; i < n;) {
    const uint32_t stop = n - i < step ? n : i + step;
    Float8 box = all_boxes[order[i++]];
    for (; i < stop; ++i) {
      const Float8 next = all_boxes[order[i]];
      box = box < next ? box : next;
    }
    *reinterpret_cast<Float8*>(chunk++) = box;
    all = all < box ? all : box;
    *reinterpret_cast<Float8*>(++before) = all;
  }
}

void reduce_axis_generic(const Box4* boxes, const uint32_t* order, uint32_t n, uint32_t step,
                         Box4* chunk, Box4* before) {
  reduce(boxes, order, n, step, chunk, before);
}

#if defined(__x86_64__)
__attribute__((target("avx2"))) void reduce_axis_avx2(const Box4* boxes, const uint32_t* order,
                                                      uint32_t n, uint32_t step, Box4* chunk,
                                                      Box4* before) {
  reduce(boxes, order, n, step, chunk, before);
}
#endif

// Minimums are exact: the result does not depend on the machine.
void reduce_axis(const Box4* boxes, const uint32_t* order, uint32_t n, uint32_t step, Box4* chunk,
                 Box4* before) {
#if defined(__x86_64__)
  static const bool has_avx2 = __builtin_cpu_supports("avx2");
  if (has_avx2) return reduce_axis_avx2(boxes, order, n, step, chunk, before);
#endif
  reduce_axis_generic(boxes, order, n, step, chunk, before);
}

uint32_t chunk_size(const ClusterConfig& config, uint32_t n) {
  if (config.min_items == config.max_items) return config.max_items;
  // Multiples of the step should include those of full clusters.
  if (config.coarse && n > config.max_items)
    return std::max(config.max_items / 8 * std::max(n / (config.max_items * 4), 1u), 1u);
  return std::clamp(std::bit_floor(n) / 32, 16u, 1u << 20);
}

}  // namespace

AxisSplit SplitSearch::cheapest(BlockItems& items, const SplitConstraints& constraints,
                                uint32_t begin, uint32_t end) {
  const uint32_t n = end - begin;
  const ClusterConfig& config = constraints.config;
  const uint32_t step = chunk_size(config, n);
  Node node{items, constraints, begin, n, step, fill_weights(constraints, n), {}};
  const Box4 all = reduce_chunks(node);
  node.pad = items.normalise(begin, end, all);
  if (all.longest() > 0.0f && all.longest() < 0x1p-40f)
    reduce_chunks(node);  // boxes are scaled now
  AxisSplit best{std::numeric_limits<float>::infinity()};
  evaluate_borders(node, best);
  if (config.min_items == config.max_items && n % step == 0) return best;
  if (config.coarse && best.position) return best;
  list_gaps(node, best);
  for (const Gap& gap : gaps_)
    if (gap.bound < best.cost) search_gap(node, gap, best);
  return best;
}

Box4 SplitSearch::reduce_chunks(const Node& node) {
  const uint32_t chunks = node.chunks();
  const Box4* boxes = node.items.boxes();
  Box4 all = Box4::empty();
  for (int axis = 0; axis < 3; ++axis) {
    if (before_[axis].size() < chunks + 1) {
      for (auto* array : {&before_[axis], &after_[axis]}) array->resize(chunks + 1);
      for (auto* array : {&area_before_[axis], &area_after_[axis]}) array->resize(chunks + 1);
    }
    Box4* chunk = after_[axis].data();
    Box4* before = before_[axis].data();
    reduce_axis(boxes, node.items.order(axis) + node.begin, node.n, node.step, chunk, before);
    all = before[chunks];
    chunk[chunks] = Box4::empty();
    for (uint32_t c = chunks; c-- > 0;) chunk[c].extend(chunk[c + 1]);
  }
  return all;
}

void SplitSearch::evaluate_borders(const Node& node, AxisSplit& best) {
  const uint32_t n = node.n, chunks = node.chunks();
  const bool feasible = node.constraints.feasible(n);
  const float* weights = node.weights;
  const Float4 pad = node.pad;
  for (int axis = 0; axis < 3; ++axis) {
    float* left = area_before_[axis].data();
    float* right = area_after_[axis].data();
    left[0] = right[chunks] = 0.0f;
    for (uint32_t c = 1; c < chunks; ++c) {
      left[c] = before_[axis][c].half_area(pad);
      right[c] = after_[axis][c].half_area(pad);
    }
    left[chunks] = right[0] = before_[axis][chunks].half_area(pad);
    for (uint32_t c = 1; c < chunks; ++c) {
      const uint32_t i = c * node.step;
      const float cost = left[c] * weights[i] + right[c] * weights[n - i];
      if (cost < best.cost && node.constraints.legal(i, n, feasible)) best = {cost, i, axis};
    }
  }
}

void SplitSearch::list_gaps(const Node& node, const AxisSplit& best) {
  const uint32_t n = node.n, step = node.step, chunks = node.chunks();
  const uint32_t least = node.constraints.feasible(n) ? node.constraints.config.min_items : 1;
  const float* weights = node.weights;
  gaps_.clear();
  for (int axis = 0; axis < 3; ++axis) {
    const float* left = area_before_[axis].data();
    const float* right = area_after_[axis].data();
    for (uint32_t c = 0; c < chunks; ++c) {
      const uint32_t first = c * step + 1, last = std::min((c + 1) * step, n) - 1;
      if (last < first || last < least || n - first < least) continue;
      const float bound = left[c] * weights[first] + right[c + 1] * weights[n - last];
      if (bound < best.cost) gaps_.push_back({bound, axis, c});
    }
  }
}

void SplitSearch::search_gap(const Node& node, const Gap& gap, AxisSplit& best) {
  const uint32_t n = node.n, step = node.step;
  const uint32_t* order = node.items.order(gap.axis) + node.begin;
  const Box4* boxes = node.items.boxes();
  const float* weights = node.weights;
  const Float4 pad = node.pad;
  const uint32_t start = gap.chunk * step, stop = std::min(start + step, n);
  const bool feasible = node.constraints.feasible(n);
  if (gap_areas_.size() < step) gap_areas_.resize(step);
  float* areas = gap_areas_.data();
  Box4 box = before_[gap.axis][gap.chunk];
  for (uint32_t i = start; i + 1 < stop; ++i) {
    box.extend(boxes[order[i]]);
    areas[i - start] = box.half_area(pad);
  }
  box = after_[gap.axis][gap.chunk + 1];
  for (uint32_t i = stop - 1; i > start; --i) {
    box.extend(boxes[order[i]]);
    const float cost = areas[i - 1 - start] * weights[i] + box.half_area(pad) * weights[n - i];
    if (cost < best.cost && node.constraints.legal(i, n, feasible)) best = {cost, i, gap.axis};
  }
}

const float* SplitSearch::fill_weights(const SplitConstraints& constraints, uint32_t n) {
  const float underfill_cost = constraints.underfill_cost(n);
  const uint32_t max_items = constraints.config.max_items;
  Weights& weights = weights_[underfill_cost != constraints.underfill_cost(kNone)];
  if (weights.max_items != max_items || weights.underfill_cost != underfill_cost)
    weights = {{}, max_items, underfill_cost};
  for (uint32_t i = static_cast<uint32_t>(weights.of.size()); i <= n; ++i)
    weights.of.push_back(constraints.weight(i, underfill_cost));
  return weights.of.data();
}

}  // namespace umbel::cluster
