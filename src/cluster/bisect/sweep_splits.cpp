// The cheapest split by a full sweep of the three orders, for nodes whose cost is more than areas:
// overlap, cut connections, or too many vertices for a leaf.
#include <algorithm>
#include <limits>

#include "cluster/bisect/block.hpp"

namespace umbel::cluster {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

}  // namespace

Block::Split Block::cheapest_by_sweep(uint32_t begin, uint32_t end) {
  const uint32_t n = end - begin;
  for (auto* array : {&left_area_, &right_area_, &extra_, &left_weight_, &right_weight_})
    if (array->size() < n) array->resize(n);
  normalise(begin, end, bounds(begin, end));
  const bool vertex_bound = n <= most_items_;
  const bool feasible = constraints_.feasible(n);
  if (vertex_bound) {
    number_vertices(begin, end);
  } else {
    const float underfill_cost = constraints_.underfill_cost(n);
    for (uint32_t i = 1; i < n; ++i) {
      const bool legal = constraints_.legal(i, n, feasible);
      left_weight_[i - 1] = legal ? constraints_.weight(i, underfill_cost) : kInfinity;
      right_weight_[i - 1] = constraints_.weight(n - i, underfill_cost);
    }
  }
  if (connection_cost_.active()) connection_cost_.enter(orders_[0].data() + begin, n);
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
  if (connection_cost_.active()) {
    connection_cost_.sweep(order, n, extra_.data());
    const float scale = left.half_area(pad_) * 0.25f * static_cast<float>(n);
    for (uint32_t i = 1; i < n; ++i)
      extra_[i - 1] *=
          scale * (static_cast<float>(n) / static_cast<float>(i)) / static_cast<float>(n - i);
  } else {
    std::fill_n(extra_.begin(), n, 0.0f);
  }
  if (constraints_.config.overlap_cost > 0.0f) add_overlap(order, n);
  if (vertex_bound) weigh_vertices(order, n);
  for (uint32_t i = 0; i + 1 < n; ++i) {
    const float cost =
        left_area_[i] * left_weight_[i] + right_area_[i] * right_weight_[i] + extra_[i];
    if (cost < best.cost) best = {cost, i + 1, axis};
  }
}

void Block::add_overlap(const uint32_t* order, uint32_t n) {
  if (left_boxes_.size() < n) left_boxes_.resize(n);
  BoxRecord left = BoxRecord::empty(), right = left;
  for (uint32_t i = 0; i + 1 < n; ++i) {
    left.extend(boxes_[order[i]]);
    left_boxes_[i] = left;
  }
  const float scale = constraints_.config.overlap_cost * static_cast<float>(n);
  for (uint32_t i = n - 1; i > 0; --i) {
    right.extend(boxes_[order[i]]);
    BoxRecord both = right;
    both.intersect(left_boxes_[i - 1]);
    if (both.extent(0) < 0.0f || both.extent(1) < 0.0f || both.extent(2) < 0.0f) continue;
    extra_[i - 1] += scale * both.half_area(Float4{});
  }
}

void Block::weigh_vertices(const uint32_t* order, uint32_t n) {
  const uint32_t arity = source_->arity, limit = constraints_.config.max_vertices;
  const uint32_t total = node_vertices_;
  const float price =
      constraints_.config.vertex_underfill_cost * static_cast<float>(n) / static_cast<float>(total);
  // A side of limit / arity items fits whatever they are; smaller ones are a waste.
  const uint32_t least =
      std::min({std::max(limit / arity, 1u), constraints_.config.min_items, std::max(n / 2, 1u)});
  const auto weight = [&](uint32_t items, uint32_t vertices) {
    if (items < least) return kInfinity;
    const uint32_t missing = (vertices + limit - 1) / limit * limit - vertices;
    return static_cast<float>(items) + price * static_cast<float>(missing);
  };
  const auto start = [&] { shared_.active() ? shared_.clear() : seen_.assign(total, 0); };
  const auto count_new = [&](uint32_t item) {
    if (shared_.active()) return shared_.insert(item);
    uint32_t fresh = 0;
    for (uint32_t k = 0; k < arity; ++k) {
      uint8_t& seen = seen_[numbers_[size_t(item) * arity + k]];
      fresh += !seen;
      seen = 1;
    }
    return fresh;
  };
  start();
  for (uint32_t i = 0, vertices = 0; i + 1 < n; ++i)
    left_weight_[i] = weight(i + 1, vertices += count_new(order[i]));
  start();
  for (uint32_t i = n - 1, vertices = 0; i > 0; --i)
    right_weight_[i - 1] = weight(n - i, vertices += count_new(order[i]));
}

