// The surface area heuristic between bins of micro-clusters and, where whole clusters end inside a
// bin, there: areas within a bin are taken to grow evenly, from a little more than before it.
#include "cluster/bisect/micro_cluster_bins.hpp"

#include <algorithm>
#include <limits>

namespace umbel::cluster {
namespace {

constexpr size_t kFewMicroClusters = 128, kManyMicroClusters = 256;  ///< that are worth more bins
constexpr float kJump = 0.25f;  ///< by which areas grow as soon as a bin is entered

BinMapping mapping_for(ShortBox centers, uint32_t bins) {
  BinMapping mapping;
  for (int k = 0; k < 3; ++k) {
    mapping.origin[k] = static_cast<uint16_t>(centers[k]);
    const uint32_t extent = uint32_t(-int(centers[k]) - int(centers[k + 4]));
    const uint32_t shift = extent ? 16 - std::bit_width(extent) : 0;
    mapping.multiplier[k] = static_cast<uint16_t>(1u << shift);
    mapping.factor[k] = static_cast<uint16_t>(extent ? (bins << 16) / ((extent + 1) << shift) : 0);
  }
  return mapping;
}

}  // namespace

MicroClusterBins::MicroClusterBins(const SplitConstraints& constraints)
    : constraints_(constraints), weights_(kTabled), last_weights_(kTabled), whole_(kTabled) {
  for (uint32_t i = 0; i < kTabled; ++i) {
    weights_[i] = constraints.weight(i, constraints.underfill_cost(kNone));
    last_weights_[i] = constraints.weight(i, constraints.underfill_cost(1));
    whole_[i] = i - i % constraints.config.max_items;
  }
}

Choice MicroClusterBins::cheapest(const MicroCluster* begin, const MicroCluster* end,
                                  uint32_t count, ShortBox centers) const {
  Bins bins;
  const size_t micros = size_t(end - begin);
  bins.count = micros < kFewMicroClusters ? 8 : micros < kManyMicroClusters ? 16 : kMost;
  Choice best;
  best.mapping = mapping_for(centers, bins.count);
  for (int k = 0; k < 3; ++k) {
    std::fill_n(bins.boxes[k], bins.count, empty_short_box());
    std::fill_n(bins.counts[k], bins.count, 0u);
  }
  for (const MicroCluster* m = begin; m < end; ++m) {
    const ShortBox box = m->box;
    const UShort8 bin_of = best.mapping.of(box);
    for (int k = 0; k < 3; ++k) {
      const uint32_t bin = bin_of[k];
      bins.boxes[k][bin] = join(bins.boxes[k][bin], box);
      bins.counts[k][bin] += m->count;
    }
  }
  float best_cost = std::numeric_limits<float>::infinity();
  for (int k = 0; k < 3; ++k)
    if (centers[k] + centers[k + 4] != 0) weigh(bins, k, count, best, best_cost);
  return best;
}

void MicroClusterBins::weigh(const Bins& bins, int axis, uint32_t count, Choice& best,
                             float& best_cost) const {
  const uint32_t least = constraints_.config.min_items;
  const bool feasible = constraints_.feasible(count);
  const float underfill_cost = constraints_.underfill_cost(count);
  const float* table =
      (underfill_cost == constraints_.underfill_cost(kNone) ? weights_ : last_weights_).data();
  const auto weight = [&](uint32_t n) {
    return n < kTabled ? table[n] : constraints_.weight(n, underfill_cost);
  };
  std::array<float, kMost + 1> right_area;
  right_area[bins.count] = 0;
  ShortBox side = empty_short_box();
  for (uint32_t i = bins.count - 1; i > 0; --i) {
    // NOLINTNEXTLINE(clang-analyzer-security.ArrayBound): at least one bin
    side = join(side, bins.boxes[axis][i]);
    right_area[i] = box_area(side);
  }
  right_area[0] = box_area(join(side, bins.boxes[axis][0]));
  const auto weigh_at = [&](uint32_t bin, uint32_t before, uint32_t position, float left,
                            float right) {
    const float cost = left * weight(position) + right * weight(count - position);
    if (!(cost < best_cost) || !constraints_.legal(position, count, feasible)) return;
    best_cost = cost;
    best.axis = axis;
    best.bin = bin;
    best.before = before;
    best.position = position;
  };
  side = empty_short_box();
  float left_area = 0;
  for (uint32_t i = 0, before = 0; i < bins.count && before < count; ++i) {
    const uint32_t inside = bins.counts[axis][i], after = before + inside;
    if (inside == 0) continue;
    if (before >= least && count - before >= least)
      weigh_at(i, before, before, left_area, right_area[i]);
    side = join(side, bins.boxes[axis][i]);
    const float next_area = box_area(side);
    if (inside > 1 && after > least && before + least < count) {
      const float per_item = (1 - kJump) / static_cast<float>(inside);
      for (const uint32_t full : {whole(after - 1), count - whole(count - before - 1)}) {
        const uint32_t position = std::min(std::max(full, least), count - least);
        if (position <= before || position >= after) continue;
        const float f = per_item * static_cast<float>(position - before);
        weigh_at(i, before, position, left_area + (kJump + f) * (next_area - left_area),
                 right_area[i + 1] + (1 - f) * (right_area[i] - right_area[i + 1]));
      }
    }
    left_area = next_area;
    before = after;
  }
}

}  // namespace umbel::cluster
