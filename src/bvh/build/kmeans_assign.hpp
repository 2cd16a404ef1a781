// The assignment step of Lloyd's algorithm (Lloyd, "Least Squares Quantization in PCM", 1982) for a
// chunk of a cluster's items, by a team: the nearest representative of each, and what those of each
// representative add up to, as integers, so that it makes no difference which chunk is added first.
#pragma once

#include <limits>

#include "bvh/build/kmeans_points.hpp"

namespace umbel::bvh {

/// Items of one unit of parallel work, all of one cluster.
struct KmeansChunk {
  uint32_t cluster;     ///< among those that are divided
  uint32_t begin, end;  ///< items

  static constexpr uint32_t kMost = 256;

  UMBEL_HOST_DEVICE static uint32_t of(uint32_t items) { return (items + kMost - 1) / kMost; }
};

/// A cluster that is being divided, and what it needs beside its items.
struct KmeansDivided {
  static constexpr uint32_t kReseeded = 0xffffffffu;  ///< the pass after the last one

  KmeansCluster* cluster;
  uint32_t first_chunk, chunks;
  uint32_t used;        ///< representatives; one: divided evenly
  uint32_t changed[2];  ///< the last even and the last odd pass that changed a label
  bool is_reseeded;     ///< all items had one label, so it was seeded again

  /// Whether its items are labelled in a pass, which are counted from 1 on: not once two passes
  /// have come to the same.
  UMBEL_HOST_DEVICE bool takes_part(uint32_t pass) const {
    if (pass == kReseeded) return is_reseeded;
    if (used == 1) return pass == 1;
    return pass < 3 || changed[(pass - 1) % 2] == pass - 1;
  }
};

/// What the items of representatives add up to.
struct KmeansTotals {
  uint32_t* counts;  ///< k a cluster
  KmeansSum* sums;   ///< k a cluster
  /// k a chunk: items. Those of a cluster come after those of the one before it, and among them
  /// first all of representative 0: so their sums are where items go.
  uint32_t* chunk_counts;
};

/// Items that a processor compares side by side in vector registers.
inline constexpr uint32_t kKmeansLanes = 4, kKmeansBlock = 64;

/// Labels the items of a chunk and adds up those of each representative. Columns and labels must be
/// readable up to a multiple of kKmeansLanes beyond the chunk.
template <KmeansDistance kDistance, uint32_t kMost>
struct KmeansAssign {
  using Label = KmeansLabel<kMost>;
  static constexpr uint32_t kLanes = 128;
  struct Shared {
    KmeansPoint representatives[kMost];
    KmeansSum sums[kMost];
    uint32_t counts[kMost];
    int32_t cells[6][KmeansChunk::kMost + 1];  // one more, against bank conflicts
    Label labels[KmeansChunk::kMost];
  };

  KmeansPoints points;
  KmeansDivided* divided;
  const KmeansChunk* chunks;
  const KmeansPoint* representatives;  ///< k a cluster
  Label* labels;
  KmeansTotals totals;
  KmeansGrid grid;
  uint32_t k;
  uint32_t pass;
  bool adds;  ///< coordinates too, for new means

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t index, Shared& shared) const {
    const KmeansChunk chunk = chunks[index];
    KmeansDivided& of = divided[chunk.cluster];
    if (!of.takes_part(pass)) return;
    if (of.used == 1) {
      label_evenly(team, *of.cluster, chunk, shared);
    } else {
      for (uint32_t r = team.rank(); r < of.used; r += team.size())
        shared.representatives[r] = representatives[size_t(chunk.cluster) * k + r];
      team.sync();
      if (label(team, chunk, of.used, shared)) atomic_max(&of.changed[pass % 2], pass);
    }
    if (adds)
      for (uint32_t c = 0; c < 6; ++c)
        for (uint32_t i = team.rank(); i < chunk.end - chunk.begin; i += team.size())
          shared.cells[c][i] = grid.cell_of(points.column[c][chunk.begin + i], c);
    team.sync();
    add_up(team, chunk, of, static_cast<uint32_t>(index), shared);
  }

 private:
  /// Labels the items of a chunk. Whether a lane has changed a label.
  template <typename Team>
  UMBEL_HOST_DEVICE bool label(const Team& team, const KmeansChunk& chunk, uint32_t used,
                               Shared& shared) const {
    if constexpr (Team::kIsSerial) return label_by_blocks(chunk, used, shared);
    bool is_changed = false;
    for (uint32_t i = chunk.begin + team.rank(); i < chunk.end; i += team.size()) {
      const KmeansPoint p = points.at(i);
      float least = std::numeric_limits<float>::infinity();
      uint32_t nearest = 0;
      for (uint32_t r = 0; r < used; ++r) {
        const float distance = kmeans_distance<kDistance>(p, shared.representatives[r]);
        if (!(distance < least)) continue;
        least = distance;
        nearest = r;
      }
      is_changed |= labels[i] != nearest;
      labels[i] = shared.labels[i - chunk.begin] = static_cast<Label>(nearest);
    }
    return is_changed;
  }

