// Bisection of a block of neighbouring triangles into clusters by the surface area heuristic, by a
// team in its own memory: binned as in Wald, "On fast Construction of SAH-based Bounding Volume
// Hierarchies", 2007, with a penalty for clusters that are not full. Where a split within a bin
// would make full clusters, the rank along the axis separates the bin's items.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>

#include "base/bit_count.hpp"
#include "cluster/frame/block_boxes.hpp"

namespace umbel::cluster {

/// Sizes of clusters, and in sixteenths of an item what one that is missing costs.
struct BlockConstraints {
  uint32_t min_items, max_items;  ///< min_items <= max_items / 2
  uint32_t underfill;
  uint32_t reciprocal;  ///< of max_items: 2^22 over it, rounded up

  UMBEL_HOST_DEVICE uint32_t full_clusters(uint32_t items) const {
    return uint32_t(uint64_t(items) * reciprocal >> 22);
  }
  UMBEL_HOST_DEVICE uint64_t weight(uint32_t items) const {
    const uint32_t rest = items - full_clusters(items) * max_items;
    return 16 * uint64_t(items) + (rest ? uint64_t(underfill) * (max_items - rest) : 0);
  }
  UMBEL_HOST_DEVICE bool legal(uint32_t left, uint32_t items) const {
    return left >= min_items && items - left >= min_items;
  }
};

struct BlockLimits {
  static constexpr uint32_t kItems = 2048;
  static constexpr uint32_t kBins = 32;
  static constexpr uint32_t kFew = 256;   ///< keys that are ranked by comparing all with all
  static constexpr uint32_t kDepth = 12;  ///< nodes that wait, each the larger half of its parent
};

/// How a node is split: the `left` items whose keys along the axis are the smallest go left.
struct BlockSplit {
  uint64_t cost;
  uint32_t left;
  uint32_t choice;  ///< axis, bin, and whether through the bin

  UMBEL_HOST_DEVICE uint32_t axis() const { return choice / (4 * BlockLimits::kBins); }
  UMBEL_HOST_DEVICE uint32_t bin() const { return choice / 4 % BlockLimits::kBins; }
  UMBEL_HOST_DEVICE bool through() const { return choice % 4 != 0; }
};

struct CheaperSplit {
  UMBEL_HOST_DEVICE BlockSplit operator()(const BlockSplit& a, const BlockSplit& b) const {
    if (a.cost != b.cost) return a.cost < b.cost ? a : b;
    return a.choice <= b.choice ? a : b;
  }
};

struct BlockNode {
  uint32_t begin, end;
  BlockBox box;
};

/// The memory of a team that bisects. `Bin` is what its lanes can lower: BlockBox or WideBox.
template <typename Bin>
struct BlockMemory {
  BlockBox items[BlockLimits::kItems];
  uint16_t order[BlockLimits::kItems], other[BlockLimits::kItems];
  union {
    Bin bins[3][BlockLimits::kBins];
    uint32_t few[BlockLimits::kFew];  ///< keys, once the bins have been summed up
  };
  BlockBox lefts[3][BlockLimits::kBins],
      rights[3][BlockLimits::kBins];  ///< of all bins up to, and from
  uint32_t counts[3][BlockLimits::kBins];
  uint32_t before[3][BlockLimits::kBins];
  BlockNode waiting[BlockLimits::kDepth];
  uint32_t depth;
  uint32_t few_count, bound;
};

template <typename Team, typename Bin>
class BlockBisector {
 public:
  using Memory = BlockMemory<Bin>;
  using Node = BlockNode;
  static constexpr uint32_t kBins = BlockLimits::kBins;

  UMBEL_HOST_DEVICE BlockBisector(const Team& team, const BlockConstraints& constraints,
                                  Memory& memory)
      : team_(team), constraints_(constraints), m_(memory) {}

