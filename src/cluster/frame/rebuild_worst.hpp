// Rebuilds the clusters whose areas have grown most and keeps the others, for any executor.
#pragma once

#include <bit>
#include <cstdint>

#include "cluster/frame/area_growth.hpp"
#include "cluster/frame/build_frame.hpp"

namespace umbel::cluster {

/// Copies what is kept to the front of `out`, and gathers the triangles of the rest.
struct SeparateWorst {
  static constexpr uint32_t kLanes = 32;
  using Shared = NothingShared;

  FrameClusters in, out;
  const uint8_t* is_worst;
  const uint32_t *kept_offsets, *kept_numbers,
      *worst_offsets;  ///< by cluster, one more than clusters
  uint32_t* items;
  Triangle* triangles;
  const uint64_t* at_build;
  uint64_t* out_at_build;

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t cluster, Shared&) const {
    if (cluster >= *in.count) return;
    const bool worst = is_worst[cluster] != 0;
    const uint32_t begin = in.offsets[cluster], size = in.offsets[cluster + 1] - begin;
    const uint32_t to = worst ? worst_offsets[cluster] : kept_offsets[cluster];
    for (uint32_t i = team.rank(); i < size; i += team.size()) {
      (worst ? items : out.items)[to + i] = in.items[begin + i];
      (worst ? triangles : out.triangles)[to + i] = in.triangles[begin + i];
    }
    if (worst || team.rank() != 0) return;
    const uint32_t number = kept_numbers[cluster];
    out.offsets[number] = to;
    out.boxes[number] = in.boxes[cluster];
    out_at_build[number] = at_build[cluster];
  }
};

/// Appends the new clusters to those that were kept.
struct AppendClusters {
  static constexpr uint32_t kLanes = 32;
  using Shared = NothingShared;

  FrameClusters made, out;
  const uint32_t *kept_triangles, *kept_clusters;  ///< how many

  template <typename Team>
  UMBEL_HOST_DEVICE void operator()(const Team& team, size_t cluster, Shared&) const {
    const uint32_t count = *made.count;
    if (cluster == 0 && team.rank() == 0) {
      *out.count = *kept_clusters + count;
      out.offsets[*out.count] = *kept_triangles + made.offsets[count];
    }
    if (cluster >= count) return;
    const uint32_t begin = made.offsets[cluster], size = made.offsets[cluster + 1] - begin;
    const uint32_t to = *kept_triangles + begin;
    for (uint32_t i = team.rank(); i < size; i += team.size()) {
      out.items[to + i] = made.items[begin + i];
      out.triangles[to + i] = made.triangles[begin + i];
    }
    if (team.rank() != 0) return;
    out.offsets[*kept_clusters + cluster] = to;
    out.boxes[*kept_clusters + cluster] = made.boxes[cluster];
  }
};

/// Sums over the clusters that are, or are not among the worst: of their triangles, or their
/// number.
template <typename Exec>
void scan_clusters(Exec& exec, const FrameClusters& in, const uint8_t* is_worst, bool of_worst,
                   bool of_triangles, uint32_t most, uint32_t* to) {
  exec.exclusive_scan(
      most,
      [=] UMBEL_DEVICE_LAMBDA(size_t c) -> uint32_t {
        if (c >= *in.count || (is_worst[c] != 0) != of_worst) return 0;
        return of_triangles ? in.offsets[c + 1] - in.offsets[c] : 1;
      },
      to);
}

/// New clusters, from number *kept on, are compared with what they are now.
template <typename Exec>
void reset_rebuilt(Exec& exec, const FrameClusters& out, const uint32_t* kept, uint32_t most,
                   const AreaShares& shares) {
  exec.for_each(most, [=] UMBEL_DEVICE_LAMBDA(size_t c) {
    if (c >= *kept && c < *out.count) shares.at_build[c] = shares.now[c];
  });
  exec.reduce(
      most, uint64_t(0),
      [=] UMBEL_DEVICE_LAMBDA(size_t c) -> uint64_t {
        return c < *out.count ? shares.at_build[c] : 0;
      },
      AddShares{}, shares.total + 1);
}