  /// The same on one thread of a processor.
  bool label_by_blocks(const KmeansChunk& chunk, uint32_t used, Shared& shared) const {
    int32_t changes = 0;
    Nearest nearest;
    for (uint32_t begin = chunk.begin; begin < chunk.end; begin += kKmeansBlock) {
      const uint32_t left = chunk.end - begin, count = left < kKmeansBlock ? left : kKmeansBlock;
      const uint32_t padded = (count + kKmeansLanes - 1) / kKmeansLanes * kKmeansLanes;
      for (uint32_t i = 0; i < padded; ++i) {
        nearest.distance[i] = std::numeric_limits<float>::infinity();
        nearest.label[i] = 0;
      }
      for (uint32_t r = 0; r < used; ++r)
        compare(begin, padded, shared.representatives[r], static_cast<int32_t>(r), nearest);
      for (uint32_t i = 0; i < count; ++i) {
        changes |= nearest.label[i] ^ labels[begin + i];
        labels[begin + i] = shared.labels[begin - chunk.begin + i] =
            static_cast<Label>(nearest.label[i]);
      }
    }
    return changes != 0;
  }

  struct Nearest {
    alignas(16) float distance[kKmeansBlock];
    alignas(16) int32_t label[kKmeansBlock];
  };

  /// Compares `count` items, a multiple of kKmeansLanes; of representatives as near, the first
  /// counts.
  void compare(uint32_t begin, uint32_t count, const KmeansPoint& representative, int32_t label,
               Nearest& nearest) const {
    const KmeansPoint r = representative;
    const float* __restrict v[6];
    for (int c = 0; c < 6; ++c) v[c] = points.column[c] + begin;
    float* __restrict distances = nearest.distance;
    int32_t* __restrict found = nearest.label;
    for (uint32_t i = 0; i < count; ++i) {
      float sum = distance_along<kDistance>(v[0][i], r.v[0]);
      sum += distance_along<kDistance>(v[1][i], r.v[1]);
      sum += distance_along<kDistance>(v[2][i], r.v[2]);
      sum += distance_along<kDistance>(v[3][i], r.v[3]);
      sum += distance_along<kDistance>(v[4][i], r.v[4]);
      sum += distance_along<kDistance>(v[5][i], r.v[5]);
      const bool nearer = sum < distances[i];
      distances[i] = nearer ? sum : distances[i];
      found[i] = nearer ? label : found[i];
    }
  }

  /// Where distance does not tell items apart: k parts of about equal size, in order.
  template <typename Team>
  UMBEL_HOST_DEVICE void label_evenly(const Team& team, const KmeansCluster& cluster,
                                      const KmeansChunk& chunk, Shared& shared) const {
    for (uint32_t i = chunk.begin + team.rank(); i < chunk.end; i += team.size()) {
      const uint64_t rank = i - cluster.offset + 1;
      labels[i] = shared.labels[i - chunk.begin] =
          static_cast<Label>((rank * k - 1) / cluster.count);
    }
  }

  /// Every lane adds up one component of one representative at a time.
  template <typename Team>
  UMBEL_HOST_DEVICE void add_up(const Team& team, const KmeansChunk& chunk, const KmeansDivided& of,
                                uint32_t index, Shared& shared) const {
    const uint32_t count = chunk.end - chunk.begin, columns = adds ? 7 : 1;
    if constexpr (Team::kIsSerial) add_serially(count, shared);
    for (uint32_t pair = team.rank(); pair < k * columns; pair += team.size()) {
      const uint32_t r = pair / columns, column = pair % columns;
      if (column == 0) {
        uint32_t items = 0;
        if constexpr (Team::kIsSerial)
          items = shared.counts[r];
        else
          for (uint32_t i = 0; i < count; ++i) items += shared.labels[i] == r ? 1 : 0;
        publish_count(chunk.cluster, of, index, r, items);
      } else {
        int64_t sum = 0;
        if constexpr (Team::kIsSerial)
          sum = shared.sums[r].v[column - 1];
        else
          for (uint32_t i = 0; i < count; ++i)
            sum += shared.labels[i] == r ? shared.cells[column - 1][i] : 0;
        int64_t& all = totals.sums[size_t(chunk.cluster) * k + r].v[column - 1];
        publish(of, &all, sum);
      }
    }
  }
  UMBEL_HOST_DEVICE void add_serially(uint32_t count, Shared& shared) const {
    for (uint32_t r = 0; r < k; ++r) {
      shared.counts[r] = 0;
      shared.sums[r] = {};
    }
    for (uint32_t i = 0; i < count; ++i) ++shared.counts[shared.labels[i]];
    if (!adds) return;
    for (uint32_t i = 0; i < count; ++i) {
      KmeansSum& sum = shared.sums[shared.labels[i]];
      for (uint32_t c = 0; c < 6; ++c) sum.v[c] += shared.cells[c][i];
    }
  }

  UMBEL_HOST_DEVICE void publish_count(uint32_t cluster, const KmeansDivided& of, uint32_t index,
                                       uint32_t r, uint32_t items) const {
    totals.chunk_counts[size_t(of.first_chunk) * k + size_t(r) * of.chunks +
                        (index - of.first_chunk)] = items;
    publish(of, &totals.counts[size_t(cluster) * k + r], items);
  }
  /// To what other chunks of the cluster add to as well.
  template <typename T>
  UMBEL_HOST_DEVICE static void publish(const KmeansDivided& of, T* all, T amount) {
    if (of.chunks == 1)
      *all = amount;
    else if (amount != 0)
      atomic_sum(all, amount);
  }
};

}  // namespace umbel::bvh
