// The component-wise medians of the items of each representative, for k-means with the Manhattan
// distance (Meister & Bittner's slides), by sorting for any executor.
#pragma once

#include "base/radix_sort.hpp"
#include "bvh/build/kmeans_assign.hpp"

namespace umbel::bvh {

/// Makes keys of a component: the representative above, the number below.
template <typename Label>
struct KmeansMedianKeys {
  static constexpr uint32_t kLanes = 128;
  using Shared = NothingShared;

  KmeansPoints points;
  uint32_t component;
  const KmeansChunk* chunks;
  const uint32_t* starts;  ///< where the items of each chunk go
  const Label* labels;
  uint32_t k;
  uint64_t* keys;
  uint32_t* values;

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t c, Shared& /*shared*/) const {
    const KmeansChunk chunk = chunks[c];
    for (uint32_t i = chunk.begin + team.rank(); i < chunk.end; i += team.size()) {
      const uint32_t to = starts[c] + (i - chunk.begin);
      keys[to] = (uint64_t(chunk.cluster) * k + labels[i]) << 32 |
                 float_to_key(points.column[component][i]);
      values[to] = i;
    }
  }
};

template <typename Exec>
class KmeansMedians {
 public:
  explicit KmeansMedians(Exec& exec) : exec_(exec) {}

  /// Moves the representatives, `k` for each of `clusters` clusters, that have some of the items,
  /// which are `most_items` at most.
  template <typename Label>
  void run(const KmeansPoints& points, uint32_t most_items, const KmeansChunk* chunks,
           uint32_t chunk_count, const Label* labels, const uint32_t* counts, uint32_t clusters,
           uint32_t k, KmeansPoint* representatives) {
    const size_t groups = size_t(clusters) * k;
    auto begins = exec_.template allocate<uint32_t>(groups + 1);
    exec_.exclusive_scan(
        groups, [=] UMBEL_DEVICE_LAMBDA(size_t g) { return counts[g]; }, begins.data());
    auto starts = exec_.template allocate<uint32_t>(chunk_count + 1);
    exec_.exclusive_scan(
        chunk_count,
        [=] UMBEL_DEVICE_LAMBDA(size_t c) -> uint32_t { return chunks[c].end - chunks[c].begin; },
        starts.data());
    const uint32_t items = exec_.counts() ? most_items : exec_.read(starts.data() + chunk_count);
    auto keys = exec_.template allocate<uint64_t>(items);
    auto values = exec_.template allocate<uint32_t>(items);
    uint32_t bits = 1;
    while (bits < 32 && groups >> bits != 0) ++bits;
    for (uint32_t v = 0; v < 6; ++v) {
      exec_.for_each_team(chunk_count,
                          KmeansMedianKeys<Label>{points, v, chunks, starts.data(), labels, k,
                                                  keys.data(), values.data()});
      exec_.radix_sort_pairs(items, keys.data(), values.data(), 0, 32 + bits);
      exec_.for_each(groups, [=, values = values.data(),
                              begins = begins.data()] UMBEL_DEVICE_LAMBDA(size_t g) {
        const uint32_t count = begins[g + 1] - begins[g], middle = begins[g] + count / 2;
        if (count == 0) return;
        const float high = points.column[v][values[middle]];
        representatives[g].v[v] =
            count % 2 == 1 ? high : points.column[v][values[middle - 1]] * 0.5f + high * 0.5f;
      });
    }
  }

 private:
  Exec& exec_;
};

}  // namespace umbel::bvh
