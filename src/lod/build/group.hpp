// Groups of neighbouring clusters, and what they share.
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include <cstdint>
#include <span>
#include <vector>

#include "lod/dag/cluster_set.hpp"
#include "lod/dag/source.hpp"
#include "umbel/cluster.hpp"

namespace umbel::lod {

/// Groups of config.min_group to max_group clusters by bisection, where clusters that share
/// vertices are connected, more strongly by vertices that were locked in the round before: a
/// border that could not be simplified then should lie inside a group now. `locked` is by
/// position id. Scratch is kept from round to round.
class Grouper {
 public:
  explicit Grouper(const Source& source) : source_(source) {}

  /// Whenever the source has got vertices.
  void grow() { owners_.resize(source_.mesh.positions.size(), 0); }

  /// Does ahead what the next `group` of the same clusters does alone, on one thread.
  void prepare(const ClusterSet& set);

  Clusters group(const ClusterSet& set, std::span<const uint8_t> locked, const Config& config);

  /// Positions that are locked before the first `lock_borders`, which clears them.
  void know_locked(std::span<const uint8_t> locked);

  /// Of what `group` has just grouped: sets locked[p] to 1 for the positions that clusters of two
  /// groups use, and to 0 for all others that are locked.
  void lock_borders(const Clusters& groups, std::vector<uint8_t>& locked);

 private:
  // Positions that more than one cluster uses, as clusters -> slots and slots -> clusters.
  struct Shared {
    std::vector<uint32_t> offsets;        // clusters + 1, into slots
    std::vector<uint32_t> slots;          // of each cluster
    std::vector<uint32_t> positions;      // of each slot
    std::vector<uint32_t> owner_offsets;  // slots + 1, into owners
    std::vector<uint32_t> owners;         // clusters of each slot
  };
  // Connections of a run of clusters.
  struct Run {
    std::vector<Range> ranges;  // into targets, from 0
    std::vector<uint32_t> targets;
    std::vector<float> weights;
  };
  // Where a cluster stands in the targets of the cluster that is being connected. Numbers go on
  // from one cluster and one run to the next, so that none is reset.
  struct Entries {
    std::vector<uint32_t> of;  // by cluster: 0 before the first
    uint32_t next = 1;
  };
  struct Positions {
    std::span<const uint32_t> all, offsets;  // clusters + 1, into all
  };
  Positions positions_of(const ClusterSet& set);
  void find_shared(const ClusterSet& set);
  Run connect(size_t begin, size_t end, std::span<const uint8_t> locked, Entries& entries) const;

  const Source& source_;
  std::vector<uint32_t> owners_;                       // by position id
  std::vector<uint32_t> own_positions_, own_offsets_;  // scratch, where there are wedges
  std::vector<uint32_t> last_owner_;                   // by position id: stamp of a cluster
  uint32_t owner_stamp_ = 0;
  tbb::enumerable_thread_specific<Entries> entries_;
  Shared shared_;
  bool is_prepared_ = false;      // shared_ is that of what is grouped next
  std::vector<uint32_t> locked_;  // positions
};

}  // namespace umbel::lod
