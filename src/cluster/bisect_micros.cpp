// Nodes are split by the surface area heuristic between bins of micro-clusters (binned as by Wald,
// "On fast construction of SAH-based bounding volume hierarchies", 2007).
#include "cluster/bisect_micros.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <vector>

#include "base/parallel.hpp"

namespace umbel::cluster {
namespace {

constexpr uint32_t kMostBins = 32;
constexpr uint32_t kParallel = 1 << 15;    ///< items from which on the two sides run in parallel
constexpr uint32_t kTabled = 1 << 12;      ///< weights of fewer items are looked up
constexpr uint32_t kMostSorted = 1 << 12;  ///< micro-clusters

// {low.xyz, -, -high.xyz, -} of centres; the same operations as for boxes.
SmallBox centers_of(SmallBox box) {
  const SmallBox c = SmallBox(center_of(box));
  return __builtin_shufflevector(c, -c, 0, 1, 2, 3, 8, 9, 10, 11);
}

struct Node {
  uint32_t begin, end;     ///< of the micro-clusters
  uint32_t offset, count;  ///< of the items
  uint32_t depth;
  SmallBox box, centers;
};

struct Bins {
  SmallBox boxes[3][kMostBins];
  uint32_t counts[3][kMostBins];
};

struct Choice {
  int axis = -1;  ///< -1: none
  uint32_t bin = 0, position = 0;
  SmallBox left, right;
};

class Splitter {
 public:
  using Exact = std::function<void(uint32_t, uint32_t)>;

  Splitter(const Rules& rules, MicroSet& set, uint32_t* items, uint8_t* first, const Exact& exact,
           const std::function<void(uint32_t)>& done)
      : rules_(rules),
        set_(set),
        spare_(set.micros.size()),
        items_(items),
        first_(first),
        exact_(exact),
        done_(done),
        weights_(kTabled) {
    for (uint32_t i = 0; i < kTabled; ++i) weights_[i] = rules.weight(i);
  }

  void run(uint32_t count) {
    Node root{0,
              uint32_t(set_.micros.size()),
              0,
              count,
              2 * uint32_t(std::bit_width(count)) + 8,
              empty_small_box(),
              empty_small_box()};
    for (const Micro& micro : set_.micros) {
      root.box = join(root.box, micro.box);
      root.centers = join(root.centers, centers_of(micro.box));
    }
    split_part(root);
  }

 private:
  void split(const Node& node) {
    if (node.count <= rules_.config.max_items) return finish(node, true);
    if (node.depth == 0) return finish(node, false);
    std::array<uint32_t, 3> factor;
    const Choice choice = cheapest(node, factor);
    Node left, right;
    if (choice.axis >= 0) {
      separate(node, choice, factor[choice.axis], left, right);
    } else if (node.end - node.begin > kMostSorted || !separate_sorted(node, left, right)) {
      return finish(node, false);
    }
    if (node.count < kParallel) {
      split(left);
      split(right);
    } else {
      tbb::parallel_invoke([&] { split_part(left); }, [&] { split_part(right); });
    }
  }

  void split_part(const Node& node) {
    split(node);
    if (node.count < kParallel) done_(node.count);
  }

  void finish(const Node& node, bool is_leaf) {
    uint32_t* to = items_ + node.offset;
    for (uint32_t m = node.begin; m < node.end; ++m) {
      const Micro& micro = set_.micros[m];
      to = std::copy_n(set_.order.data() + micro.begin, micro.count, to);
    }
    if (is_leaf)
      first_[node.offset] = 1;
    else
      exact_(node.offset, node.count);
  }

  float weight(uint32_t n) const { return n < kTabled ? weights_[n] : rules_.weight(n); }

  Choice cheapest(const Node& node, std::array<uint32_t, 3>& factor) const {
    const uint32_t bins = node.end - node.begin < 64 ? 16 : kMostBins;
    Bins b;
    for (int k = 0; k < 3; ++k) {
      const uint32_t extent = uint32_t(-int(node.centers[k]) - int(node.centers[k + 4]));
      factor[k] = (bins << 16) / (extent + 1);
      std::fill_n(b.boxes[k], bins, empty_small_box());
      std::fill_n(b.counts[k], bins, 0u);
    }
    for (uint32_t m = node.begin; m < node.end; ++m) {
      const SmallBox box = set_.micros[m].box;
      const uint32_t count = set_.micros[m].count;
      const Center8 c = center_of(box) - Center8(node.centers);
      for (int k = 0; k < 3; ++k) {
        const uint32_t bin = c[k] * factor[k] >> 16;
        b.boxes[k][bin] = join(b.boxes[k][bin], box);
        b.counts[k][bin] += count;
      }
    }
    Choice best;
    float best_cost = std::numeric_limits<float>::infinity();
    for (int k = 0; k < 3; ++k)
      if (node.centers[k] + node.centers[k + 4] != 0) weigh(node, b, k, bins, best, best_cost);
    if (best.axis < 0) return best;
    best.left = best.right = empty_small_box();
    for (uint32_t i = 0; i < bins; ++i) {
      SmallBox& side = i < best.bin ? best.left : best.right;
      side = join(side, b.boxes[best.axis][i]);
    }
    return best;
  }

