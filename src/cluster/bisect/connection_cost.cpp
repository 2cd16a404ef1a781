#include "cluster/bisect/connection_cost.hpp"

#include <algorithm>

namespace umbel::cluster {

void ConnectionCost::load(const Source& source, const uint32_t* items, uint32_t count) {
  explicit_ = !source.connections.ranges.empty() && !source.connections.targets.empty();
  vertex_weight_ = source.vertices ? source.shared_vertex_weight : 0.0f;
  arity_ = source.arity;
  if (!active()) return;
  change_.resize(count + 1);
  if (explicit_) {
    const Connections& c = source.connections;
    weights_.clear();
    // Half from each end: a connection that only one end lists still counts, by half.
    connections_.load(c, items, count,
                      [&](uint32_t k) { weights_.push_back(0.5f * weight_of(c, k)); });
    node_ = 0;
    node_of_.assign(count, 0);
    position_.resize(count);
  }
  if (vertex_weight_ > 0.0f) {
    table_.clear(size_t(count) * arity_);
    vertices_.resize(size_t(count) * arity_);
    for (uint32_t i = 0; i < count; ++i) {
      const uint32_t* from = source.vertices + size_t(items[i]) * arity_;
      uint32_t* to = vertices_.data() + size_t(i) * arity_;
      for (uint32_t k = 0; k < arity_; ++k)
        to[k] = std::find(from, from + k, from[k]) == from + k ? table_.insert(from[k]) : kNone;
    }
    total_.resize(table_.count());
    passed_.assign(table_.count(), 0);
  }
}

void ConnectionCost::enter(const uint32_t* order, uint32_t n) {
  ++node_;
  if (explicit_)
    for (uint32_t i = 0; i < n; ++i) node_of_[order[i]] = node_;
  if (vertex_weight_ > 0.0f) {
    for (uint32_t i = 0; i < n; ++i)
      for (uint32_t k = 0; k < arity_; ++k)
        if (const uint32_t v = vertices_[size_t(order[i]) * arity_ + k]; v != kNone) total_[v] = 0;
    for (uint32_t i = 0; i < n; ++i)
      for (uint32_t k = 0; k < arity_; ++k)
        if (const uint32_t v = vertices_[size_t(order[i]) * arity_ + k]; v != kNone) ++total_[v];
  }
}

void ConnectionCost::sweep(const uint32_t* order, uint32_t n, float* costs) {
  std::fill_n(change_.begin(), n, 0.0);
  if (explicit_) add_explicit(order, n);
  if (vertex_weight_ > 0.0f) add_vertices(order, n);
  double sum = 0;
  for (uint32_t i = 0; i + 1 < n; ++i) {
    sum += change_[i];
    // Rounding must not leave a tiny negative cost.
    costs[i] = static_cast<float>(std::max(sum, 0.0));
  }
}

void ConnectionCost::add_explicit(const uint32_t* order, uint32_t n) {
  for (uint32_t i = 0; i < n; ++i) position_[order[i]] = i;
  for (uint32_t i = 0; i < n; ++i) {
    const uint32_t item = order[i];
    for (uint32_t k = connections_.offsets[item]; k < connections_.offsets[item + 1]; ++k) {
      const uint32_t target = connections_.targets[k];
      if (node_of_[target] != node_) continue;
      const uint32_t other = position_[target];
      change_[std::min(i, other)] += weights_[k];
      change_[std::max(i, other)] -= weights_[k];
    }
  }
}

void ConnectionCost::add_vertices(const uint32_t* order, uint32_t n) {
  for (uint32_t i = 0; i < n; ++i) {
    for (uint32_t k = 0; k < arity_; ++k) {
      const uint32_t v = vertices_[size_t(order[i]) * arity_ + k];
      if (v == kNone) continue;
      const double gain = double(total_[v]) - 2.0 * double(passed_[v]++) - 1.0;
      change_[i] += gain * vertex_weight_;
    }
  }
  for (uint32_t i = 0; i < n; ++i)
    for (uint32_t k = 0; k < arity_; ++k)
      if (const uint32_t v = vertices_[size_t(order[i]) * arity_ + k]; v != kNone) passed_[v] = 0;
}

}  // namespace umbel::cluster