/// Of the clusters whose area has grown since they were built, takes the `budget` that have grown
/// by the largest factor, builds clusters of their triangles, and writes all to `out`, whose arrays
/// are others than those of `in`. `in` has been refitted and measured; so is `out` then.
template <typename Exec>
void rebuild_worst(Exec& exec, const Positions& positions, const CheckedFrameConfig& config,
                   const FrameClusters& in, const AreaShares& shares, uint32_t triangles,
                   uint32_t budget, const FrameClusters& out, const AreaShares& out_shares) {
  const uint32_t most = config.most_clusters(triangles);
  const uint32_t worst = budget < most ? budget : most;
  const auto limit = uint64_t(worst) * config.block.max_items;
  const auto room = uint32_t(limit < triangles ? limit : triangles);
  const auto keys = exec.template allocate<uint32_t>(most);
  const auto numbers = exec.template allocate<uint32_t>(most);
  const auto is_worst = exec.template allocate<uint8_t>(most);
  exec.for_each(most, [=, keys = keys.data(), numbers = numbers.data(),
                       is_worst = is_worst.data()] UMBEL_DEVICE_LAMBDA(size_t c) {
    const bool has_grown = c < *in.count && shares.now[c] > shares.at_build[c];
    const double before = has_grown ? double(shares.at_build[c] + 1) : 1.0;
    const auto growth = has_grown ? float(double(shares.now[c]) / before) : 0.0f;
    keys[c] = ~std::bit_cast<uint32_t>(growth);
    numbers[c] = uint32_t(c);
    is_worst[c] = 0;
  });
  exec.radix_sort_pairs(most, keys.data(), numbers.data(), 0u, 32u);
  exec.for_each(worst, [=, keys = keys.data(), numbers = numbers.data(),
                        is_worst = is_worst.data()] UMBEL_DEVICE_LAMBDA(size_t i) {
    if (keys[i] != ~0u) is_worst[numbers[i]] = 1;
  });
  const auto kept_offsets = exec.template allocate<uint32_t>(size_t(most) + 1);
  const auto kept_numbers = exec.template allocate<uint32_t>(size_t(most) + 1);
  const auto worst_offsets = exec.template allocate<uint32_t>(size_t(most) + 1);
  const auto scan = [&](bool of_worst, bool of_triangles, uint32_t* to) {
    scan_clusters(exec, in, is_worst.data(), of_worst, of_triangles, most, to);
  };
  scan(false, true, kept_offsets.data());
  scan(false, false, kept_numbers.data());
  scan(true, true, worst_offsets.data());
  const auto items = exec.template allocate<uint32_t>(room);
  const auto gathered = exec.template allocate<Triangle>(room);
  exec.for_each_team(most, SeparateWorst{in, out, is_worst.data(), kept_offsets.data(),
                                         kept_numbers.data(), worst_offsets.data(), items.data(),
                                         gathered.data(), shares.at_build, out_shares.at_build});
  const uint32_t most_made = config.most_clusters(room);
  const auto made_items = exec.template allocate<uint32_t>(room);
  const auto made_triangles = exec.template allocate<Triangle>(room);
  const auto made_offsets = exec.template allocate<uint32_t>(size_t(most_made) + 1);
  const auto made_boxes = exec.template allocate<Aabb>(most_made);
  const auto made_count = exec.template allocate<uint32_t>(1);
  const FrameClusters made{made_items.data(), made_triangles.data(), made_offsets.data(),
                           made_boxes.data(), made_count.data()};
  build_frame(exec, {positions, gathered.data(), items.data(), room, worst_offsets.data() + most},
              config, made);
  exec.for_each_team(size_t(most_made) + 1, AppendClusters{made, out, kept_offsets.data() + most,
                                                           kept_numbers.data() + most});
  measure_area_growth(exec, out, most, out_shares, false);
  reset_rebuilt(exec, out, kept_numbers.data() + most, most, out_shares);
}

}  // namespace umbel::cluster
