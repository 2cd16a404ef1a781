// Approximate agglomerative clustering (Gu, He, Fatahalian & Blelloch, "Efficient BVH Construction
// via Approximate Agglomerative Clustering", 2013): primitives in Morton order are halved down to a
// few; on the way back each half forwards the clusters that are left after the nearest ones have
// been merged, relatively fewer the larger the half.
#include <cmath>
#include <utility>
#include <vector>

#include "base/exec.hpp"
#include "base/morton.hpp"
#include "base/parallel.hpp"
#include "bvh/build/builders.hpp"
#include "bvh/tree/merge_tree.hpp"
#include "bvh/tree/nearest_area.hpp"

namespace umbel::bvh {
namespace {

/// How many clusters a range of primitives forwards: f(x) = delta^(1/2 + e) / 2 * x^(1/2 -
/// e).
class ForwardedCount {
 public:
  explicit ForwardedCount(const AacConfig& config)
      : factor_(std::pow(double(config.leaf_size), 0.5 + double(config.epsilon)) / 2),
        power_(0.5 - double(config.epsilon)) {
    for (uint32_t i = 0; i < kTabled; ++i) table_[i] = compute(i);
  }
  uint32_t operator()(uint32_t primitives) const {
    return primitives < kTabled ? table_[primitives] : compute(primitives);
  }

 private:
  static constexpr uint32_t kTabled = 1024;

  uint32_t compute(uint32_t primitives) const {
    // The little bit more keeps exact values from being rounded down.
    return std::max(1u, static_cast<uint32_t>(factor_ * std::pow(primitives, power_) + 1e-6));
  }

  double factor_, power_;
  uint32_t table_[kTabled];
};

/// Clusters that are not merged yet, each with its nearest neighbour among them.
class ClusterSet {
 public:
  uint32_t size() const { return size_; }
  Subtree subtree(uint32_t i) const { return subtrees_[i]; }

  void add(const Aabb& box, Subtree subtree, uint32_t count) {
    if (size_ == capacity_) grow(size_ + 1);
    columns().put(size_, box);
    subtrees_[size_] = subtree;
    counts_[size_++] = count;
  }

  /// Moves all clusters of `o`, with their neighbours, behind these.
  void append(ClusterSet& o) {
    grow(size_ + o.size_);
    const BoxColumns to = columns(), from = o.columns();
    for (int c = 0; c < 6; ++c) std::copy_n(from.column[c], o.size_, to.column[c] + size_);
    std::copy_n(o.subtrees_.data(), o.size_, &subtrees_[size_]);
    std::copy_n(o.counts_.data(), o.size_, &counts_[size_]);
    std::copy_n(o.distances_.data(), o.size_, &distances_[size_]);
    for (uint32_t i = 0; i < o.size_; ++i) nearest_[size_ + i] = o.nearest_[i] + size_;
    size_ += o.size_;
  }

  /// Gives the clusters [begin, size) their nearest neighbours among each other.
  void find_neighbors(uint32_t begin) {
    for (uint32_t i = begin; i < size_; ++i) find_nearest(i, begin);
  }

  /// The clusters [begin, middle) and those from `middle` on, whose neighbours are known within
  /// either, also look for neighbours in the other.
  void find_neighbors_across(uint32_t begin, uint32_t middle) {
    const BoxColumns boxes = columns();
    for (uint32_t i = begin; i < middle; ++i) {
      const SplatBox box(boxes, i);
      const auto self = static_cast<int32_t>(i);
      LeastOf4 least;
      for (uint32_t j = middle; j < size_; j += 4) {
        const Float4 areas = without(united_areas(box, boxes, j), j, size_, kNone);
        least.add(areas, j);
        const Float4 before = load4(&distances_[j]);
        const Int4 less = areas < before;
        store(&distances_[j], select4(less, areas, before));
        Int4 nearest;
        std::memcpy(&nearest, &nearest_[j], sizeof nearest);
        store(&nearest_[j], select4(less, Int4{self, self, self, self}, nearest));
      }
      const NearestBox best = least.result();
      if (best.area < distances_[i]) {
        distances_[i] = best.area;
        nearest_[i] = best.index;
      }
    }
  }