  /// Orders `count` items, which lanes have put into memory.items, into memory.order; calls
  /// start(position) on one lane where a cluster begins.
  template <typename Start>
  UMBEL_HOST_DEVICE void run(uint32_t count, const BlockBox& box, const Start& start) {
    for (uint32_t i = team_.rank(); i < count; i += team_.size()) m_.order[i] = uint16_t(i);
    if (team_.rank() == 0) {
      m_.waiting[0] = {0, count, box};
      m_.depth = 1;
    }
    team_.sync();
    while (m_.depth > 0) {
      const Node node = m_.waiting[m_.depth - 1];
      team_.sync();
      if (node.end - node.begin <= constraints_.max_items) {
        if (team_.rank() == 0) {
          start(node.begin);
          --m_.depth;
        }
        team_.sync();
        continue;
      }
      fill_bins(node);
      const BlockSplit split = find_split(node);
      divide(node, split);
    }
  }

 private:
  /// Bins of a node along an axis, by the middles of boxes, which are within [2 * min, 2 * max] of
  /// the node's. All numbers have 16 bits.
  struct Binning {
    uint32_t from, scale, factor;

    UMBEL_HOST_DEVICE static Binning of(const BlockBox& box, int axis) {
      const uint32_t range = 2 * box.extent(axis);
      if (range == 0) return {uint32_t(2 * int32_t(box.low[axis])), 1, 0};
      const uint32_t shift = leading_zeros(uint16_t(range));
      return {uint32_t(2 * int32_t(box.low[axis])), 1u << shift,
              (1u << 31) / ((range << shift) + 1)};
    }
    UMBEL_HOST_DEVICE uint32_t bin(uint32_t middle) const {
      return ((middle - from) * scale * factor >> 16) / ((1u << 15) / kBins);
    }
  };

  UMBEL_HOST_DEVICE void fill_bins(const Node& node) {
    for (uint32_t i = team_.rank(); i < 3 * kBins; i += team_.size()) {
      m_.bins[i / kBins][i % kBins] = Bin::empty();
      m_.counts[i / kBins][i % kBins] = 0;
    }
    if (team_.rank() == 0) m_.few_count = 0;
    team_.sync();
    const Binning x = Binning::of(node.box, 0), y = Binning::of(node.box, 1),
                  z = Binning::of(node.box, 2);
#if UMBEL_BOX_VECTORS
    if constexpr (Team::kIsSerial) {
      fill_serially(node, x, y, z);
    } else
#endif
      for (uint32_t i = node.begin + team_.rank(); i < node.end; i += team_.size()) {
        const BlockBox& item = m_.items[m_.order[i]];
        add(0, x.bin(item.middle(0)), item);
        add(1, y.bin(item.middle(1)), item);
        add(2, z.bin(item.middle(2)), item);
      }
    team_.sync();
    for (uint32_t sweep = team_.rank(); sweep < 6; sweep += team_.size()) accumulate(sweep);
    team_.sync();
  }
#if UMBEL_BOX_VECTORS
  /// All three axes at once.
  void fill_serially(const Node& node, const Binning& x, const Binning& y, const Binning& z) {
    const auto of = [](uint32_t a, uint32_t b, uint32_t c) {
      return _mm_setr_epi16(int16_t(a), int16_t(b), int16_t(c), 0, 0, 0, 0, 0);
    };
    const __m128i from = of(x.from, y.from, z.from), scale = of(x.scale, y.scale, z.scale),
                  factor = of(x.factor, y.factor, z.factor);
    constexpr int kShift = 15 - std::countr_zero(kBins);
    const auto put = [&](uint32_t i) {
      const BlockBox& item = m_.items[m_.order[i]];
      const __m128i box = item.load(), middle = _mm_sub_epi16(box, _mm_srli_si128(box, 8));
      const __m128i scaled = _mm_mullo_epi16(_mm_sub_epi16(middle, from), scale);
      const __m128i bins = _mm_srli_epi16(_mm_mulhi_epu16(scaled, factor), kShift);
      add(0, uint32_t(_mm_extract_epi16(bins, 0)), item);
      add(1, uint32_t(_mm_extract_epi16(bins, 1)), item);
      add(2, uint32_t(_mm_extract_epi16(bins, 2)), item);
    };
    // Neighbours often share a bin, and would wait for each other; from two positions at once
    // they wait half as long.
    const uint32_t half = (node.end - node.begin) / 2;
    for (uint32_t i = node.begin; i < node.begin + half; ++i) {
      put(i);
      put(i + half);
    }
    if (node.begin + 2 * half < node.end) put(node.end - 1);
  }
#endif
  UMBEL_HOST_DEVICE void add(int axis, uint32_t bin, const BlockBox& item) {
    join_shared(team_, m_.bins[axis][bin], item);
    team_.add(&m_.counts[axis][bin], 1);
  }
  UMBEL_HOST_DEVICE void accumulate(uint32_t sweep) {
    const uint32_t axis = sweep % 3;
    BlockBox box = BlockBox::empty();
    if (sweep < 3) {
      uint32_t before = 0;
      for (uint32_t k = 0; k < kBins; ++k) {
        m_.before[axis][k] = before;
        before += m_.counts[axis][k];
        box.join(m_.bins[axis][k]);
        m_.lefts[axis][k] = box;
      }
    } else {
      for (uint32_t k = kBins; k-- > 0;) {
        box.join(m_.bins[axis][k]);
        m_.rights[axis][k] = box;
      }
    }
  }

