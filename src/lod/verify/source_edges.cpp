#include "lod/verify/source_edges.hpp"

#include <algorithm>
#include <bit>

#include "base/find_root.hpp"

namespace umbel::lod {
namespace {

/// The index of `range` equal parts in which a hash falls.
uint64_t part_of(uint64_t hash, uint64_t range) {
#if defined(__SIZEOF_INT128__)
  __extension__ using Wide = unsigned __int128;
  return static_cast<uint64_t>(Wide{hash} * range >> 64);
#else
  return (hash >> 32) * range >> 32;
#endif
}

}  // namespace

uint32_t JoinedPositions::number(uint64_t position) {
  const auto [at, is_new] = numbers_.try_emplace(position, static_cast<uint32_t>(parents_.size()));
  if (is_new) parents_.push_back(at->second);
  return at->second;
}

uint32_t JoinedPositions::top(uint32_t number) const {
  while (parents_[number] != number) number = parents_[number];
  return number;
}

void JoinedPositions::join(uint64_t a, uint64_t b) {
  const uint32_t first = number(a), second = number(b);
  const uint32_t x = find_root(parents_, first), y = find_root(parents_, second);
  parents_[std::max(x, y)] = std::min(x, y);
}

bool JoinedPositions::are_joined(uint64_t a, uint64_t b) const {
  if (a == b) return true;
  const auto x = numbers_.find(a);
  if (x == numbers_.end()) return false;
  const auto y = numbers_.find(b);
  return y != numbers_.end() && top(x->second) == top(y->second);
}

EdgeTable::EdgeTable(size_t room, uint32_t part, uint32_t parts)
    : part_(part), parts_(parts), entries_(room + room / 4 + 16) {}

bool EdgeTable::add(uint64_t from, uint64_t to) {
  const bool backward = from > to;
  const uint64_t a = std::min(from, to), b = std::max(from, to);
  const uint64_t hash = mix64(a ^ std::rotl(b, 31));
  if (parts_ > 1 && part_of(mix64(hash), parts_) != part_) return true;
  size_t at = part_of(hash, entries_.size());
  while (entries_[at].forward + entries_[at].backward > 0 &&
         (entries_[at].a != a || entries_[at].b != b))
    at = at + 1 == entries_.size() ? 0 : at + 1;
  Entry& entry = entries_[at];
  if (entry.forward + entry.backward == 0) {
    if (used_ + used_ / 8 + 8 >= entries_.size()) return false;
    ++used_;
    entry.a = a;
    entry.b = b;
  }
  uint8_t& count = backward ? entry.backward : entry.forward;
  count += count < 255;
  return true;
}

}  // namespace umbel::lod