  /// Merges the nearest two of the clusters from `begin` on until `left` are left.
  template <typename NextMerge>
  void reduce(uint32_t begin, uint32_t left, Merge* merges, const NextMerge& next_merge) {
    while (size_ - begin > left) {
      LeastOf4 least;
      for (uint32_t i = begin; i < size_; i += 4)
        least.add(without(load4(&distances_[i]), i, size_, kNone), i);
      const uint32_t i = least.result().index, j = nearest_[i];
      merge(begin, std::min(i, j), std::max(i, j), merges, next_merge());
    }
  }

 private:
  template <typename T, typename Vector>
  static void store(T* to, Vector v) {
    std::memcpy(to, &v, sizeof v);
  }

  BoxColumns columns() {
    float* f = floats_.data();
    const size_t c = capacity_ + 4;
    return {{f, f + c, f + 2 * c, f + 3 * c, f + 4 * c, f + 5 * c}};
  }

  /// Allocates for `size`, and for reading three more.
  void grow(uint32_t size) {
    if (size <= capacity_) return;
    const uint32_t capacity = std::max(size, 2 * capacity_ + 16);
    std::vector<float> floats(size_t{6} * (capacity + 4));
    for (size_t c = 0; c < 6 && size_ > 0; ++c)
      std::copy_n(floats_.data() + c * (capacity_ + 4), size_, &floats[c * (capacity + 4)]);
    floats_ = std::move(floats);
    distances_.resize(capacity + 4);
    nearest_.resize(capacity + 4);
    subtrees_.resize(capacity);
    counts_.resize(capacity);
    capacity_ = capacity;
  }

  void find_nearest(uint32_t i, uint32_t begin) {
    const NearestBox best = nearest_box(columns(), i, begin, size_);
    distances_[i] = best.area;
    nearest_[i] = best.index;
  }

  void merge(uint32_t begin, uint32_t a, uint32_t b, Merge* merges, uint32_t merge) {
    const BoxColumns boxes = columns();
    merges[merge] = {united(boxes.get(a), boxes.get(b)), subtrees_[a], subtrees_[b],
                     counts_[a] + counts_[b]};
    boxes.put(a, merges[merge].box);
    subtrees_[a] = Subtree::of_merge(merge);
    counts_[a] = merges[merge].count;
    const uint32_t last = --size_;
    boxes.copy(b, last);
    subtrees_[b] = subtrees_[last];
    counts_[b] = counts_[last];
    distances_[b] = distances_[last];
    nearest_[b] = nearest_[last];
    distances_[a] = std::numeric_limits<float>::infinity();
    if (size_ - begin < 2) return;
    // The merged cluster is no nearer to any other than its parts were: the rest need no search.
    for (uint32_t i = begin; i < size_; ++i) {
      if (i == a || nearest_[i] == a || nearest_[i] == b)
        find_nearest(i, begin);
      else if (nearest_[i] == last)
        nearest_[i] = b;
    }
  }

  uint32_t size_ = 0, capacity_ = 0;
  std::vector<float> floats_, distances_;
  std::vector<uint32_t> nearest_;
  std::vector<Subtree> subtrees_;
  std::vector<uint32_t> counts_;
};

/// The clusters of a range of primitives, and the merges that are free: as many as clusters.
struct Forwarded {
  ClusterSet clusters;
  std::vector<uint32_t> free;
};

class Aac {
 public:
  Aac(Boxes boxes, const MortonOrder<CpuExec, uint64_t>& order, const AacConfig& config,
      Merge* merges)
      : boxes_(boxes),
        order_(order),
        leaf_size_(config.leaf_size),
        forwarded_count_(config),
        merges_(merges) {}

