#include "cluster/bisect/block_vertices.hpp"

#include <algorithm>
#include <utility>

namespace umbel::cluster {

void BlockVertices::load(const Source& source, const uint32_t* items, uint32_t count) {
  vertices_ = source.vertices;
  arity_ = source.arity;
  vertex_count_ = source.vertex_count;
  all_are_numbered_ = false;
  shared_.load(source, items, count);
}

SplitConstraints BlockVertices::expected(const BlockItems& items,
                                         const SplitConstraints& constraints) {
  constexpr uint32_t kSamples = 4;
  // Where even most clusters have few enough vertices, some do not.
  constexpr double kManyVertices = 0.9;
  const uint32_t limit = constraints.config.max_vertices, most = constraints.config.max_items;
  const uint32_t length = std::min(most, items.count());
  if (uint64_t(length) * arity_ <= limit) return constraints;
  const auto mean_of_samples = [&](const auto& count_vertices) {
    uint64_t vertices = 0;
    for (uint32_t s = 0; s < kSamples; ++s) {
      const uint32_t begin = uint32_t(uint64_t(items.count() - length) * s / (kSamples - 1));
      vertices += count_vertices(begin, begin + length);
    }
    return double(vertices) / kSamples;
  };
  const auto count_quickly = [&](uint32_t begin, uint32_t end) {
    quick_count_.clear();
    for (uint32_t i = begin; i < end; ++i) quick_count_.insert(vertices_of(items, i), arity_);
    return quick_count_.count();
  };
  const auto count_by_bits = [&](uint32_t begin, uint32_t end) {
    shared_.clear();
    for (uint32_t i = begin; i < end; ++i) shared_.insert(i);
    return shared_.count();
  };
  const auto count_exactly = [&](uint32_t begin, uint32_t end) {
    table_.clear(size_t(end - begin) * arity_);
    for (uint32_t i = begin; i < end; ++i)
      for (uint32_t k = 0; k < arity_; ++k) table_.insert(vertices_of(items, i)[k]);
    return table_.count();
  };
  const double many = kManyVertices * limit;
  if (!shared_.active() && mean_of_samples(count_quickly) <= many) return constraints;
  const double mean =
      shared_.active() ? mean_of_samples(count_by_bits) : mean_of_samples(count_exactly);
  if (mean <= many) return constraints;
  ClusterConfig config = constraints.config;
  config.max_items =
      std::clamp(uint32_t(length * limit / mean), std::min(limit / arity_, most), most);
  config.min_items = std::min(config.min_items, config.max_items);
  SplitConstraints fewer(config);
  fewer.few_vertices = true;
  return fewer;
}

uint32_t BlockVertices::count_by_bits(const uint32_t* order, uint32_t begin, uint32_t end) {
  shared_.clear();
  for (uint32_t i = begin; i < end; ++i) shared_.insert(order[i]);
  return shared_.count();
}

bool BlockVertices::within(const BlockItems& items, uint32_t begin, uint32_t end, int axis,
                           uint32_t limit) {
  const uint32_t* order = items.order(axis);
  if (shared_.active()) return count_by_bits(order, begin, end) <= limit;
  for (uint32_t i = begin; i < end; ++i) __builtin_prefetch(vertices_of(items, order[i]));
  quick_count_.clear();
  for (uint32_t i = begin; i < end; ++i) quick_count_.insert(vertices_of(items, order[i]), arity_);
  // It never counts too few.
  if (quick_count_.count() <= limit) return true;
  table_.clear(size_t(end - begin) * arity_);
  for (uint32_t i = begin; i < end; ++i) {
    const uint32_t* vertices = vertices_of(items, order[i]);
    for (uint32_t k = 0; k < arity_; ++k) table_.insert(vertices[k]);
  }
  return table_.count() <= limit;
}

void BlockVertices::enter(const BlockItems& items, uint32_t begin, uint32_t end) {
  if (shared_.active() || all_are_numbered_) return;
  const uint32_t* const order = items.order(0) + begin;
  number_items(items, end - begin, [order](uint32_t i) { return order[i]; });
}

void BlockVertices::number(const BlockItems& items) {
  if (shared_.active()) return;
  number_items(items, items.count(), [](uint32_t i) { return i; });
  all_are_numbered_ = true;
}

std::span<const uint32_t> BlockVertices::small_components(uint32_t most) {
  if (!all_are_numbered_) return {};
  return components_.find(numbers_, arity_, last_.size(), most);
}

// Those of a small mesh are numbers already.
template <typename LocalOf>
void BlockVertices::number_items(const BlockItems& items, uint32_t count, const LocalOf& local_of) {
  constexpr size_t kFew = 1 << 14;
  numbers_.resize(size_t(items.count()) * arity_);
  const auto number = [&](const auto& number_of) {
    for (uint32_t i = 0; i < count; ++i) {
      const uint32_t local = local_of(i);
      const uint32_t* vertices = vertices_of(items, local);
      for (uint32_t k = 0; k < arity_; ++k)
        numbers_[size_t(local) * arity_ + k] = number_of(vertices[k]);
    }
  };
  size_t numbers = vertex_count_;
  if (numbers <= kFew) {
    number([](uint32_t vertex) { return vertex; });
  } else {
    table_.clear(size_t(count) * arity_);
    number([&](uint32_t vertex) { return table_.insert(vertex); });
    numbers = table_.count();
  }
  if (last_.size() < numbers) last_.resize(numbers, 0);
}

void BlockVertices::count_sides(const uint32_t* order, uint32_t n, uint32_t* left,
                                uint32_t* right) {
  if (shared_.active()) {
    shared_.clear();
    for (uint32_t i = 0, count = 0; i < n; ++i) left[i] = count += shared_.insert(order[i]);
    shared_.clear();
    for (uint32_t i = n, count = 0; i-- > 0; count += shared_.insert(order[i])) right[i] = count;
    return;
  }
  if (first_ > kNone - n) {
    std::fill(last_.begin(), last_.end(), 0u);
    first_ = 1;
  }
  arity_ == 3 ? count_sides_of<3>(order, n, left, right) : count_sides_of<0>(order, n, left, right);
  first_ += n;
}

// In one pass: `right` first counts the vertices that each item is the last to have. No branch can
// predict which are new, so nothing branches on it: what they take away, they take from behind the
// end. An arity of 0 is known at run time only.
template <uint32_t kArity>
void BlockVertices::count_sides_of(const uint32_t* order, uint32_t n, uint32_t* left,
                                   uint32_t* right) {
  const uint32_t arity = kArity > 0 ? kArity : arity_, first = first_;
  const uint32_t* const numbers = numbers_.data();
  uint32_t* const last = last_.data();
  uint32_t count = 0;
  for (uint32_t i = 0; i < n; ++i) {
    const uint32_t* const of_item = numbers + size_t(order[i]) * arity;
    right[i] = arity;
    for (uint32_t k = 0; k < arity; ++k) {
      const uint32_t before = std::exchange(last[of_item[k]], first + i);
      count += before < first;
      // Of a new one beyond all, as unsigned numbers wrap around.
      --right[std::min(before - first, n)];
    }
    left[i] = count;
  }
  for (uint32_t i = n, behind = 0; i-- > 0;) behind += std::exchange(right[i], behind);
}

}  // namespace umbel::cluster
