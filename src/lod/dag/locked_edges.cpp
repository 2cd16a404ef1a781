#include "lod/dag/locked_edges.hpp"

#include <algorithm>
#include <array>

namespace umbel::lod {
namespace {

constexpr uint64_t kEmpty = ~uint64_t{0};

uint64_t key_of(const PositionPair& edge) {
  return uint64_t{std::min(edge.first, edge.second)} << 32 | std::max(edge.first, edge.second);
}

}  // namespace

size_t LockedEdgeSet::slot_of(uint64_t key) const {
  const size_t mask = table_.size() - 1;
  size_t slot = first_slot(key);
  while (table_[slot] != kEmpty && table_[slot] != key) slot = (slot + 1) & mask;
  return slot;
}

size_t LockedEdgeSet::first_slot(uint64_t key) const {
  return (key * 0x9e3779b97f4a7c15ull) >> 20 & (table_.size() - 1);
}

void LockedEdgeSet::grow() {
  BigVector<uint64_t> old(std::max<size_t>(1024, 2 * table_.size()), kEmpty);
  old.swap(table_);
  for (uint64_t key : old)
    if (key != kEmpty) table_[slot_of(key)] = key;
}

void LockedEdgeSet::insert(std::span<const PositionPair> edges) {
  constexpr size_t kAhead = 16;
  while (2 * (count_ + edges.size()) > table_.size()) grow();
  for (size_t i = 0; i < edges.size(); ++i) {
    if (i + kAhead < edges.size())
      __builtin_prefetch(&table_[first_slot(key_of(edges[i + kAhead]))], 1);
    const uint64_t key = key_of(edges[i]);
    uint64_t& entry = table_[slot_of(key)];
    count_ += entry == kEmpty;
    entry = key;
  }
}

bool LockedEdgeSet::contains(const PositionPair& edge) const {
  return !table_.empty() && table_[slot_of(key_of(edge))] != kEmpty;
}

bool LockedEdgeSet::contains_any(std::span<const PositionPair> edges) const {
  return std::any_of(edges.begin(), edges.end(),
                     [&](const PositionPair& edge) { return contains(edge); });
}

std::vector<PositionPair> own_locked_edges(const ClusterSet& set,
                                           std::span<const uint32_t> clusters,
                                           std::span<const uint32_t> position_ids,
                                           std::span<const uint8_t> locked) {
  std::vector<PositionPair> edges;
  std::array<uint32_t, 256> ids;
  std::array<uint8_t, 256> is_locked;
  for (uint32_t c : clusters) {
    const auto vertices = set.cluster_vertices(c);
    uint32_t count = 0;
    for (size_t i = 0; i < vertices.size(); ++i) {
      ids[i] = position_ids[vertices[i]];
      count += is_locked[i] = locked[ids[i]];
    }
    if (count < 2) continue;
    const auto corners = set.cluster_corners(c);
    for (size_t i = 0; i < corners.size(); i += 3) {
      if (is_locked[corners[i]] + is_locked[corners[i + 1]] + is_locked[corners[i + 2]] < 2)
        continue;
      for (size_t k = 0; k < 3; ++k) {
        const uint8_t a = corners[i + k], b = corners[i + (k + 1) % 3];
        if (is_locked[a] && is_locked[b]) edges.push_back({ids[a], ids[b]});
      }
    }
  }
  return edges;
}

}  // namespace umbel::lod