  UMBEL_HOST_DEVICE BlockSplit find_split(const Node& node) const {
    const uint32_t items = node.end - node.begin;
    // Where nothing else is legal: half of the items, along the longest axis.
    uint32_t longest = 0;
    for (uint32_t axis = 1; axis < 3; ++axis)
      if (node.box.extent(int(axis)) > node.box.extent(int(longest))) longest = axis;
    uint32_t middle = 0;
    while (middle + 1 < kBins && m_.before[longest][middle + 1] <= items / 2) ++middle;
    BlockSplit best{~uint64_t(0), items / 2, (longest * kBins + middle) * 4 + 3};
    const CheaperSplit cheaper;
    for (uint32_t i = team_.rank(); i < 3 * kBins; i += team_.size()) {
      const uint32_t axis = i / kBins, bin = i % kBins;
      const uint32_t before = m_.before[axis][bin], inside = m_.counts[axis][bin];
      if (inside == 0) continue;
      const uint32_t after = items - before - inside;
      const uint64_t right_area = padded_area(m_.rights[axis][bin]);
      if (bin > 0 && constraints_.legal(before, items)) {
        const uint64_t cost = padded_area(m_.lefts[axis][bin - 1]) * constraints_.weight(before) +
                              right_area * constraints_.weight(items - before);
        best = cheaper(best, {cost, before, i * 4});
      }
      // Splits within the bin that leave full clusters on one side.
      const uint32_t from_left =
          constraints_.full_clusters(before + inside - 1) * constraints_.max_items;
      const uint32_t from_right =
          constraints_.full_clusters(after + inside - 1) * constraints_.max_items;
      for (uint32_t k = 1; k < 3; ++k) {
        const uint32_t left = k == 1 ? from_left : items - from_right;
        if (left <= before || left >= before + inside || !constraints_.legal(left, items)) continue;
        const uint64_t cost = padded_area(m_.lefts[axis][bin]) * constraints_.weight(left) +
                              right_area * constraints_.weight(items - left);
        best = cheaper(best, {cost, left, i * 4 + k});
      }
    }
    return team_.reduce(best, cheaper);
  }

  /// The rank of an item along an axis; no two are equal.
  UMBEL_HOST_DEVICE uint32_t key(uint32_t axis, uint32_t item) const {
    return m_.items[item].middle(int(axis)) * BlockLimits::kItems + item;
  }

  UMBEL_HOST_DEVICE void divide(const Node& node, const BlockSplit& split) {
    const uint32_t axis = split.axis();
    const Binning binning = Binning::of(node.box, int(axis));
    // What has a key below this goes left.
    const uint32_t bound =
        split.through() ? find_bound(node, split, binning)
                        : first_middle(node, binning, int(axis), split.bin()) * BlockLimits::kItems;
    uint32_t left = node.begin, right = node.begin + split.left;
    for (uint32_t base = node.begin; base < node.end; base += team_.size()) {
      const uint32_t i = base + team_.rank();
      const bool present = i < node.end;
      const uint16_t item = present ? m_.order[i] : 0;
      const bool is_left = present && key(axis, item) < bound;
      if constexpr (Team::kIsSerial) {
        m_.other[is_left ? left : right] = item;
        left += is_left;
        right += !is_left;
      } else {
        const uint32_t left_before = team_.rank_among(is_left), lefts = team_.count(is_left);
        const uint32_t all = node.end - base < team_.size() ? node.end - base : team_.size();
        if (present)
          m_.other[is_left ? left + left_before : right + team_.rank() - left_before] = item;
        left += lefts;
        right += all - lefts;
      }
    }
    team_.sync();
    for (uint32_t i = node.begin + team_.rank(); i < node.end; i += team_.size())
      m_.order[i] = m_.other[i];
    if (team_.rank() == 0) push_halves(node, split);
    team_.sync();
  }