  /// Large ranges, by tasks.
  Forwarded solve(uint32_t begin, uint32_t end) const {
    Forwarded forwarded;
    if (end - begin <= kTask) {
      uint32_t next = begin;
      solve_range(begin, end, forwarded.clusters, next);
      for (; next < end; ++next) forwarded.free.push_back(next);
      return forwarded;
    }
    const uint32_t middle = split(begin, end);
    Forwarded right;
    parallel_invoke([&] { forwarded = solve(begin, middle); }, [&] { right = solve(middle, end); });
    const uint32_t left_size = forwarded.clusters.size();
    forwarded.clusters.append(right.clusters);
    forwarded.clusters.find_neighbors_across(0, left_size);
    forwarded.free.insert(forwarded.free.end(), right.free.begin(), right.free.end());
    forwarded.clusters.reduce(0, left_of(begin, end), merges_, [&] {
      const uint32_t merge = forwarded.free.back();
      forwarded.free.pop_back();
      return merge;
    });
    return forwarded;
  }

 private:
  static constexpr uint32_t kTask = 8192;

  uint32_t left_of(uint32_t begin, uint32_t end) const {
    return end - begin == boxes_.size() ? 1 : forwarded_count_(end - begin);
  }

  /// Where the highest bit that differs becomes one; the middle where none does.
  uint32_t split(uint32_t begin, uint32_t end) const {
    const uint64_t* codes = order_.codes.data();
    const uint64_t difference = codes[begin] ^ codes[end - 1];
    if (difference == 0) return begin + (end - begin) / 2;
    const uint64_t bit = uint64_t{1} << (63 - std::countl_zero(difference));
    uint32_t low = begin, high = end - 1;
    while (high - low > 1) {
      const uint32_t middle = low + (high - low) / 2;
      (codes[middle] & bit ? high : low) = middle;
    }
    return high;
  }

  /// Small ranges, on top of the clusters that are there. Takes merges from `next` on.
  void solve_range(uint32_t begin, uint32_t end, ClusterSet& clusters, uint32_t& next) const {
    const uint32_t bottom = clusters.size();
    const auto next_merge = [&] { return next++; };
    if (end - begin < leaf_size_) {
      for (uint32_t i = begin; i < end; ++i) {
        const uint32_t primitive = order_.primitives[i];
        clusters.add(boxes_[primitive], Subtree::of_primitive(primitive), 1);
      }
      clusters.find_neighbors(bottom);
      const uint32_t left = end - begin == boxes_.size() ? 1 : forwarded_count_(leaf_size_);
      clusters.reduce(bottom, left, merges_, next_merge);
      return;
    }
    const uint32_t middle = split(begin, end);
    solve_range(begin, middle, clusters, next);
    const uint32_t right = clusters.size();
    solve_range(middle, end, clusters, next);
    clusters.find_neighbors_across(bottom, right);
    clusters.reduce(bottom, left_of(begin, end), merges_, next_merge);
  }

  Boxes boxes_;
  const MortonOrder<CpuExec, uint64_t>& order_;
  uint32_t leaf_size_;
  ForwardedCount forwarded_count_;
  Merge* merges_;
};

}  // namespace

Bvh2 build_aac(Boxes boxes, const Config& config, BuildProgress& progress) {
  CpuExec exec;
  const auto count = static_cast<uint32_t>(boxes.size());
  const auto order = morton_order<uint64_t>(exec, boxes.data(), count, 21);
  progress.report(0.1, "clustering");
  // One more than there are merges: the last range leaves one free.
  BigVector<Merge> merges(count);
  const Forwarded root = Aac(boxes, order, config.aac, merges.data()).solve(0, count);
  progress.report(0.8, "laying out");
  return emit(merges, root.clusters.subtree(0), boxes);
}

}  // namespace umbel::bvh