// Where clusters will run out of vertices before they are full of items, splits must aim at the
// number of items that they will have, or each full node ends in two half-full ones. A few samples
// of neighbours tell.
void Block::expect_vertices() {
  constexpr uint32_t kSamples = 4;
  const uint32_t arity = source_->arity, limit = constraints_.config.max_vertices;
  const uint32_t length = std::min(most_items_, count_);
  if (uint64_t(length) * arity <= limit) return;
  const auto mean_of_samples = [&](const auto& count_vertices) {
    uint64_t vertices = 0;
    for (uint32_t s = 0; s < kSamples; ++s) {
      const uint32_t begin = uint32_t(uint64_t(count_ - length) * s / (kSamples - 1));
      vertices += count_vertices(begin, begin + length);
    }
    return double(vertices) / kSamples;
  };
  const auto vertices_of = [&](uint32_t i) {
    return source_->vertices + size_t(boxes_[i].tag()) * arity;
  };
  const auto count_quickly = [&](uint32_t begin, uint32_t end) {
    quick_count_.clear();
    for (uint32_t i = begin; i < end; ++i) quick_count_.insert(vertices_of(i), arity);
    return quick_count_.count();
  };
  const auto count_by_bits = [&](uint32_t begin, uint32_t end) {
    shared_.clear();
    for (uint32_t i = begin; i < end; ++i) shared_.insert(i);
    return shared_.count();
  };
  const auto count_exactly = [&](uint32_t begin, uint32_t end) {
    table_.clear(size_t(end - begin) * arity);
    for (uint32_t i = begin; i < end; ++i)
      for (uint32_t k = 0; k < arity; ++k) table_.insert(vertices_of(i)[k]);
    return table_.count();
  };
  const double many = 1.35 * limit;
  if (!shared_.active() && mean_of_samples(count_quickly) <= many) return;
  const double mean =
      shared_.active() ? mean_of_samples(count_by_bits) : mean_of_samples(count_exactly);
  if (mean <= many) return;
  // Shapes differ, and those with a longer border need more vertices.
  constexpr double kMargin = 0.9;
  ClusterConfig config = constraints_.config;
  config.max_items = std::clamp(uint32_t(kMargin * length * limit / mean),
                                std::min(limit / arity, most_items_), most_items_);
  config.min_items = std::min(config.min_items, config.max_items);
  constraints_ = SplitConstraints(config);
}

uint32_t Block::count_vertices(uint32_t begin, uint32_t end, int axis) {
  if (shared_.active()) {
    shared_.clear();
    for (uint32_t i = begin; i < end; ++i) shared_.insert(orders_[axis][i]);
    return shared_.count();
  }
  const uint32_t arity = source_->arity;
  const uint32_t* order = orders_[axis].data();
  for (uint32_t i = begin; i < end; ++i) source_->prefetch_vertices(boxes_[order[i]].tag());
  quick_count_.clear();
  for (uint32_t i = begin; i < end; ++i) {
    const uint32_t item = boxes_[order[i]].tag();
    quick_count_.insert(source_->vertices + size_t(item) * arity, arity);
  }
  if (quick_count_.count() <= constraints_.config.max_vertices) return quick_count_.count();
  table_.clear(size_t(end - begin) * arity);
  for (uint32_t i = begin; i < end; ++i) {
    const uint32_t item = boxes_[orders_[axis][i]].tag();
    const uint32_t* vertices = source_->vertices + size_t(item) * arity;
    for (uint32_t k = 0; k < arity; ++k) table_.insert(vertices[k]);
  }
  return table_.count();
}

void Block::number_vertices(uint32_t begin, uint32_t end) {
  if (shared_.active()) {
    node_vertices_ = count_vertices(begin, end, 0);
    return;
  }
  const uint32_t arity = source_->arity;
  numbers_.resize(std::max(numbers_.size(), size_t(count_) * arity));
  table_.clear(size_t(end - begin) * arity);
  for (uint32_t i = begin; i < end; ++i) {
    const uint32_t local = orders_[0][i];
    const uint32_t* vertices = source_->vertices + size_t(boxes_[local].tag()) * arity;
    for (uint32_t k = 0; k < arity; ++k)
      numbers_[size_t(local) * arity + k] = table_.insert(vertices[k]);
  }
  node_vertices_ = table_.count();
}

}  // namespace umbel::cluster