  /// The least middle in the bin or behind it.
  UMBEL_HOST_DEVICE static uint32_t first_middle(const Node& node, const Binning& binning, int axis,
                                                 uint32_t bin) {
    uint32_t low = binning.from, high = low + 2 * node.box.extent(axis) + 1;
    while (low < high) {
      const uint32_t middle = low + (high - low) / 2;
      if (binning.bin(middle) < bin)
        low = middle + 1;
      else
        high = middle;
    }
    return low;
  }

  UMBEL_HOST_DEVICE void push_halves(const Node& node, const BlockSplit& split) {
    const uint32_t axis = split.axis(), bin = split.bin(), middle = node.begin + split.left;
    const Node left{node.begin, middle, m_.lefts[axis][split.through() ? bin : bin - 1]};
    const Node right{middle, node.end, m_.rights[axis][bin]};
    const bool left_is_larger = split.left > node.end - middle;
    // The larger half waits, so that few nodes do.
    m_.waiting[m_.depth - 1] = left_is_larger ? left : right;
    m_.waiting[m_.depth++] = left_is_larger ? right : left;
  }

  /// The key of the first item of the bin that stays right.
  UMBEL_HOST_DEVICE uint32_t find_bound(const Node& node, const BlockSplit& split,
                                        const Binning& binning) {
    const uint32_t axis = split.axis(), bin = split.bin();
    const uint32_t wanted = split.left - m_.before[axis][bin];
    if constexpr (Team::kIsSerial) {
      uint32_t keys[BlockLimits::kItems];
      uint32_t count = 0;
      for (uint32_t i = node.begin; i < node.end; ++i) {
        const uint32_t item = m_.order[i];
        if (binning.bin(m_.items[item].middle(int(axis))) == bin) keys[count++] = key(axis, item);
      }
      std::nth_element(keys, keys + wanted, keys + count);
      return keys[wanted];
    } else {
      // `wanted` keys of the bin or fewer are below low, more below high; at first none and all.
      uint32_t low = first_middle(node, binning, int(axis), bin) * BlockLimits::kItems;
      uint32_t high = first_middle(node, binning, int(axis), bin + 1) * BlockLimits::kItems;
      uint32_t below_low = 0, below_high = m_.counts[axis][bin];
      while (below_high - below_low > BlockLimits::kFew) {
        const uint32_t middle = low + (high - low) / 2;
        uint32_t below = 0;
        each_key(node, axis, [&](uint32_t key) { below += key >= low && key < middle ? 1 : 0; });
        below = below_low + team_.reduce(below, Sum{});
        (below <= wanted ? low : high) = middle;
        (below <= wanted ? below_low : below_high) = below;
      }
      each_key(node, axis, [&](uint32_t key) {
        if (key >= low && key < high) m_.few[team_.add(&m_.few_count, 1)] = key;
      });
      team_.sync();
      const uint32_t few = below_high - below_low;
      for (uint32_t i = team_.rank(); i < few; i += team_.size()) {
        uint32_t below = below_low;
        for (uint32_t k = 0; k < few; ++k) below += m_.few[k] < m_.few[i] ? 1 : 0;
        if (below == wanted) m_.bound = m_.few[i];
      }
      team_.sync();
      return m_.bound;
    }
  }
  /// Calls visit with the keys of a node's items, each on one lane. Keys of a bin are those from
  /// its first middle on, so they need not be asked for their bin.
  template <typename Visit>
  UMBEL_HOST_DEVICE void each_key(const Node& node, uint32_t axis, const Visit& visit) const {
    for (uint32_t i = node.begin + team_.rank(); i < node.end; i += team_.size())
      visit(key(axis, m_.order[i]));
  }
  struct Sum {
    UMBEL_HOST_DEVICE uint32_t operator()(uint32_t a, uint32_t b) const { return a + b; }
  };

  const Team& team_;
  BlockConstraints constraints_;
  Memory& m_;
};

}  // namespace umbel::cluster
