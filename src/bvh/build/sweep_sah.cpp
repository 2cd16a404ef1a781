// Full-sweep SAH: every node is split where the surface area heuristic (Goldsmith & Salmon,
// "Automatic creation of object hierarchies for ray tracing", 1987; MacDonald & Booth 1990) is
// least among all positions in the order of centroids on each axis.
//
// The primitives are sorted once an axis; partitions keep the orders, as in Wald & Havran, "On
// building fast kd-trees for ray tracing, and on doing that in O(N log N)", 2006.
#include <algorithm>
#include <array>
#include <limits>

#include "base/parallel.hpp"
#include "base/polled_stage.hpp"
#include "base/radix_sort.hpp"
#include "base/simd/box4.hpp"
#include "bvh/build/builders.hpp"
#include "bvh/tree/box_node.hpp"
#include "bvh/tree/config.hpp"

namespace umbel::bvh {
namespace {

constexpr uint32_t kParallel = 1 << 12;  ///< primitives from which on children run in parallel

struct Split {
  float cost = std::numeric_limits<float>::infinity();
  uint32_t position = 0;
  int axis = 0;
};

struct OneEach {
  uint32_t operator()(uint32_t /*primitive*/) const { return 1; }
};

struct CountsEach {
  const uint32_t* counts;
  uint32_t operator()(uint32_t primitive) const { return counts[primitive]; }
};

/// Count: how many primitives each of the boxes stands for.
template <typename Count>
class Sweep {
 public:
  Sweep(Boxes boxes, const Count& count, const Config& config)
      : boxes_(boxes), count_(count), config_(config) {
    const size_t n = boxes.size();
    tree_.nodes.resize(2 * n - 1);
    tree_.primitives.resize(n);
    right_areas_.resize(n);
    is_left_.resize(n);
    spare_.resize(n);
    parallel_for(3, 1, [&](size_t axis) { sort(int(axis)); });
  }

  Bvh2 build() {
    split(0, static_cast<uint32_t>(boxes_.size()), 0, 1, 0);
    return std::move(tree_);
  }

 private:
  void sort(int axis) {
    const size_t n = boxes_.size();
    std::vector<uint64_t> words(n), spare(n);
    for (size_t i = 0; i < n; ++i)
      words[i] = uint64_t(float_to_key(Box4::from(boxes_[i]).center2()[axis])) << 32 | i;
    const uint64_t* sorted = radix_sort(words.data(), spare.data(), n, 32, 64);
    orders_[axis].resize(n);
    for (size_t i = 0; i < n; ++i) orders_[axis][i] = static_cast<uint32_t>(sorted[i]);
  }

  /// Makes node `index` of the primitives at [begin, end). Its descendants are the nodes from
  /// `free` on.
  Box4 split(uint32_t begin, uint32_t end, uint32_t index, uint32_t free, uint32_t depth) {
    const uint32_t n = end - begin;
    if (n == 1) {
      const uint32_t primitive = orders_[0][begin];
      const Box4 box = Box4::from(boxes_[primitive]);
      tree_.primitives[begin] = primitive;
      tree_.nodes[index] = node_of(box, begin, 1);
      return box;
    }
    Split best = cheapest(begin, end);
    const uint32_t larger = std::max(best.position, n - best.position);
    if (!fits_depth(larger, config_.max_depth - depth - 1)) best.position = n / 2;
    partition(begin, end, best);
    const uint32_t middle = begin + best.position;
    Box4 left, right;
    const auto go_left = [&] { left = split(begin, middle, free, free + 2, depth + 1); };
    const auto go_right = [&] {
      right = split(middle, end, free + 1, free + 2 * best.position, depth + 1);
    };
    if (n < kParallel) {
      go_left();
      go_right();
    } else {
      parallel_invoke(go_left, go_right);
    }
    left.extend(right);
    tree_.nodes[index] = node_of(left, free, 0);
    return left;
  }

  Split cheapest(uint32_t begin, uint32_t end) {
    const uint32_t n = end - begin;
    Box4 whole = Box4::empty();
    uint32_t all = 0;
    for (uint32_t i = begin; i < end; ++i) {
      whole.extend(Box4::from(boxes_[orders_[0][i]]));
      all += count_(orders_[0][i]);
    }
    const Float4 pad = whole.pad();
    Split best;
    for (int axis = 0; axis < 3; ++axis) sweep(begin, n, all, axis, pad, best);
    // Where nothing is gained, all positions cost the same, up to rounding.
    if (!(best.cost < whole.half_area(pad) * float(all) * 0.99999f)) best.position = n / 2;
    return best;
  }

  void sweep(uint32_t begin, uint32_t n, uint32_t all, int axis, Float4 pad, Split& best) {
    const uint32_t* order = orders_[axis].data() + begin;
    float* right_areas = right_areas_.data() + begin;
    Box4 box = Box4::empty();
    for (uint32_t i = n - 1; i > 0; --i) {
      box.extend(Box4::from(boxes_[order[i]]));
      right_areas[i] = box.half_area(pad);
    }
    box = Box4::empty();
    uint32_t left = 0;
    for (uint32_t i = 1; i < n; ++i) {
      box.extend(Box4::from(boxes_[order[i - 1]]));
      left += count_(order[i - 1]);
      const float cost = box.half_area(pad) * float(left) + right_areas[i] * float(all - left);
      if (cost < best.cost) best = {cost, i, axis};
    }
  }

  void partition(uint32_t begin, uint32_t end, const Split& split) {
    const uint32_t middle = begin + split.position;
    const uint32_t* order = orders_[split.axis].data();
    for (uint32_t i = begin; i < end; ++i) is_left_[order[i]] = i < middle;
    for (int axis = 0; axis < 3; ++axis) {
      if (axis == split.axis) continue;
      uint32_t* out = orders_[axis].data() + begin;
      uint32_t* spare = spare_.data() + begin;
      uint32_t left = 0, right = 0;
      for (uint32_t i = 0; i < end - begin; ++i) {
        const uint32_t primitive = out[i];
        const uint32_t goes_left = is_left_[primitive];
        out[left] = primitive;
        spare[right] = primitive;
        left += goes_left;
        right += 1 - goes_left;
      }
      std::copy_n(spare, right, out + left);
    }
  }

  Boxes boxes_;
  Count count_;
  const Config& config_;
  Bvh2 tree_;
  std::array<std::vector<uint32_t>, 3> orders_;
  std::vector<float> right_areas_;
  std::vector<uint8_t> is_left_;
  std::vector<uint32_t> spare_;
};

}  // namespace

Bvh2 build_sweep(Boxes boxes, const Config& config, BuildProgress& progress) {
  progress.report(0.1, "sorting centroids");
  Sweep sweep(boxes, OneEach{}, config);
  const PolledStage stage(progress, 0.2, "sweeping");
  return sweep.build();
}

Bvh2 sweep_clusters(Boxes boxes, std::span<const uint32_t> counts, const Config& config) {
  return Sweep(boxes, CountsEach{counts.data()}, config).build();
}

}  // namespace umbel::bvh
