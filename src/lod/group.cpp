#include "lod/group.hpp"

#include <algorithm>
#include <numeric>

#include "base/parallel.hpp"

namespace umbel::lod {
namespace {

// So much that what is cut decides and boxes are second: what groups share cannot be simplified,
// and parts that lie within each other have much the same boxes.
constexpr float kSharedWeight = 20.0f;
constexpr float kLockedWeight = 60.0f;

// The apex of a large fan belongs to very many clusters and says nothing about which of them
// are neighbours; pairs would be quadratic.
constexpr uint32_t kMostOwners = 64;

// Calls visit(position id) once for each position of a cluster, though several of its vertices
// may have it. Few do, so a look back along the list is enough.
template <typename Visit>
void for_each_position(const Source& source, std::span<const uint32_t> vertices,
                       std::vector<uint32_t>& scratch, const Visit& visit) {
  if (!source.has_wedges) {
    for (uint32_t v : vertices) visit(v);
    return;
  }
  scratch.clear();
  for (uint32_t v : vertices) scratch.push_back(source.position_ids[v]);
  std::sort(scratch.begin(), scratch.end());
  scratch.erase(std::unique(scratch.begin(), scratch.end()), scratch.end());
  for (uint32_t p : scratch) visit(p);
}

struct Shared {
  std::vector<uint32_t> offsets;        // clusters + 1, into slots
  std::vector<uint32_t> slots;          // shared position slots of each cluster
  std::vector<uint32_t> owner_offsets;  // slots + 1, into owners
  std::vector<uint32_t> owners;         // clusters of each slot
  std::vector<float> weights;           // of each slot
};

// Positions that more than one cluster uses, as clusters -> slots and slots -> clusters.
Shared find_shared(const Source& source, const ClusterSet& set, std::span<const uint8_t> locked,
                   std::vector<uint32_t>& owners) {
  Shared shared;
  std::vector<uint32_t> positions, position_offsets{0}, scratch;
  positions.reserve(set.vertices.size());
  for (size_t c = 0; c < set.size(); ++c) {
    for_each_position(source, set.cluster_vertices(c), scratch, [&](uint32_t p) {
      positions.push_back(p);
      ++owners[p];
    });
    position_offsets.push_back(static_cast<uint32_t>(positions.size()));
  }
  // `owners` turns from a count into slot + 1, and back to 0 at the end.
  shared.owner_offsets.push_back(0);
  constexpr uint32_t kSlotFlag = 0x80000000u;
  shared.offsets.push_back(0);
  for (size_t c = 0; c < set.size(); ++c) {
    for (uint32_t i = position_offsets[c]; i < position_offsets[c + 1]; ++i) {
      const uint32_t p = positions[i];
      if ((owners[p] & kSlotFlag) == 0) {
        const uint32_t count = owners[p];
        if (count < 2 || count > kMostOwners) continue;
        owners[p] = kSlotFlag | static_cast<uint32_t>(shared.weights.size());
        shared.owner_offsets.push_back(shared.owner_offsets.back() + count);
        shared.weights.push_back(locked[p] ? kLockedWeight : kSharedWeight);
      }
      shared.slots.push_back(owners[p] & ~kSlotFlag);
    }
    shared.offsets.push_back(static_cast<uint32_t>(shared.slots.size()));
  }
  for (uint32_t p : positions) owners[p] = 0;

  shared.owners.resize(shared.owner_offsets.back());
  std::vector<uint32_t> cursor(shared.owner_offsets.begin(), shared.owner_offsets.end() - 1);
  for (uint32_t c = 0; c < set.size(); ++c)
    for (uint32_t i = shared.offsets[c]; i < shared.offsets[c + 1]; ++i)
      shared.owners[cursor[shared.slots[i]]++] = c;
  return shared;
}

}  // namespace

Clusters Grouper::group(const ClusterSet& set, std::span<const uint8_t> locked,
                        const Config& config) {
  const Shared shared = find_shared(source_, set, locked, owners_);
  std::vector<Range> ranges;
  std::vector<uint32_t> targets;
  std::vector<float> weights;
  std::vector<uint32_t> entry_of(set.size(), kNone);
  ranges.reserve(set.size());
  for (uint32_t c = 0; c < set.size(); ++c) {
    const uint32_t begin = static_cast<uint32_t>(targets.size());
    for (uint32_t i = shared.offsets[c]; i < shared.offsets[c + 1]; ++i) {
      const uint32_t slot = shared.slots[i];
      for (uint32_t j = shared.owner_offsets[slot]; j < shared.owner_offsets[slot + 1]; ++j) {
        const uint32_t other = shared.owners[j];
        if (other == c) continue;
        if (entry_of[other] == kNone || entry_of[other] < begin) {
          entry_of[other] = static_cast<uint32_t>(targets.size());
          targets.push_back(other);
          weights.push_back(0.0f);
        }
        weights[entry_of[other]] += shared.weights[slot];
      }
    }
    ranges.push_back({begin, static_cast<uint32_t>(targets.size()) - begin});
    // Entries of earlier clusters are below `begin` of later ones, so no reset is needed.
  }
  ClusterInput input;
  input.boxes = set.boxes;
  input.connections = {ranges, targets, weights};
  ClusterConfig cluster_config;
  cluster_config.min_items = config.min_group;
  cluster_config.max_items = config.max_group;
  cluster_config.underfill_cost = 0.5f;
  return build_clusters(input, cluster_config);
}

void Grouper::lock_borders(const ClusterSet& set, const Clusters& groups,
                           std::vector<uint8_t>& locked) {
  for (uint32_t v : set.vertices) locked[source_.position_ids[v]] = 0;
  for (uint32_t g = 0; g < groups.ranges.size(); ++g) {
    const Range range = groups.ranges[g];
    for (uint32_t i = range.offset; i < range.offset + range.count; ++i)
      for (uint32_t v : set.cluster_vertices(groups.items[i])) {
        const uint32_t p = source_.position_ids[v];
        if (owners_[p] == 0)
          owners_[p] = g + 1;
        else if (owners_[p] != g + 1)
          locked[p] = 1;
      }
  }
  for (uint32_t v : set.vertices) owners_[source_.position_ids[v]] = 0;
}

}  // namespace umbel::lod
