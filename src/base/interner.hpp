// Numbers for equal keys.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "base/hash_index.hpp"
#include "umbel/types.hpp"

namespace umbel {

/// Numbers equal keys alike, in the order of their first appearance. Hash()(key) has good leading
/// bits. Fewer than 2^32 - 1 keys.
template <typename Key, typename Hash>
class Interner {
 public:
  explicit Interner(size_t expected = 0) : index_(std::max<size_t>(expected, 16)) {
    keys_.reserve(expected);
  }

  /// The key's number, and whether it is new.
  std::pair<uint32_t, bool> insert(const Key& key) {
    if (keys_.size() == index_.room()) grow(2 * keys_.size());
    if (keys_.size() == kNone)
      throw Error(ErrorCode::kUnsupported, "more than 4294967295 different vertices or edges");
    const uint32_t next = static_cast<uint32_t>(keys_.size());
    const uint32_t found = index_.find_or_insert(Hash()(key), next, equal_to(key));
    if (found != next) return {found, false};
    keys_.push_back(key);
    return {next, true};
  }
  /// Makes room for so many more keys.
  void reserve(size_t more) {
    if (keys_.size() + more > index_.room()) grow(2 * (keys_.size() + more));
  }
  void prefetch(const Key& key) const { index_.prefetch(Hash()(key)); }
  bool contains(const Key& key) const { return find(key) != kNone; }
  /// The key's number, kNone where it has none.
  uint32_t find(const Key& key) const { return index_.find(Hash()(key), equal_to(key)); }

  const std::vector<Key>& keys() const { return keys_; }
  std::vector<Key> take() { return std::move(keys_); }

 private:
  auto equal_to(const Key& key) const {
    return [this, &key](uint32_t i) { return keys_[i] == key; };
  }

  void grow(size_t room) {
    index_.reset(room);
    const auto never = [](uint32_t) { return false; };  // keys differ from each other
    for (size_t i = 0; i < keys_.size(); ++i)
      index_.find_or_insert(Hash()(keys_[i]), static_cast<uint32_t>(i), never);
  }

  HashIndex index_;
  std::vector<Key> keys_;
};

}  // namespace umbel
