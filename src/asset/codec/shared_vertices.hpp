// Stores vertices that clusters of one group share once. Adjacent clusters share runs of border
// vertices in opposite order, so a cluster names one vertex of an earlier cluster and then codes,
// one bit a vertex, how far the two borders agree. docs/format.md has every bit.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "asset/codec/connectivity.hpp"

namespace umbel::asset {

/// The borders of a group's clusters. Vertices are numbered through the group: cluster by cluster,
/// in each as its traversal numbers them.
class GroupBorders {
 public:
  /// Of clusters with `vertices` in all.
  explicit GroupBorders(size_t vertices);

  /// Adds a cluster of `vertices` vertices; fill in the links of its border, then call list_last.
  BorderLinks add_cluster(uint32_t vertices);
  void list_last();

  /// The number of the last cluster's first vertex, and that behind its last.
  uint32_t first() const { return first_; }
  uint32_t end() const { return end_; }
  bool is_border(uint32_t vertex) const {
    return next_[vertex] != kNone || previous_[vertex] != kNone;
  }
  /// Border vertices of the clusters before the last, and of the last.
  std::span<const uint32_t> earlier() const { return std::span(listed_).first(earlier_); }
  std::span<const uint32_t> last() const {
    return std::span(listed_).subspan(earlier_, count_ - earlier_);
  }
  /// Along the border from a vertex, or kNone.
  uint32_t next(uint32_t vertex) const { return next_[vertex]; }
  uint32_t previous(uint32_t vertex) const { return previous_[vertex]; }
  /// The same of all vertices.
  const uint32_t* next() const { return next_.data(); }
  const uint32_t* previous() const { return previous_.data(); }

 private:
  std::vector<uint32_t> next_, previous_, listed_;
  uint32_t first_ = 0, end_ = 0;
  size_t earlier_ = 0, count_ = 0;  // of listed_
};

/// Encodes what each cluster shares with those before it.
class SharedVertices {
 public:
  /// `vertices` in all clusters that will come.
  explicit SharedVertices(size_t vertices);

  /// Writes what the next cluster shares; `ids` are equal where its vertices are, in the order of
  /// its traversal. The result has for each of its vertices the earlier one that it equals, or
  /// kNone.
  std::vector<uint32_t> encode(std::span<const uint32_t> ids, std::span<const BorderEdge> edges,
                               BitWriter& out);
  const GroupBorders& borders() const { return borders_; }

 private:
  uint32_t copy_of(uint32_t vertex, uint32_t after) const;
  uint32_t steps_along(uint32_t vertex, uint32_t earlier, bool forward) const;
  uint32_t best_copy(uint32_t vertex) const;
  void follow(uint32_t vertex, uint32_t earlier, bool forward, BitWriter& out);
  void list_last_cluster();

  GroupBorders borders_;
  std::vector<uint32_t> ids_, source_;            // of all vertices
  std::vector<uint32_t> heads_, next_with_hash_;  // border vertices by their ids
};

/// Reads it into `source`, of as many elements as the last cluster in `borders` has vertices.
/// Throws kCorrupt if a number is out of range.
void decode_shared(BitReader& in, const GroupBorders& borders, std::span<uint32_t> source);

}  // namespace umbel::asset
