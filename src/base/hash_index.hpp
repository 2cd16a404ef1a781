// The one hash table: from keys that live elsewhere to their numbers. Open addressing with linear
// probing at a load of at most one half; each slot keeps 32 bits of the hash, so that keys are only
// compared when they are almost certainly equal.
#pragma once

#include <bit>
#include <cstdint>
#include <span>

#include "base/big_vector.hpp"
#include "umbel/types.hpp"

namespace umbel {

/// Multiplicative hashing (Knuth, "The Art of Computer Programming" 3, 6.4).
struct IntegerHash {
  uint64_t operator()(uint64_t key) const { return key * 0x9e3779b97f4a7c15ull; }
};

/// Numbers of keys by hash. The leading bits of a hash choose its slot.
class HashIndex {
 public:
  HashIndex() : HashIndex(0) {}
  explicit HashIndex(size_t entries) { reset(entries); }

  /// Forgets all; room for `entries`.
  void reset(size_t entries) {
    slots_.assign(std::bit_ceil(entries * 2 + 2), Slot{0, kNone});
    shift_ = 64 - std::countr_zero(slots_.size());
  }
  size_t room() const { return slots_.size() / 2; }

  /// Starts loading the slot that a later find_or_insert of this hash begins with.
  void prefetch(uint64_t hash) const {
#if defined(__GNUC__)
    __builtin_prefetch(&slots_[hash >> shift_], 1);
#else
    (void)hash;
#endif
  }

  /// The number inserted first with an equal key; `index` itself if there was none. No more than
  /// room() are inserted.
  template <typename Equal>
  uint32_t find_or_insert(uint64_t hash, uint32_t index, const Equal& equal_to) {
    Slot& slot = find_slot(hash, equal_to);
    if (slot.index == kNone) slot = {static_cast<uint32_t>(hash), index};
    return slot.index;
  }

  /// kNone where there is none.
  template <typename Equal>
  uint32_t find(uint64_t hash, const Equal& equal_to) const {
    return const_cast<HashIndex*>(this)->find_slot(hash, equal_to).index;
  }

 private:
  struct Slot {
    uint32_t tag, index;
  };

  template <typename Equal>
  Slot& find_slot(uint64_t hash, const Equal& equal_to) {
    const auto tag = static_cast<uint32_t>(hash);
    const size_t mask = slots_.size() - 1;
    for (size_t at = hash >> shift_;; at = (at + 1) & mask) {
      Slot& slot = slots_[at];
      if (slot.index == kNone || (slot.tag == tag && equal_to(slot.index))) return slot;
    }
  }

  BigVector<Slot> slots_;
  int shift_ = 0;
};

/// Calls visit(i, hashes[i]) in order, with the table's slots loaded ahead of use.
template <typename Visit>
void for_each_prefetched(const HashIndex& table, std::span<const uint64_t> hashes,
                         const Visit& visit) {
  constexpr size_t kAhead = 16;
  for (size_t i = 0; i < hashes.size(); ++i) {
    if (i + kAhead < hashes.size()) table.prefetch(hashes[i + kAhead]);
    visit(static_cast<uint32_t>(i), hashes[i]);
  }
}

}  // namespace umbel
