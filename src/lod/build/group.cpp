#include "lod/build/group.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "base/parallel.hpp"

namespace umbel::lod {
namespace {

// So large that shared vertices decide and boxes are second: what groups share cannot be
// simplified, and components that lie within each other have much the same boxes.
constexpr float kSharedWeight = 20.0f;
constexpr float kLockedWeight = 60.0f;

// The apex of a large fan belongs to very many clusters and says nothing about which of them
// are neighbours; pairs would be quadratic.
constexpr uint32_t kMostOwners = 64;

// Clusters that are connected by one task.
constexpr size_t kRun = 64;

}  // namespace

// The positions of each cluster, each once though several of its vertices may have it.
Grouper::Positions Grouper::positions_of(const ClusterSet& set) {
  if (!source_.has_wedges) return {set.vertices, set.vertex_offsets};
  own_positions_.resize(set.vertices.size());
  own_offsets_.assign(1, 0);
  last_owner_.resize(owners_.size(), 0);
  uint32_t count = 0;
  for (size_t c = 0; c < set.size(); ++c) {
    const uint32_t owner = ++owner_stamp_;
    for (uint32_t v : set.cluster_vertices(c)) {
      const uint32_t p = source_.position_ids[v];
      own_positions_[count] = p;
      count += std::exchange(last_owner_[p], owner) != owner;
    }
    own_offsets_.push_back(count);
  }
  return {{own_positions_.data(), count}, own_offsets_};
}

void Grouper::find_shared(const ClusterSet& set) {
  shared_ = {};
  const Positions positions = positions_of(set);
  for (uint32_t p : positions.all) ++owners_[p];
  // `owners_` turns from a count into slot + a flag, and back to 0 at the end.
  constexpr uint32_t kSlotFlag = 0x80000000u;
  shared_.owner_offsets.push_back(0);
  shared_.offsets.push_back(0);
  for (size_t c = 0; c < set.size(); ++c) {
    for (uint32_t i = positions.offsets[c]; i < positions.offsets[c + 1]; ++i) {
      const uint32_t p = positions.all[i];
      uint32_t& owners = owners_[p];
      if ((owners & kSlotFlag) == 0) {
        if (owners == 1) {
          owners = 0;
          continue;
        }
        shared_.owner_offsets.push_back(shared_.owner_offsets.back() + owners);
        owners = kSlotFlag | static_cast<uint32_t>(shared_.positions.size());
        shared_.positions.push_back(p);
      }
      shared_.slots.push_back(owners & ~kSlotFlag);
    }
    shared_.offsets.push_back(static_cast<uint32_t>(shared_.slots.size()));
  }
  for (uint32_t p : shared_.positions) owners_[p] = 0;

  shared_.owners.resize(shared_.owner_offsets.back());
  std::vector<uint32_t> cursor(shared_.owner_offsets.begin(), shared_.owner_offsets.end() - 1);
  for (uint32_t c = 0; c < set.size(); ++c)
    for (uint32_t i = shared_.offsets[c]; i < shared_.offsets[c + 1]; ++i)
      shared_.owners[cursor[shared_.slots[i]]++] = c;
}

void Grouper::prepare(const ClusterSet& set) {
  find_shared(set);
  is_prepared_ = true;
}

Grouper::Run Grouper::connect(size_t begin, size_t end, std::span<const uint8_t> locked,
                              Entries& entries) const {
  Run run;
  constexpr uint32_t kMostEntries = 1u << 31;
  if (entries.next > kMostEntries) entries = {};
  const size_t clusters = shared_.offsets.size() - 1;
  if (entries.of.size() < clusters) entries.of.resize(clusters, 0);
  const uint32_t base = entries.next;
  for (size_t c = begin; c < end; ++c) {
    const uint32_t first = static_cast<uint32_t>(run.targets.size());
    for (uint32_t i = shared_.offsets[c]; i < shared_.offsets[c + 1]; ++i) {
      const uint32_t slot = shared_.slots[i];
      const uint32_t from = shared_.owner_offsets[slot], to = shared_.owner_offsets[slot + 1];
      if (to - from > kMostOwners) continue;
      const float weight = locked[shared_.positions[slot]] ? kLockedWeight : kSharedWeight;
      for (uint32_t j = from; j < to; ++j) {
        const uint32_t other = shared_.owners[j];
        if (other == c) continue;
        uint32_t& entry = entries.of[other];
        if (entry < base + first) {
          entry = base + static_cast<uint32_t>(run.targets.size());
          run.targets.push_back(other);
          run.weights.push_back(0.0f);
        }
        run.weights[entry - base] += weight;
      }
    }
    run.ranges.push_back({first, static_cast<uint32_t>(run.targets.size()) - first});
  }
  entries.next = base + static_cast<uint32_t>(run.targets.size());
  return run;
}

Clusters Grouper::group(const ClusterSet& set, std::span<const uint8_t> locked,
                        const Config& config) {
  if (!std::exchange(is_prepared_, false)) find_shared(set);
  std::vector<Run> runs((set.size() + kRun - 1) / kRun);
  parallel_chunks(set.size(), kRun, [&](size_t begin, size_t end) {
    runs[begin / kRun] = connect(begin, end, locked, entries_.local());
  });
  std::vector<Range> ranges;
  std::vector<uint32_t> targets;
  std::vector<float> weights;
  for (const Run& run : runs) {
    const uint32_t first = static_cast<uint32_t>(targets.size());
    for (const Range& range : run.ranges) ranges.push_back({first + range.offset, range.count});
    targets.insert(targets.end(), run.targets.begin(), run.targets.end());
    weights.insert(weights.end(), run.weights.begin(), run.weights.end());
  }
  ClusterInput input;
  input.boxes = set.boxes;
  input.connections = {ranges, targets, weights};
  ClusterConfig cluster_config;
  cluster_config.min_items = config.min_group;
  cluster_config.max_items = config.max_group;
  cluster_config.underfill_cost = config.group_underfill_cost;
  cluster_config.overlap_cost = config.group_overlap_cost;
  return build_clusters(input, cluster_config);
}

void Grouper::know_locked(std::span<const uint8_t> locked) {
  for (uint32_t p = 0; p < locked.size(); ++p)
    if (locked[p]) locked_.push_back(p);
}

void Grouper::lock_borders(const Clusters& groups, std::vector<uint8_t>& locked) {
  std::vector<uint32_t> group_of(groups.items.size());
  for (uint32_t g = 0; g < groups.ranges.size(); ++g) {
    const Range range = groups.ranges[g];
    for (uint32_t i = range.offset; i < range.offset + range.count; ++i)
      group_of[groups.items[i]] = g;
  }
  for (uint32_t p : locked_) locked[p] = 0;
  locked_.clear();
  for (size_t slot = 0; slot < shared_.positions.size(); ++slot) {
    const uint32_t begin = shared_.owner_offsets[slot], end = shared_.owner_offsets[slot + 1];
    const uint32_t first = group_of[shared_.owners[begin]];
    for (uint32_t j = begin + 1; j < end; ++j) {
      if (group_of[shared_.owners[j]] == first) continue;
      locked_.push_back(shared_.positions[slot]);
      break;
    }
  }
  for (uint32_t p : locked_) locked[p] = 1;
}

}  // namespace umbel::lod
