// Agglomerative clustering (Walter, Bala, Kulkarni & Pingali, "Fast Agglomerative Clustering for
// Rendering", 2008): again and again the two clusters become one whose common box has the least
// area.
//
// A merged cluster is never nearer to a third than its parts were. So two clusters that are each
// other's nearest stay so, whatever else is merged, and all such pairs can be merged at once: the
// tree is that of the one-by-one algorithm, except for ties. Where few pairs are left at a time, as
// in boxes within boxes, chains of nearest neighbours are followed one by one.
#include <span>
#include <vector>

#include "base/exec.hpp"
#include "base/morton.hpp"
#include "bvh/build/builders.hpp"
#include "bvh/build/nearest_tree.hpp"
#include "bvh/tree/merge_tree.hpp"

namespace umbel::bvh {
namespace {

/// Sorts each long run of equal codes by codes within its own bounds. One box very far away gives
/// all others equal codes; a search among boxes in no order visits all of them.
void order_runs(Boxes boxes, std::span<const uint64_t> codes, std::span<uint32_t> primitives) {
  constexpr size_t kLong = 64;
  CpuExec exec;
  for (size_t begin = 0, end = 0; begin < codes.size(); begin = end) {
    while (end < codes.size() && codes[end] == codes[begin]) ++end;
    if (end - begin < kLong || end - begin == codes.size()) continue;
    const std::span<uint32_t> run = primitives.subspan(begin, end - begin);
    BigVector<Aabb> own(run.size());
    for (size_t i = 0; i < run.size(); ++i) own[i] = boxes[run[i]];
    const auto order = morton_order<uint64_t>(exec, own.data(), run.size(), 21);
    const std::vector<uint32_t> before(run.begin(), run.end());
    for (size_t i = 0; i < run.size(); ++i) run[i] = before[order.primitives.data()[i]];
    order_runs(boxes, {order.codes.data(), run.size()}, run);
  }
}

class Agglomeration {
 public:
  Agglomeration(Boxes boxes, Merge* merges, Progress& progress)
      : merges_(merges), progress_(progress), total_(static_cast<uint32_t>(boxes.size())) {
    CpuExec exec;
    const auto order = morton_order<uint64_t>(exec, boxes.data(), total_, 21);
    order_runs(boxes, {order.codes.data(), total_}, {order.primitives.data(), total_});
    tree_.resize(total_);
    clusters_.resize(total_);
    moved_.resize(total_);
    parallel_for(total_, 4096, [&](size_t i) {
      const uint32_t primitive = order.primitives[i];
      tree_.put(static_cast<uint32_t>(i), boxes[primitive]);
      clusters_[i].subtree = Subtree::of_primitive(primitive);
    });
    tree_.update();
  }

  Subtree run() {
    while (left() > kFew && merge_pairs()) {
    }
    follow_chains();
    return root_;
  }

 private:
  static constexpr uint32_t kFew = 64;

  struct Cluster {
    Subtree subtree{};
    uint32_t count = 1;
    NearestTree::Neighbor nearest;  ///< its key is kNone where it has to be searched again
  };

  uint32_t left() const { return total_ - made_; }

  void report() { progress_.report(0.1 + 0.8 * double(made_) / total_, "clustering"); }

  /// Merges all pairs of nearest neighbours. False if there were few.
  bool merge_pairs() {
    report();
    const uint32_t size = tree_.size();
    parallel_for(size, 256, [&](size_t i) {
      const auto slot = static_cast<uint32_t>(i);
      NearestTree::Neighbor& nearest = clusters_[i].nearest;
      if (nearest.key != kNone) return;
      if (nearest.slot != kNone)
        nearest = {tree_.united_area(slot, nearest.slot), NearestTree::key_of(slot, nearest.slot),
                   nearest.slot};
      nearest = tree_.nearest(slot, nearest);
    });
    parallel_for(size, 4096, [&](size_t i) {
      moved_[i] = clusters_[clusters_[i].nearest.slot].nearest.slot == i ? kMerged : 0;
    });
    const uint32_t before = made_;
    uint32_t kept = 0;
    for (uint32_t i = 0; i < size; ++i) {
      const bool merged = moved_[i] == kMerged;
      const uint32_t other = clusters_[i].nearest.slot;
      if (merged && other < i) {
        moved_[i] = moved_[other];
        continue;
      }
      // The left one of a pair keeps its slot for both.
      moved_[i] |= kept;
      if (merged) merge(i, i, other);
      keep(kept++, i);
    }
    parallel_for(kept, 4096, [&](size_t i) { follow(clusters_[i].nearest); });
    tree_.resize(kept);
    tree_.update();
    return made_ - before >= size / 16;
  }

  /// Makes one cluster, in slot `to`, of those in two others.
  void merge(uint32_t to, uint32_t a, uint32_t b) {
    Cluster &left = clusters_[a], &right = clusters_[b];
    Merge& merge = merges_[made_];
    merge = {united(tree_.box(a), tree_.box(b)), left.subtree, right.subtree,
             left.count + right.count};
    tree_.put(to, merge.box);
    root_ = Subtree::of_merge(made_++);
    clusters_[to] = {root_, merge.count, {}};
  }

  /// Moves cluster `from` forward to the slot `to`.
  void keep(uint32_t to, uint32_t from) {
    if (to == from) return;
    tree_.move(to, from);
    clusters_[to] = clusters_[from];
  }

  /// Brings a neighbour up to date with what was moved and merged.
  void follow(NearestTree::Neighbor& nearest) const {
    if (nearest.slot == kNone) return;
    const uint32_t now = moved_[nearest.slot];
    nearest.slot = now & ~kMerged;
    // One that was merged is only where to begin the next search.
    nearest.key = now & kMerged ? kNone : 0;
  }

  void follow_chains() {
    const uint32_t size = tree_.size();
    std::vector<uint32_t> chain;
    for (uint32_t first = 0, steps = 0; left() > 1; ++steps) {
      if (steps % 65536 == 0) report();
      if (chain.empty()) {
        while (first < size && clusters_[first].count == 0) ++first;
        chain.push_back(first);
      }
      const uint32_t slot = chain.back();
      NearestTree::Neighbor known;
      // The one before it in the chain counts first, or equals would be followed for ever.
      if (chain.size() > 1) {
        const uint32_t before = chain[chain.size() - 2];
        known = {tree_.united_area(slot, before), 0, before};
      }
      const uint32_t nearest = tree_.nearest(slot, known).slot;
      if (nearest != known.slot) {
        chain.push_back(nearest);
        continue;
      }
      chain.resize(chain.size() - 2);
      merge(nearest, slot, nearest);
      clusters_[slot].count = 0;
      tree_.clear(slot);
      tree_.update_above(slot);
      tree_.update_above(nearest);
    }
  }

  static constexpr uint32_t kMerged = 0x80000000u;

  Merge* merges_;
  Progress& progress_;
  uint32_t total_, made_ = 0;
  Subtree root_ = Subtree::of_primitive(0);
  NearestTree tree_;
  BigVector<Cluster> clusters_;  ///< of the slots; a count of 0 where there is none any more
  BigVector<uint32_t> moved_;    ///< new slots
};

}  // namespace

Bvh2 build_agglomerative(Boxes boxes, const Config& /*config*/, BuildProgress& progress) {
  BigVector<Merge> merges(boxes.size() - 1);
  const Subtree root = Agglomeration(boxes, merges.data(), progress).run();
  progress.report(0.95, "laying out");
  return emit(merges, root, boxes);
}

}  // namespace umbel::bvh
