// The assignment step of Lloyd's algorithm for a chunk of a cluster's items, on one thread: the
// nearest representative of each, and sums over those of each representative.
#pragma once

#include <limits>

#include "bvh/kmeans_points.hpp"

namespace umbel::bvh {

/// Items of one unit of parallel work, all of one cluster.
struct KmeansChunk {
  uint32_t cluster;     ///< among those that are divided
  uint32_t begin, end;  ///< items

  static constexpr uint32_t kMost = 256;
};

/// Items that are compared side by side: in vector registers on a processor, one a thread on a GPU.
#if defined(__CUDA_ARCH__)
inline constexpr uint32_t kKmeansLanes = 1, kKmeansBlock = 1;
#else
inline constexpr uint32_t kKmeansLanes = 4, kKmeansBlock = 64;
#endif

struct KmeansNearest {
  alignas(16) float distance[kKmeansBlock];
  alignas(16) int32_t label[kKmeansBlock];
};

/// Compares `count` items, a multiple of kKmeansLanes; of representatives as near, the first
/// counts.
template <KmeansDistance kDistance>
UMBEL_HOST_DEVICE inline void compare(const KmeansPoints& points, uint32_t begin, uint32_t count,
                                      const KmeansPoint& representative, int32_t label,
                                      KmeansNearest& nearest) {
  const KmeansPoint r = representative;
  const float* __restrict v[6];
  for (int c = 0; c < 6; ++c) v[c] = points.column[c] + begin;
  float* __restrict distances = nearest.distance;
  int32_t* __restrict labels = nearest.label;
  for (uint32_t i = 0; i < count; ++i) {
    float sum = distance_along<kDistance>(v[0][i], r.v[0]);
    sum += distance_along<kDistance>(v[1][i], r.v[1]);
    sum += distance_along<kDistance>(v[2][i], r.v[2]);
    sum += distance_along<kDistance>(v[3][i], r.v[3]);
    sum += distance_along<kDistance>(v[4][i], r.v[4]);
    sum += distance_along<kDistance>(v[5][i], r.v[5]);
    const bool nearer = sum < distances[i];
    distances[i] = nearer ? sum : distances[i];
    labels[i] = nearer ? label : labels[i];
  }
}

/// Adds the coordinates of a block's items to the sums of their representatives.
UMBEL_HOST_DEVICE inline void add_block(const KmeansPoints& points, uint32_t begin, uint32_t count,
                                        const int32_t* labels, const KmeansGrid& grid,
                                        KmeansSum* sums) {
  alignas(16) int32_t cells[6][kKmeansBlock];
  for (uint32_t c = 0; c < 6; ++c)
    for (uint32_t i = 0; i < count; ++i) cells[c][i] = grid.cell_of(points.column[c][begin + i], c);
  for (uint32_t i = 0; i < count; ++i) {
    KmeansSum& sum = sums[labels[i]];
    for (uint32_t c = 0; c < 6; ++c) sum.v[c] += cells[c][i];
  }
}

/// Labels the items of a chunk and counts those of each representative; with `adds`, also sums up
/// their coordinates. True if a label has changed. Columns and labels must be readable up
/// to a multiple of kKmeansLanes beyond the chunk.
template <KmeansDistance kDistance>
UMBEL_HOST_DEVICE inline bool assign(const KmeansPoints& points, const KmeansChunk& chunk,
                                     const KmeansPoint* representatives, uint32_t used,
                                     const KmeansGrid& grid, bool adds, uint8_t* labels,
                                     KmeansSum* sums) {
  for (uint32_t r = 0; r < used; ++r) sums[r] = {};
  int32_t changes = 0;
  KmeansNearest nearest;
  for (uint32_t begin = chunk.begin; begin < chunk.end; begin += kKmeansBlock) {
    const uint32_t left = chunk.end - begin, count = left < kKmeansBlock ? left : kKmeansBlock;
    const uint32_t padded = (count + kKmeansLanes - 1) / kKmeansLanes * kKmeansLanes;
    for (uint32_t i = 0; i < padded; ++i) {
      nearest.distance[i] = std::numeric_limits<float>::infinity();
      nearest.label[i] = 0;
    }
    for (uint32_t r = 0; r < used; ++r)
      compare<kDistance>(points, begin, padded, representatives[r], static_cast<int32_t>(r),
                         nearest);
    for (uint32_t i = 0; i < count; ++i) {
      changes |= nearest.label[i] ^ labels[begin + i];
      labels[begin + i] = static_cast<uint8_t>(nearest.label[i]);
      ++sums[nearest.label[i]].count;
    }
    if (adds) add_block(points, begin, count, nearest.label, grid, sums);
  }
  return changes != 0;
}

/// The same where distance does not tell items apart: `parts` parts of about equal size, in order.
UMBEL_HOST_DEVICE inline void assign_evenly(const KmeansCluster& cluster, const KmeansChunk& chunk,
                                            uint32_t parts, uint8_t* labels, KmeansSum* sums) {
  for (uint32_t r = 0; r < parts; ++r) sums[r] = {};
  for (uint32_t i = chunk.begin; i < chunk.end; ++i) {
    const uint64_t place = i - cluster.offset + 1;
    labels[i] = static_cast<uint8_t>((place * parts - 1) / cluster.count);
    ++sums[labels[i]].count;
  }
}

}  // namespace umbel::bvh
