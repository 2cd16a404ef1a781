// Binned SAH (Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007): every
// node is split at the cheapest plane of a regular grid over its centroids, on three axes.
#include <algorithm>
#include <array>
#include <numeric>

#include "base/parallel.hpp"
#include "bvh/box4.hpp"
#include "bvh/builders.hpp"
#include "bvh/config.hpp"

namespace umbel::bvh {
namespace {

constexpr uint32_t kParallel = 1 << 12;
constexpr uint32_t kMaxBins = 256;

struct Bin {
  Box4 box = Box4::empty();
  uint32_t count = 0;
};

class Binned {
 public:
  Binned(Boxes boxes, const Config& config) : boxes_(boxes), config_(config) {
    tree_.nodes.resize(2 * boxes.size() - 1);
    tree_.primitives.resize(boxes.size());
    std::iota(tree_.primitives.begin(), tree_.primitives.end(), 0u);
  }

  Bvh2 build() {
    split(0, static_cast<uint32_t>(boxes_.size()), 0, 1, 0);
    return std::move(tree_);
  }

 private:
  Box4 split(uint32_t begin, uint32_t end, uint32_t index, uint32_t free, uint32_t depth) {
    const uint32_t n = end - begin;
    if (n == 1) {
      const Box4 box = Box4::from(boxes_[tree_.primitives[begin]]);
      tree_.nodes[index] = box.node(begin, 1);
      return box;
    }
    uint32_t middle = cut(begin, end);
    const uint32_t larger = std::max(middle - begin, end - middle);
    if (!fits_depth(larger, config_.max_depth - depth - 1)) {
      middle = begin + n / 2;
      std::sort(tree_.primitives.begin() + begin, tree_.primitives.begin() + end);
    }
    Box4 left, right;
    const auto go_left = [&] { left = split(begin, middle, free, free + 2, depth + 1); };
    const auto go_right = [&] {
      right = split(middle, end, free + 1, free + 2 * (middle - begin), depth + 1);
    };
    if (n < kParallel) {
      go_left();
      go_right();
    } else {
      tbb::parallel_invoke(go_left, go_right);
    }
    left.extend(right);
    tree_.nodes[index] = left.node(free, 0);
    return left;
  }

  uint32_t cut(uint32_t begin, uint32_t end) {
    Box4 box = Box4::empty(), centers = Box4::empty();
    for (uint32_t i = begin; i < end; ++i) {
      const Box4 b = Box4::from(boxes_[tree_.primitives[i]]);
      const Float4 c = b.center2();
      box.extend(b);
      centers.extend({c, -c});
    }
    const uint32_t bins = config_.bins;
    const Float4 pad = box.pad(), range = centers.extents();
    float best = box.half_area(pad) * float(end - begin) * 0.99999f;
    int best_axis = -1;
    uint32_t best_bin = 0;
    const auto bin_of = [&](uint32_t primitive, int axis) {
      const float at = (Box4::from(boxes_[primitive]).center2()[axis] - centers.low[axis]) *
                       (float(bins) / range[axis]);
      return std::min(static_cast<uint32_t>(at), bins - 1);
    };
    for (int axis = 0; axis < 3; ++axis) {
      if (!(range[axis] > 1e-20f)) continue;
      std::array<Bin, kMaxBins> bin;
      for (uint32_t i = begin; i < end; ++i) {
        Bin& b = bin[bin_of(tree_.primitives[i], axis)];
        b.box.extend(Box4::from(boxes_[tree_.primitives[i]]));
        ++b.count;
      }
      std::array<float, kMaxBins> right;
      Box4 side = Box4::empty();
      for (uint32_t b = bins - 1; b > 0; --b) {
        side.extend(bin[b].box);
        right[b] = side.half_area(pad);
      }
      side = Box4::empty();
      uint32_t count = 0;
      for (uint32_t b = 1; b < bins; ++b) {
        side.extend(bin[b - 1].box);
        count += bin[b - 1].count;
        if (count == 0 || count == end - begin) continue;
        const float cost =
            side.half_area(pad) * float(count) + right[b] * float(end - begin - count);
        if (cost < best) {
          best = cost;
          best_axis = axis;
          best_bin = b;
        }
      }
    }
    if (best_axis < 0) return begin + (end - begin) / 2;
    const auto first = tree_.primitives.begin();
    const auto middle = std::partition(first + begin, first + end, [&](uint32_t primitive) {
      return bin_of(primitive, best_axis) < best_bin;
    });
    return static_cast<uint32_t>(middle - first);
  }

  Boxes boxes_;
  const Config& config_;
  Bvh2 tree_;
};

}  // namespace

Bvh2 build_binned(Boxes boxes, const Config& config, Progress& progress) {
  progress.report(0.1, "binning");
  return Binned(boxes, config).build();
}

}  // namespace umbel::bvh
