// Unique vertices of a few items, counted without their indices: connections say which of an
// item's vertices it shares with another, and a vertex is new unless an item before has it.
#pragma once

#include <bit>
#include <cstdint>
#include <vector>

#include "cluster/bisect/local_connections.hpp"
#include "cluster/source.hpp"

namespace umbel::cluster {

class SharedBits {
 public:
  /// Prepares for these items, if the source has such bits; local index i is items[i].
  void load(const Source& source, const uint32_t* items, uint32_t count);
  bool active() const { return active_; }

  /// Forgets all items.
  void clear() {
    ++stamp_;
    count_ = 0;
  }
  /// Adds an item; returns how many of its vertices are new.
  uint32_t insert(uint32_t local) {
    uint32_t seen = 0;
    for (uint32_t k = connections_.offsets[local]; k < connections_.offsets[local + 1]; ++k)
      if (stamps_[connections_.targets[k]] == stamp_) seen |= bits_[k];
    stamps_[local] = stamp_;
    const uint32_t fresh = arity_ - static_cast<uint32_t>(std::popcount(seen));
    count_ += fresh;
    return fresh;
  }
  uint32_t count() const { return count_; }

 private:
  bool active_ = false;
  uint32_t arity_ = 0, count_ = 0;
  uint64_t stamp_ = 0;
  LocalConnections connections_;
  std::vector<uint8_t> bits_;     ///< by local connection
  std::vector<uint64_t> stamps_;  ///< by local index
};

}  // namespace umbel::cluster
