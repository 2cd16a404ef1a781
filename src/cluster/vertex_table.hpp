// Counts and numbers the unique vertices of a few items by open addressing, so that nothing
// depends on how many vertices the whole mesh has.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <vector>

#include "umbel/types.hpp"

namespace umbel::cluster {

/// Never counts too few: a table without probing, where a vertex that another one has pushed out
/// counts again. It has no unpredictable branches, and so is much faster than an exact count.
class QuickVertexCount {
 public:
  void clear() {
    if (slots_.empty()) slots_.assign(size_t(1) << kBits, 0);
    stamp_ += uint64_t(1) << 32;
    count_ = 0;
  }
  void insert(const uint32_t* vertices, uint32_t count) {
    uint64_t* const slots = slots_.data();
    const uint64_t stamp = stamp_;
    uint32_t fresh = 0;
    for (uint32_t k = 0; k < count; ++k) {
      uint64_t& slot = slots[vertices[k] * 0x9e3779b1u >> (32 - kBits)];
      fresh += slot != (stamp | vertices[k]);
      slot = stamp | vertices[k];
    }
    count_ += fresh;
  }
  uint32_t count() const { return count_; }

 private:
  static constexpr int kBits = 11;
  std::vector<uint64_t> slots_;
  uint64_t stamp_ = 0;
  uint32_t count_ = 0;
};

class VertexTable {
 public:
  /// Forgets everything and makes room for `most` different vertices.
  void clear(size_t most) {
    const size_t slots = std::bit_ceil(std::max<size_t>(2 * most, 64));
    if (slots > vertices_.size()) {
      vertices_.resize(slots);
      numbers_.resize(slots);
    }
    shift_ = 64 - std::countr_zero(slots);
    mask_ = slots - 1;
    std::fill_n(vertices_.begin(), slots, kNone);
    count_ = 0;
    seen_none_ = false;
  }

  /// The number of the vertex: 0 for the first one seen, 1 for the second, ...
  uint32_t insert(uint32_t vertex) {
    if (vertex == kNone) return insert_none();
    size_t slot = (vertex * 0x9e3779b97f4a7c15ull) >> shift_;
    while (vertices_[slot] != vertex) {
      if (vertices_[slot] == kNone) {
        vertices_[slot] = vertex;
        return numbers_[slot] = count_++;
      }
      slot = (slot + 1) & mask_;
    }
    return numbers_[slot];
  }

  uint32_t count() const { return count_; }

 private:
  // The mark of a free slot is a legal index of items that have no mesh behind them.
  uint32_t insert_none() {
    if (!seen_none_) {
      seen_none_ = true;
      none_number_ = count_++;
    }
    return none_number_;
  }

  std::vector<uint32_t> vertices_, numbers_;
  int shift_ = 0;
  size_t mask_ = 0;
  uint32_t count_ = 0, none_number_ = 0;
  bool seen_none_ = false;
};

}  // namespace umbel::cluster
