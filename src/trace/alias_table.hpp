// Sampling of a discrete distribution in constant time: Walker's alias method, built as by Vose
// ("A Linear Algorithm for Generating Random Numbers with a Given Distribution", 1991).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace umbel::trace {

class AliasTable {
 public:
  AliasTable() = default;

  /// Weights must be finite and not negative. If their sum is zero, the table is empty.
  explicit AliasTable(std::span<const double> weights) {
    for (const double w : weights) total_ += w;
    if (!(total_ > 0.0)) return;
    const size_t n = weights.size();
    cells_.resize(n);
    std::vector<double> scaled(n);
    std::vector<uint32_t> small, large;
    for (size_t i = 0; i < n; ++i) {
      scaled[i] = weights[i] / total_ * static_cast<double>(n);
      (scaled[i] < 1.0 ? small : large).push_back(static_cast<uint32_t>(i));
    }
    while (!small.empty() && !large.empty()) {
      const uint32_t low = small.back(), high = large.back();
      small.pop_back();
      cells_[low] = {static_cast<float>(scaled[low]), high};
      scaled[high] -= 1.0 - scaled[low];
      if (scaled[high] < 1.0) {
        large.pop_back();
        small.push_back(high);
      }
    }
    for (const uint32_t i : small) cells_[i] = {1.0f, i};
    for (const uint32_t i : large) cells_[i] = {1.0f, i};
  }

  bool empty() const { return cells_.empty(); }
  size_t size() const { return cells_.size(); }
  double total() const { return total_; }

  struct Choice {
    uint32_t index;
    float rest;  ///< a number of [0, 1) that is independent of the index
  };
  Choice choose(float u) const {
    const float scaled = u * static_cast<float>(cells_.size());
    const uint32_t i =
        std::min(static_cast<uint32_t>(scaled), static_cast<uint32_t>(cells_.size() - 1));
    const float rest = std::min(scaled - static_cast<float>(i), 0x1.fffffep-1f);
    const Cell& cell = cells_[i];
    if (rest < cell.keep) return {i, std::min(rest / cell.keep, 0x1.fffffep-1f)};
    return {cell.alias, std::min((rest - cell.keep) / (1.0f - cell.keep), 0x1.fffffep-1f)};
  }

 private:
  struct Cell {
    float keep;
    uint32_t alias;
  };
  std::vector<Cell> cells_;
  double total_ = 0.0;
};

}  // namespace umbel::trace
