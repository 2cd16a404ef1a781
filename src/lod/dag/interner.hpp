// Numbers equal keys alike, in the order of their first appearance.
#pragma once

#include <bit>
#include <cstdint>
#include <utility>
#include <vector>

#include "umbel/types.hpp"

namespace umbel::lod {

/// An open-addressing table of indices into the keys themselves. Fewer than 2^32 - 1 keys.
template <typename Key, typename Hash>
class Interner {
 public:
  explicit Interner(size_t expected = 0)
      : slots_(std::bit_ceil(expected + expected / 2 + 16), kNone) {
    keys_.reserve(expected);
  }

  /// The key's number, and whether it is new.
  std::pair<uint32_t, bool> insert(const Key& key) {
    if (3 * (keys_.size() + 1) > 2 * slots_.size()) grow();
    uint32_t& slot = find(key);
    if (slot != kNone) return {slot, false};
    if (keys_.size() == kNone)
      throw Error(ErrorCode::kUnsupported, "more than 4294967295 different vertices or edges");
    slot = static_cast<uint32_t>(keys_.size());
    keys_.push_back(key);
    return {slot, true};
  }

  const std::vector<Key>& keys() const { return keys_; }
  std::vector<Key> take() { return std::move(keys_); }

 private:
  uint32_t& find(const Key& key) {
    const size_t mask = slots_.size() - 1;
    size_t at = Hash()(key) & mask;
    while (slots_[at] != kNone && !(keys_[slots_[at]] == key)) at = (at + 1) & mask;
    return slots_[at];
  }

  void grow() {
    slots_.assign(slots_.size() * 2, kNone);
    for (size_t i = 0; i < keys_.size(); ++i) find(keys_[i]) = static_cast<uint32_t>(i);
  }

  std::vector<uint32_t> slots_;
  std::vector<Key> keys_;
};

/// Spreads the bits of a word (the finaliser of MurmurHash3, Appleby 2011).
inline uint64_t mix_bits(uint64_t h) {
  h = (h ^ (h >> 33)) * 0xff51afd7ed558ccdull;
  h = (h ^ (h >> 33)) * 0xc4ceb9fe1a85ec53ull;
  return h ^ (h >> 33);
}

/// Of positions without negative zeros.
struct PositionHash {
  uint64_t operator()(const Vec3& p) const {
    const uint64_t xy = uint64_t{std::bit_cast<uint32_t>(p.x)} << 32 | std::bit_cast<uint32_t>(p.y);
    return mix_bits(mix_bits(xy) ^ std::bit_cast<uint32_t>(p.z));
  }
};

}  // namespace umbel::lod
