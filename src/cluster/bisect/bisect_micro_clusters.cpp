// Nodes are split by the surface area heuristic between bins of micro-clusters (binned as by Wald,
// "On fast construction of SAH-based bounding volume hierarchies", 2007), or within a bin where
// that fills the clusters: then one micro-cluster is split item by item.
#include "cluster/bisect/bisect_micro_clusters.hpp"

#include <algorithm>
#include <bit>
#include <utility>
#include <vector>

#include "base/parallel.hpp"
#include "cluster/bisect/micro_cluster_bins.hpp"

namespace umbel::cluster {
namespace {

constexpr uint32_t kParallel = 1 << 15;  ///< items from which on the two sides run in parallel
constexpr uint32_t kGroup = 16;          ///< micro-clusters that stand for one
constexpr size_t kFewGroups = 64;        ///< too few to choose from
constexpr uint32_t kMostRoundings = 4;   ///< one inside another

struct MicroNode {
  const MicroCluster* begin;
  const MicroCluster* end;
  uint32_t offset, count;  ///< of the items
  uint32_t depth;
  ShortBox centers;
};

// Where items go, and who takes those that suit no micro-clusters.
struct Target {
  const Segment& segment;
  const MicroClusterBins& bins;
  MicroClusterSizes sizes;
  const std::function<void(uint32_t, uint32_t)>& exact;
  const std::function<void(uint32_t)>& done;
};

void bisect(const Target& target, uint32_t offset, uint32_t count, const Box4& bounds,
            uint32_t roundings);

// Items that are in place, with boxes rounded again to a finer grid.
void round_again(const Target& target, uint32_t offset, uint32_t count, uint32_t roundings) {
  if (roundings < kMostRoundings) {
    const Box4 box = box_of(target.segment.source, target.segment.items + offset, count);
    if (suits_short_boxes(box)) return bisect(target, offset, count, box, roundings + 1);
  }
  target.exact(offset, count);
}

uint32_t* write_items(const MicroCluster& micro, uint32_t* to) {
  for (uint32_t i = 0; i < micro.count; ++i) *to++ = tag_of(micro.items[i]);
  return to;
}

// An order of positions that depends on nothing but geometry, up to equal rounded boxes.
bool is_before(const ShortBox& a, const ShortBox& b, int axis) {
  const uint16_t x = center_of(a, axis), y = center_of(b, axis);
  if (x != y) return x < y;
  for (const int k : {0, 1, 2, 4, 5, 6})
    if (a[k] != b[k]) return a[k] < b[k];
  return tag_of(a) < tag_of(b);
}

// Bisects one node and all below it: while it is large by groups, then by micro-clusters.
class MicroSplitter {
 public:
  MicroSplitter(const Target& target, uint32_t roundings)
      : target_(target), roundings_(roundings) {}

  // A node of groups.
  void run(const MicroNode& node) {
    if (node.count < kParallel || size_t(node.end - node.begin) < kFewGroups || node.depth == 0)
      return run_alone(node);
    const Choice choice = target_.bins.cheapest(node.begin, node.end, node.count, node.centers);
    if (choice.axis < 0 || choice.position != choice.before) return run_alone(node);
    const size_t count = size_t(node.end - node.begin);
    std::vector<MicroCluster> copy(count + 1);
    MicroNode left, right;
    {
      std::vector<MicroCluster> spare(count + 1), between(count + 1);
      origin_ = copy.data();
      spare_ = spare.data();
      between_ = between.data();
      std::copy(node.begin, node.end, copy.begin());
      MicroNode own = node;
      own.begin = copy.data();
      own.end = own.begin + count;
      separate(own, choice, left, right);
    }
    parallel_invoke([&] { MicroSplitter(target_, roundings_).run(left); },
                    [&] { MicroSplitter(target_, roundings_).run(right); });
  }

