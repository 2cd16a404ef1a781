// The source's non-manifold edges where not all edges fit into memory. Positions are known by keyed
// hashes of 64 bits.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "lod/verify/verify_geometry.hpp"

namespace umbel::lod {

class PositionHash {
 public:
  explicit PositionHash(uint64_t key) : key_(mix64(key)) {}
  uint64_t operator()(const Vec3& position) const { return hash_value(position, key_); }

 private:
  uint64_t key_;
};

/// Which positions are joined by edges that need not be shared by two triangles: see
/// Topology::allowed. A union-find over those positions alone.
class JoinedPositions {
 public:
  void join(uint64_t a, uint64_t b);
  bool are_joined(uint64_t a, uint64_t b) const;
  bool empty() const { return parents_.empty(); }
  size_t size() const { return parents_.size(); }

 private:
  uint32_t number(uint64_t position);
  uint32_t top(uint32_t number) const;

  std::unordered_map<uint64_t, uint32_t> numbers_;
  std::vector<uint32_t> parents_;
};

/// Counts triangles at edges, in both directions: one part of all edges, so many at most.
class EdgeTable {
 public:
  /// What an entry takes.
  static constexpr size_t kEntryBytes = 24;

  /// For the edges of part `part` of `parts`.
  EdgeTable(size_t room, uint32_t part, uint32_t parts);

  /// False if there is no more room.
  bool add(uint64_t from, uint64_t to);

  /// Calls visit(a, b, forward, backward) for each edge; counts end at 255.
  template <typename Visit>
  void for_each(const Visit& visit) const {
    for (const Entry& e : entries_)
      if (e.forward + e.backward > 0) visit(e.a, e.b, e.forward, e.backward);
  }

 private:
  struct Entry {
    uint64_t a = 0, b = 0;
    uint8_t forward = 0, backward = 0;
  };

  uint32_t part_, parts_;
  size_t used_ = 0;
  std::vector<Entry> entries_;
};

}  // namespace umbel::lod
