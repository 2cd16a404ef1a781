#include "cluster/block.hpp"

#include <bit>
#include <cmath>
#include <limits>

#include "base/radix_sort.hpp"

namespace umbel::cluster {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Boxes are scaled only where areas would leave the range of floats, and then by a power of two,
// which changes no comparison.
float scale_for(const BoxRecord& bounds) {
  float extent = 0, magnitude = 0;
  for (int k = 0; k < 3; ++k) {
    extent = std::max(extent, bounds.v[4 + k] * -0.5f - bounds.v[k] * 0.5f);
    magnitude = std::max({magnitude, std::abs(bounds.v[k]), std::abs(bounds.v[4 + k])});
  }
  if (extent == 0.0f || (extent > 0x1p-20f && extent < 0x1p30f && magnitude < 0x1p60f))
    return 1.0f;
  const int most = 60 - std::ilogb(magnitude);
  return std::ldexp(1.0f, std::clamp(std::min(-std::ilogb(extent), most), -126, 127));
}

float pad_for(const BoxRecord& bounds) {
  const float extent = std::max({bounds.extent(0), bounds.extent(1), bounds.extent(2)});
  return extent > 0.0f ? std::ldexp(1.0f, std::max(std::ilogb(extent) - 20, -60)) : 1.0f;
}

}  // namespace

void Block::bisect(const Source& source, const Rules& rules, uint32_t* items, uint8_t* first,
                   uint32_t count) {
  if (count == 0) return;
  source_ = &source;
  rules_ = &rules;
  items_ = items;
  first_ = first;
  load(count);
  cut_.load(source, ids_, count);
  split(0, count, 2 * std::bit_width(count) + 8);
}

void Block::load(uint32_t count) {
  ids_.assign(items_, items_ + count);
  boxes_.resize(count);
  BoxRecord bounds = BoxRecord::empty();
  for (uint32_t i = 0; i < count; ++i) {
    boxes_[i] = BoxRecord::from(source_->box(ids_[i]));
    bounds.extend(boxes_[i]);
  }
  if (const float scale = scale_for(bounds); scale != 1.0f) {
    bounds.scale(scale);
    for (BoxRecord& box : boxes_) box.scale(scale);
  }
  pad_ = pad_for(bounds);
  for (int axis = 0; axis < 3; ++axis) sort_axis(axis, count);
  for (auto* array : {&left_area_, &right_area_, &extra_, &left_weight_, &right_weight_})
    array->resize(count);
  spare_.resize(count);
  right_.resize(count);
}

void Block::sort_axis(int axis, uint32_t count) {
  words_.resize(count);
  spare_words_.resize(count);
  uint32_t low = 0xffffffffu, high = 0;
  for (uint32_t i = 0; i < count; ++i) {
    const float center = source_->centroids.empty() ? boxes_[i].center(axis)
                                                    : (&source_->centroids[ids_[i]].x)[axis];
    const uint32_t key = float_to_key(center);
    low = std::min(low, key);
    high = std::max(high, key);
    words_[i] = uint64_t(key) << 32 | i;
  }
  for (uint64_t& word : words_) word -= uint64_t(low) << 32;
  const uint64_t* sorted = radix_sort(words_.data(), spare_words_.data(), count, 32,
                                      32 + std::bit_width(high - low));
  orders_[axis].resize(count);
  for (uint32_t i = 0; i < count; ++i) orders_[axis][i] = static_cast<uint32_t>(sorted[i]);
}

void Block::split(uint32_t begin, uint32_t end, uint32_t depth) {
  const uint32_t n = end - begin;
  if (is_leaf(begin, end)) return make_leaf(begin, end, 0);
  const uint32_t presplit = rules_->config.presplit_threshold;
  Split best;
  if (depth > 0 && !(presplit && n > presplit)) best = cheapest(begin, end);
  if (!best.position) best = median(begin, end);
  partition(begin, end, best);
  const uint32_t left = depth > 0 ? depth - 1 : 0;
  split(begin, begin + best.position, left);
  split(begin + best.position, end, left);
}

bool Block::is_leaf(uint32_t begin, uint32_t end) {
  const ClusterConfig& config = rules_->config;
  const uint32_t n = end - begin;
  if (n > config.max_items) return false;
  return n == 1 || !config.max_vertices || uint64_t(n) * source_->arity <= config.max_vertices ||
         count_vertices(begin, end) <= config.max_vertices;
}

void Block::make_leaf(uint32_t begin, uint32_t end, int axis) {
  for (uint32_t i = begin; i < end; ++i) {
    items_[i] = ids_[orders_[axis][i]];
    first_[i] = i == begin;
  }
}

Block::Split Block::median(uint32_t begin, uint32_t end) const {
  BoxRecord bounds = BoxRecord::empty();
  for (uint32_t i = begin; i < end; ++i) bounds.extend(boxes_[orders_[0][i]]);
  int axis = 0;
  for (int k = 1; k < 3; ++k)
    if (bounds.extent(k) > bounds.extent(axis)) axis = k;
  const uint32_t n = end - begin;
  return {0.0f, n > rules_->config.max_items ? rules_->middle(n) : n / 2, axis};
}

Block::Split Block::cheapest(uint32_t begin, uint32_t end) {
  const uint32_t n = end - begin;
  const bool vertex_bound = n <= rules_->config.max_items;
  if (vertex_bound) {
    number_vertices(begin, end);
  } else {
    for (uint32_t i = 1; i < n; ++i) {
      left_weight_[i - 1] = rules_->legal(i, n) ? rules_->weight(i) : kInfinity;
      right_weight_[i - 1] = rules_->weight(n - i);
    }
  }
  if (cut_.active()) cut_.enter(orders_[0].data() + begin, n);
  Split best{kInfinity};
  for (int axis = 0; axis < 3; ++axis) sweep(begin, end, axis, vertex_bound, best);
  return best;
}