  void weigh(const Node& node, const Bins& b, int axis, uint32_t bins, Choice& best,
             float& best_cost) const {
    const uint32_t least = rules_.config.min_items;
    std::array<float, kMostBins> right_area;
    SmallBox side = empty_small_box();
    for (uint32_t i = bins - 1; i > 0; --i) {
      side = join(side, b.boxes[axis][i]);
      right_area[i] = half_area(side);
    }
    side = empty_small_box();
    uint32_t count = 0;
    for (uint32_t i = 1; i < bins; ++i) {
      side = join(side, b.boxes[axis][i - 1]);
      count += b.counts[axis][i - 1];
      if (count < least) continue;
      if (node.count - count < least) break;
      const float cost =
          half_area(side) * weight(count) + right_area[i] * weight(node.count - count);
      if (cost < best_cost) {
        best_cost = cost;
        best.axis = axis;
        best.bin = i;
        best.position = count;
      }
    }
  }

  void separate(const Node& node, const Choice& choice, uint32_t factor, Node& left, Node& right) {
    Micro* micros = set_.micros.data();
    Micro* spare = spare_.data() + node.begin;
    const int axis = choice.axis;
    const uint32_t origin = uint16_t(node.centers[axis]);
    uint32_t l = node.begin, r = 0;
    SmallBox centers[2] = {empty_small_box(), empty_small_box()};
    for (uint32_t m = node.begin; m < node.end; ++m) {
      const Micro micro = micros[m];
      const Center8 c = center_of(micro.box);
      const uint32_t is_right = ((c[axis] - origin) * factor >> 16) >= choice.bin;
      micros[l] = micro;
      spare[r] = micro;
      l += 1 - is_right;
      r += is_right;
      centers[is_right] = join(centers[is_right], centers_of(micro.box));
    }
    std::copy_n(spare, r, micros + l);
    const uint32_t depth = node.depth - 1;
    left = {node.begin, l, node.offset, choice.position, depth, choice.left, centers[0]};
    right = {l,
             node.end,
             node.offset + choice.position,
             node.count - choice.position,
             depth,
             choice.right,
             centers[1]};
  }

  // Where all planes between bins leave too few items on one side, as those of a crowd and a few
  // outliers do, the micro-clusters are sorted instead.
  bool separate_sorted(const Node& node, Node& left, Node& right) {
    const uint32_t n = node.end - node.begin, least = rules_.config.min_items;
    Micro* micros = set_.micros.data() + node.begin;
    std::vector<float> right_area(n);
    float best_cost = std::numeric_limits<float>::infinity();
    int best_axis = -1;
    uint32_t best = 0;
    for (int k = 0; k < 3; ++k) {
      sort_along(micros, n, k);
      SmallBox side = empty_small_box();
      for (uint32_t i = n - 1; i > 0; --i) {
        side = join(side, micros[i].box);
        right_area[i] = half_area(side);
      }
      side = empty_small_box();
      uint32_t count = 0;
      for (uint32_t i = 1; i < n; ++i) {
        side = join(side, micros[i - 1].box);
        count += micros[i - 1].count;
        if (count < least || node.count - count < least) continue;
        const float cost =
            half_area(side) * weight(count) + right_area[i] * weight(node.count - count);
        if (cost < best_cost) best_cost = cost, best_axis = k, best = i;
      }
    }
    if (best_axis < 0) return false;
    sort_along(micros, n, best_axis);
    left = part_of(node, node.begin, node.begin + best, node.offset);
    right = part_of(node, node.begin + best, node.end, node.offset + left.count);
    return true;
  }

  static void sort_along(Micro* micros, uint32_t n, int axis) {
    std::sort(micros, micros + n, [axis](const Micro& a, const Micro& b) {
      const uint16_t x = center_of(a.box)[axis], y = center_of(b.box)[axis];
      return x != y ? x < y : a.begin < b.begin;
    });
  }

  Node part_of(const Node& node, uint32_t begin, uint32_t end, uint32_t offset) const {
    Node part{begin, end, offset, 0, node.depth - 1, empty_small_box(), empty_small_box()};
    for (uint32_t m = begin; m < end; ++m) {
      part.count += set_.micros[m].count;
      part.box = join(part.box, set_.micros[m].box);
      part.centers = join(part.centers, centers_of(set_.micros[m].box));
    }
    return part;
  }

  const Rules& rules_;
  MicroSet& set_;
  std::vector<Micro> spare_;
  uint32_t* items_;
  uint8_t* first_;
  const Exact& exact_;
  const std::function<void(uint32_t)>& done_;
  std::vector<float> weights_;
};

}  // namespace

void bisect_micros(const Source& source, const Rules& rules, uint32_t* items, uint8_t* first,
                   uint32_t count, const BoxRecord& bounds,
                   const std::function<void(uint32_t, uint32_t)>& exact,
                   const std::function<void(uint32_t)>& done) {
  // Large enough to save most of the work, small enough to leave a choice of legal sizes.
  const ClusterConfig& config = rules.config;
  const uint32_t most = std::min(config.max_items / 4, (config.max_items - config.min_items) / 3);
  MicroSet set = make_micros(source, items, count, bounds, std::max(most, 1u));
  Splitter(rules, set, items, first, exact, done).run(count);
}

}  // namespace umbel::cluster