 private:
  // A split within a micro-cluster makes one more: at most one a level at any time, as the left
  // side lies behind the right and is gone when that is split.
  void run_alone(const MicroNode& node) {
    size_t count = 0;
    for (const MicroCluster* group = node.begin; group < node.end; ++group)
      count += group->part_count;
    const size_t room = count + node.depth + 1;
    std::vector<MicroCluster> micros(room), spare(room), between(room);
    MicroCluster* to = micros.data();
    MicroNode own = node;
    own.centers = empty_short_box();
    for (const MicroCluster* group = node.begin; group < node.end; ++group)
      to = std::copy_n(group->parts, group->part_count, to);
    for (size_t m = 0; m < count; ++m) own.centers = join(own.centers, centers_of(micros[m].box));
    origin_ = micros.data();
    spare_ = spare.data();
    between_ = between.data();
    own.begin = origin_;
    own.end = origin_ + count;
    split(own);
    target_.done(node.count);
  }

  void split(const MicroNode& node) {
    if (node.count <= target_.segment.constraints.config.max_items) return finish(node, true);
    if (node.depth == 0) return finish(node, false);
    const Choice choice = target_.bins.cheapest(node.begin, node.end, node.count, node.centers);
    if (choice.axis < 0) return finish(node, false);
    MicroNode left, right;
    separate(node, choice, left, right);
    split(left);
    split(right);
  }

  void finish(const MicroNode& node, bool is_leaf) const {
    uint32_t* to = target_.segment.items + node.offset;
    for (const MicroCluster* micro = node.begin; micro < node.end; ++micro)
      to = write_items(*micro, to);
    if (is_leaf)
      target_.segment.first[node.offset] = 1;
    else if (node.depth > 0)
      round_again(target_, node.offset, node.count, roundings_);
    else
      target_.exact(node.offset, node.count);
  }

  // The right side comes first in memory.
  void separate(const MicroNode& node, const Choice& choice, MicroNode& left, MicroNode& right) {
    MicroCluster* micros = origin_ + (node.begin - origin_);
    MicroCluster* spare = spare_ + (node.begin - origin_);
    Sides sides;
    if (choice.position == choice.before)
      divide<false>(node, choice, micros, spare, sides);
    else
      divide<true>(node, choice, micros, spare, sides);
    const size_t l = sides.left, r = sides.right;
    std::copy_n(spare, l, micros + r);
    const uint32_t depth = node.depth - 1;
    right = {
        micros, micros + r,         node.offset + choice.position, node.count - choice.position,
        depth,  sides.right_centers};
    left = {micros + r, micros + r + l, node.offset, choice.position, depth, sides.left_centers};
  }

  struct Sides {
    size_t left = 0, right = 0;  ///< micro-clusters
    ShortBox left_centers = empty_short_box(), right_centers = empty_short_box();
  };

  template <bool kThroughBin>
  void divide(const MicroNode& node, const Choice& choice, MicroCluster* micros,
              MicroCluster* spare, Sides& sides) {
    size_t l = 0, r = 0, b = 0;
    ShortBox left_centers = empty_short_box(), right_centers = left_centers;
    for (const MicroCluster* m = node.begin; m < node.end; ++m) {
      const MicroCluster micro = *m;
      const uint32_t bin = choice.mapping.of(m->box, choice.axis);
      const uint32_t is_left = bin < choice.bin, is_between = kThroughBin && bin == choice.bin;
      const ShortBox centers = centers_of(micro.box);
      micros[r] = micro;
      spare[l] = micro;
      if constexpr (kThroughBin) between_[b] = micro;
      l += is_left;
      r += 1 - is_left - is_between;
      b += is_between;
      left_centers = join(left_centers, only_if(is_left, centers));
      right_centers = join(right_centers, only_if(1 - is_left - is_between, centers));
    }
    sides = {l, r, left_centers, right_centers};
    if constexpr (kThroughBin) split_bin(b, choice, micros, spare, sides);
  }

  // Moves the first micro-clusters of the bin that is split to the left, until that has its items.
  void split_bin(size_t count, const Choice& choice, MicroCluster* micros, MicroCluster* spare,
                 Sides& sides) {
    const int axis = choice.axis;
    const auto give = [&](const MicroCluster& micro, bool to_left) {
      (to_left ? spare[sides.left++] : micros[sides.right++]) = micro;
      ShortBox& centers = to_left ? sides.left_centers : sides.right_centers;
      centers = join(centers, centers_of(micro.box));
    };
    std::sort(between_, between_ + count, [axis](const MicroCluster& x, const MicroCluster& y) {
      return is_before(x.box, y.box, axis);
    });
    uint32_t wanted = choice.position - choice.before;
    for (size_t k = 0; k < count; ++k) {
      MicroCluster& micro = between_[k];
      if (wanted > 0 && micro.count > wanted) {
        give(take_items(micro, wanted, axis), true);
        wanted = 0;
      }
      give(micro, wanted > 0);
      if (wanted > 0) wanted -= micro.count;
    }
  }