void Block::sweep(uint32_t begin, uint32_t end, int axis, bool vertex_bound, Split& best) {
  const uint32_t n = end - begin;
  const uint32_t* order = orders_[axis].data() + begin;
  BoxRecord left = BoxRecord::empty(), right = left;
  for (uint32_t i = 0; i + 1 < n; ++i) {
    left.extend(boxes_[order[i]]);
    left_area_[i] = left.half_area(pad_);
    right.extend(boxes_[order[n - 1 - i]]);
    right_area_[n - 2 - i] = right.half_area(pad_);
  }
  left.extend(boxes_[order[n - 1]]);
  if (cut_.active()) {
    cut_.sweep(order, n, extra_.data());
    const float scale = left.half_area(pad_) * 0.25f * static_cast<float>(n);
    for (uint32_t i = 1; i < n; ++i)
      extra_[i - 1] *= scale * (static_cast<float>(n) / static_cast<float>(i)) /
                       static_cast<float>(n - i);
  } else {
    std::fill_n(extra_.begin(), n, 0.0f);
  }
  if (rules_->config.overlap_cost > 0.0f) add_overlap(order, n);
  if (vertex_bound) weigh_vertices(order, n);
  for (uint32_t i = 0; i + 1 < n; ++i) {
    const float cost =
        left_area_[i] * left_weight_[i] + right_area_[i] * right_weight_[i] + extra_[i];
    if (cost < best.cost) best = {cost, i + 1, axis};
  }
}

void Block::add_overlap(const uint32_t* order, uint32_t n) {
  left_boxes_.resize(n);
  BoxRecord left = BoxRecord::empty(), right = left;
  for (uint32_t i = 0; i + 1 < n; ++i) {
    left.extend(boxes_[order[i]]);
    left_boxes_[i] = left;
  }
  const float scale = rules_->config.overlap_cost * static_cast<float>(n);
  for (uint32_t i = n - 1; i > 0; --i) {
    right.extend(boxes_[order[i]]);
    BoxRecord both = right;
    both.intersect(left_boxes_[i - 1]);
    if (both.extent(0) < 0.0f || both.extent(1) < 0.0f || both.extent(2) < 0.0f) continue;
    extra_[i - 1] += scale * both.half_area(0.0f);
  }
}

void Block::weigh_vertices(const uint32_t* order, uint32_t n) {
  const uint32_t arity = source_->arity, limit = rules_->config.max_vertices;
  const uint32_t total = table_.count();
  const float price = rules_->config.vertex_underfill_cost * static_cast<float>(n) /
                      static_cast<float>(total);
  // A side of limit / arity items fits whatever they are; smaller ones are a waste.
  const uint32_t least =
      std::min({std::max(limit / arity, 1u), rules_->config.min_items, std::max(n / 2, 1u)});
  const auto weight = [&](uint32_t items, uint32_t vertices) {
    if (items < least) return kInfinity;
    const uint32_t missing = (vertices + limit - 1) / limit * limit - vertices;
    return static_cast<float>(items) + price * static_cast<float>(missing);
  };
  const auto count_new = [&](uint32_t item) {
    uint32_t fresh = 0;
    for (uint32_t k = 0; k < arity; ++k) {
      uint8_t& seen = seen_[numbers_[size_t(item) * arity + k]];
      fresh += !seen;
      seen = 1;
    }
    return fresh;
  };
  seen_.assign(total, 0);
  for (uint32_t i = 0, vertices = 0; i + 1 < n; ++i)
    left_weight_[i] = weight(i + 1, vertices += count_new(order[i]));
  seen_.assign(total, 0);
  for (uint32_t i = n - 1, vertices = 0; i > 0; --i)
    right_weight_[i - 1] = weight(n - i, vertices += count_new(order[i]));
}

void Block::partition(uint32_t begin, uint32_t end, const Split& split) {
  const uint32_t n = end - begin;
  const uint32_t* sorted = orders_[split.axis].data() + begin;
  for (uint32_t i = 0; i < n; ++i) right_[sorted[i]] = i >= split.position;
  for (int axis = 0; axis < 3; ++axis) {
    if (axis == split.axis) continue;
    uint32_t* order = orders_[axis].data() + begin;
    uint32_t l = 0, r = 0;
    for (uint32_t i = 0; i < n; ++i) {
      const uint32_t item = order[i];
      const uint32_t side = right_[item];
      order[l] = item;
      spare_[r] = item;
      l += 1 - side;
      r += side;
    }
    std::copy_n(spare_.begin(), r, order + l);
  }
}

uint32_t Block::count_vertices(uint32_t begin, uint32_t end) {
  const uint32_t arity = source_->arity;
  table_.clear(size_t(end - begin) * arity);
  for (uint32_t i = begin; i < end; ++i) {
    const uint32_t* vertices = source_->vertices + size_t(ids_[orders_[0][i]]) * arity;
    for (uint32_t k = 0; k < arity; ++k) table_.insert(vertices[k]);
  }
  return table_.count();
}

void Block::number_vertices(uint32_t begin, uint32_t end) {
  const uint32_t arity = source_->arity;
  numbers_.resize(std::max(numbers_.size(), ids_.size() * arity));
  table_.clear(size_t(end - begin) * arity);
  for (uint32_t i = begin; i < end; ++i) {
    const uint32_t local = orders_[0][i];
    const uint32_t* vertices = source_->vertices + size_t(ids_[local]) * arity;
    for (uint32_t k = 0; k < arity; ++k)
      numbers_[size_t(local) * arity + k] = table_.insert(vertices[k]);
  }
}

}  // namespace umbel::cluster
