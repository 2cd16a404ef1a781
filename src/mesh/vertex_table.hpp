// A hash table from keys that live elsewhere to the first index inserted with that key. Open
// addressing with linear probing at a load of at most one half; each slot keeps 32 bits of the
// hash, so that keys are only compared when they are almost certainly equal.
#pragma once

#include <bit>
#include <cstdint>
#include <span>

#include "base/big_vector.hpp"
#include "umbel/types.hpp"

namespace umbel {

class VertexTable {
 public:
  explicit VertexTable(size_t entries)
      : slots_(std::bit_ceil(entries * 2 + 2), Slot{0, kNone}),
        shift_(64 - std::countr_zero(slots_.size())) {}

  /// Starts loading the slot that a later find_or_insert of this hash begins with.
  void prefetch(uint64_t hash) const {
#if defined(__GNUC__)
    __builtin_prefetch(&slots_[hash >> shift_], 1);
#else
    (void)hash;
#endif
  }

  /// The index inserted first with an equal key; `index` itself if there was none.
  template <typename Equal>
  uint32_t find_or_insert(uint64_t hash, uint32_t index, const Equal& equal_to) {
    const auto tag = static_cast<uint32_t>(hash);
    const size_t mask = slots_.size() - 1;
    for (size_t at = hash >> shift_;; at = (at + 1) & mask) {
      Slot& slot = slots_[at];
      if (slot.index == kNone) {
        slot = {tag, index};
        return index;
      }
      if (slot.tag == tag && equal_to(slot.index)) return slot.index;
    }
  }

 private:
  struct Slot {
    uint32_t tag, index;
  };
  BigVector<Slot> slots_;
  int shift_;
};

/// Calls visit(i, hashes[i]) in order, with the table's slots loaded ahead of use.
template <typename Visit>
void for_each_prefetched(const VertexTable& table, std::span<const uint64_t> hashes,
                         const Visit& visit) {
  constexpr size_t kAhead = 16;
  for (size_t i = 0; i < hashes.size(); ++i) {
    if (i + kAhead < hashes.size()) table.prefetch(hashes[i + kAhead]);
    visit(static_cast<uint32_t>(i), hashes[i]);
  }
}

}  // namespace umbel
