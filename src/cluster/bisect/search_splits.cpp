// The cheapest split by the surface area heuristic, exactly, without sweeping every item.
//
// The items of an order are taken in chunks. At the borders between chunks the boxes before and
// after, and so the cost, are known. Before a position inside a chunk lies at least what lies
// before the chunk, and after it at least what lies after; item weights grow with their number.
// That bounds the cost from below, and only chunks whose bound is below the best cost are swept.
#include <algorithm>
#include <bit>
#include <limits>

#include "cluster/bisect/block.hpp"

namespace umbel::cluster {
namespace {

// The box of each chunk, and of all chunks before each.
__attribute__((always_inline)) inline void reduce(const BoxRecord* boxes, const uint32_t* order,
                                                  uint32_t n, uint32_t step, BoxRecord* chunk,
                                                  BoxRecord* before) {
  const Float8* const all_boxes = reinterpret_cast<const Float8*>(boxes);
  *before = BoxRecord::empty();
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

void reduce_axis_generic(const BoxRecord* boxes, const uint32_t* order, uint32_t n, uint32_t step,
                         BoxRecord* chunk, BoxRecord* before) {
  reduce(boxes, order, n, step, chunk, before);
}

#if defined(__x86_64__)
__attribute__((target("avx2"))) void reduce_axis_avx2(const BoxRecord* boxes, const uint32_t* order,
                                                      uint32_t n, uint32_t step, BoxRecord* chunk,
                                                      BoxRecord* before) {
  reduce(boxes, order, n, step, chunk, before);
}
#endif

// Minimums are exact: the result does not depend on the machine.
void reduce_axis(const BoxRecord* boxes, const uint32_t* order, uint32_t n, uint32_t step,
                 BoxRecord* chunk, BoxRecord* before) {
#if defined(__x86_64__)
  static const bool has_avx2 = __builtin_cpu_supports("avx2");
  if (has_avx2) return reduce_axis_avx2(boxes, order, n, step, chunk, before);
#endif
  reduce_axis_generic(boxes, order, n, step, chunk, before);
}

}  // namespace

Block::Split Block::cheapest(uint32_t begin, uint32_t end) {
  const uint32_t n = end - begin;
  const ClusterConfig& config = constraints_.config;
  if (connection_cost_.active() || config.overlap_cost > 0.0f || n <= most_items_)
    return cheapest_by_sweep(begin, end);
  fill_weights(n);
  const uint32_t step = chunk_size(n);
  const BoxRecord all = reduce_chunks(begin, n, step);
  if (all.longest() > 0.0f && all.longest() < 0x1p-40f) {
    normalise(begin, end, all);
    reduce_chunks(begin, n, step);
  } else {
    normalise(begin, end, all);
  }
  Split best{std::numeric_limits<float>::infinity()};
  weigh_borders(n, step, best);
  if (config.min_items == config.max_items && n % step == 0) return best;
  if (config.coarse && best.position) return best;
  list_gaps(n, step, best);
  for (const Gap& gap : gaps_)
    if (gap.bound < best.cost) search_gap(begin, n, step, gap, best);
  return best;
}

uint32_t Block::chunk_size(uint32_t n) const {
  const ClusterConfig& config = constraints_.config;
  if (config.min_items == config.max_items) return config.max_items;
  // Multiples of the step should include those of full clusters.
  if (config.coarse && n > config.max_items)
    return std::max(config.max_items / 8 * std::max(n / (config.max_items * 4), 1u), 1u);
  return std::clamp(std::bit_floor(n) / 32, 16u, 1u << 20);
}

BoxRecord Block::reduce_chunks(uint32_t begin, uint32_t n, uint32_t step) {
  const uint32_t chunks = (n + step - 1) / step;
  const BoxRecord* boxes = boxes_.data();
  BoxRecord all = BoxRecord::empty();
  for (int axis = 0; axis < 3; ++axis) {
    if (before_[axis].size() < chunks + 1) {
      for (auto* array : {&before_[axis], &after_[axis]}) array->resize(chunks + 1);
      for (auto* array : {&area_before_[axis], &area_after_[axis]}) array->resize(chunks + 1);
    }
    BoxRecord* chunk = after_[axis].data();
    BoxRecord* before = before_[axis].data();
    reduce_axis(boxes, orders_[axis].data() + begin, n, step, chunk, before);
    all = before[chunks];
    chunk[chunks] = BoxRecord::empty();
    for (uint32_t c = chunks; c-- > 0;) chunk[c].extend(chunk[c + 1]);
  }
  return all;
}

void Block::weigh_borders(uint32_t n, uint32_t step, Split& best) {
  const uint32_t chunks = (n + step - 1) / step;
  const bool feasible = constraints_.feasible(n);
  for (int axis = 0; axis < 3; ++axis) {
    float* left = area_before_[axis].data();
    float* right = area_after_[axis].data();
    left[0] = right[chunks] = 0.0f;
    for (uint32_t c = 1; c < chunks; ++c) {
      left[c] = before_[axis][c].half_area(pad_);
      right[c] = after_[axis][c].half_area(pad_);
    }
    left[chunks] = right[0] = before_[axis][chunks].half_area(pad_);
    for (uint32_t c = 1; c < chunks; ++c) {
      const uint32_t i = c * step;
      const float cost = left[c] * node_weights_[i] + right[c] * node_weights_[n - i];
      if (cost < best.cost && constraints_.legal(i, n, feasible)) best = {cost, i, axis};
    }
  }
}

void Block::list_gaps(uint32_t n, uint32_t step, const Split& best) {
  const uint32_t chunks = (n + step - 1) / step;
  const uint32_t least = constraints_.feasible(n) ? constraints_.config.min_items : 1;
  gaps_.clear();
  for (int axis = 0; axis < 3; ++axis) {
    const float* left = area_before_[axis].data();
    const float* right = area_after_[axis].data();
    for (uint32_t c = 0; c < chunks; ++c) {
      const uint32_t first = c * step + 1, last = std::min((c + 1) * step, n) - 1;
      if (last < first || last < least || n - first < least) continue;
      const float bound = left[c] * node_weights_[first] + right[c + 1] * node_weights_[n - last];
      if (bound < best.cost) gaps_.push_back({bound, axis, c});
    }
  }
}

void Block::search_gap(uint32_t begin, uint32_t n, uint32_t step, const Gap& gap, Split& best) {
  const uint32_t* order = orders_[gap.axis].data() + begin;
  const uint32_t start = gap.chunk * step, stop = std::min(start + step, n);
  const bool feasible = constraints_.feasible(n);
  if (gap_areas_.size() < step) gap_areas_.resize(step);
  BoxRecord box = before_[gap.axis][gap.chunk];
  for (uint32_t i = start; i + 1 < stop; ++i) {
    box.extend(boxes_[order[i]]);
    gap_areas_[i - start] = box.half_area(pad_);
  }
  box = after_[gap.axis][gap.chunk + 1];
  for (uint32_t i = stop - 1; i > start; --i) {
    box.extend(boxes_[order[i]]);
    const float cost =
        gap_areas_[i - 1 - start] * node_weights_[i] + box.half_area(pad_) * node_weights_[n - i];
    if (cost < best.cost && constraints_.legal(i, n, feasible)) best = {cost, i, gap.axis};
  }
}

void Block::fill_weights(uint32_t n) {
  const float underfill_cost = constraints_.underfill_cost(n);
  const uint32_t max_items = constraints_.config.max_items;
  Weights& weights = weights_[underfill_cost != constraints_.underfill_cost(kNone)];
  if (weights.max_items != max_items || weights.underfill_cost != underfill_cost)
    weights = {{}, max_items, underfill_cost};
  for (uint32_t i = static_cast<uint32_t>(weights.of.size()); i <= n; ++i)
    weights.of.push_back(constraints_.weight(i, underfill_cost));
  node_weights_ = weights.of.data();
}

}  // namespace umbel::cluster