  // Takes the first `count` items along an axis out of a micro-cluster.
  MicroCluster take_items(MicroCluster& micro, uint32_t count, int axis) const {
    ShortBox* items = micro.items;
    std::nth_element(
        items, items + count, items + micro.count,
        [axis](const ShortBox& a, const ShortBox& b) { return is_before(a, b, axis); });
    MicroCluster taken{empty_short_box(), {items}, count, 0};
    for (uint32_t i = 0; i < count; ++i) taken.box = join(taken.box, items[i]);
    ShortBox rest = empty_short_box();
    for (uint32_t i = count; i < micro.count; ++i) rest = join(rest, items[i]);
    micro = {rest, {items + count}, micro.count - count, 0};
    return taken;
  }

  const Target& target_;
  const uint32_t roundings_;
  MicroCluster* origin_ = nullptr;
  MicroCluster* spare_ = nullptr;
  MicroCluster* between_ = nullptr;
};

// Clusters each set of coincident items by itself and writes it behind all other items. Where fewer
// than a cluster's items are left, the nearest set takes them.
void bisect_coincident(const Target& target, const MicroClusterSet& set, uint32_t offset,
                       uint32_t others, uint32_t roundings) {
  std::vector<MicroCluster> sets = set.coincident;
  uint32_t taken = 0;
  uint32_t* to = target.segment.items + offset;
  if (others > 0 && others < target.segment.constraints.config.min_items) {
    ShortBox box = empty_short_box();
    for (const MicroCluster& group : set.groups) {
      box = join(box, group.box);
      for (uint32_t m = 0; m < group.part_count; ++m) to = write_items(group.parts[m], to);
    }
    const auto area = [&](const MicroCluster& m) { return box_area(join(m.box, box)); };
    const auto next = std::min_element(
        sets.begin(), sets.end(),
        [&](const MicroCluster& a, const MicroCluster& b) { return area(a) < area(b); });
    std::swap(sets[0], *next);
    taken = others;
  } else {
    to += others;
  }
  std::vector<Range> ranges;
  for (const MicroCluster& m : sets) {
    const uint32_t begin = uint32_t(to - target.segment.items) - taken;
    to = write_items(m, to);
    ranges.push_back({begin, m.count + std::exchange(taken, 0u)});
  }
  parallel_for(ranges.size(), 16, [&](size_t c) {
    round_again(target, ranges[c].offset, ranges[c].count, roundings);
  });
}

void bisect(const Target& target, uint32_t offset, uint32_t count, const Box4& bounds,
            uint32_t roundings) {
  const MicroClusterSet set = make_micro_clusters(
      target.segment.source, target.segment.items + offset, count, bounds, target.sizes);
  uint32_t others = count;
  for (const MicroCluster& m : set.coincident) others -= m.count;
  const bool few = others < target.segment.constraints.config.min_items;
  if ((set.groups.empty() || few) && set.coincident.size() < 2) return target.exact(offset, count);
  bisect_coincident(target, set, offset, others, roundings);
  if (few) return;
  MicroNode root{set.groups.data(),
                 set.groups.data() + set.groups.size(),
                 offset,
                 others,
                 2 * uint32_t(std::bit_width(count)) + 8,
                 empty_short_box()};
  for (const MicroCluster& group : set.groups)
    root.centers = join(root.centers, centers_of(group.box));
  MicroSplitter(target, roundings).run(root);
}

}  // namespace

void bisect_micro_clusters(const Segment& segment, const Box4& bounds,
                           const std::function<void(uint32_t, uint32_t)>& exact,
                           const std::function<void(uint32_t)>& done) {
  const uint32_t most = segment.constraints.config.max_items;
  // Large enough to save most of the work, small enough for clusters of good shape.
  const uint32_t micro = std::max(most / 2, 1u);
  const MicroClusterSizes sizes{micro, kGroup * micro, most};
  const MicroClusterBins bins(segment.constraints);
  bisect({segment, bins, sizes, exact, done}, 0, segment.count, bounds, 0);
}

}  // namespace umbel::cluster
