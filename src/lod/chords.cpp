#include "lod/chords.hpp"

#include <algorithm>

namespace umbel::lod {
namespace {

constexpr uint64_t kEmpty = ~uint64_t{0};

uint64_t key_of(const PositionPair& edge) {
  return uint64_t{std::min(edge.first, edge.second)} << 32 | std::max(edge.first, edge.second);
}

}  // namespace

size_t ChordRegistry::slot_of(uint64_t key) const {
  const size_t mask = table_.size() - 1;
  size_t slot = (key * 0x9e3779b97f4a7c15ull) >> 20 & mask;
  while (table_[slot] != kEmpty && table_[slot] != key) slot = (slot + 1) & mask;
  return slot;
}

void ChordRegistry::grow() {
  std::vector<uint64_t> old(std::max<size_t>(1024, 2 * table_.size()), kEmpty);
  old.swap(table_);
  for (uint64_t key : old)
    if (key != kEmpty) table_[slot_of(key)] = key;
}

void ChordRegistry::insert(std::span<const PositionPair> edges) {
  for (const PositionPair& edge : edges) {
    if (2 * (count_ + 1) > table_.size()) grow();
    const size_t slot = slot_of(key_of(edge));
    if (table_[slot] != kEmpty) continue;
    table_[slot] = key_of(edge);
    ++count_;
  }
}

bool ChordRegistry::contains_any(std::span<const PositionPair> edges) const {
  return !table_.empty() && std::any_of(edges.begin(), edges.end(), [&](const PositionPair& edge) {
    return table_[slot_of(key_of(edge))] != kEmpty;
  });
}

}  // namespace umbel::lod
