#include <array>

#include "kdtree/box_set.hpp"
#include "kdtree/builders.hpp"

namespace umbel::kdtree {
namespace {

constexpr uint32_t kMaxBins = 256;
constexpr uint32_t kParallel = 1u << 14;

/// How many boxes begin and end in each bin of each axis.
struct Counts {
  std::array<std::array<uint32_t, kMaxBins>, 3> begins{}, ends{};
};

/// From a coordinate to a bin, and back to the plane where a bin begins.
class BinScale {
 public:
  BinScale(const Aabb& cell, uint32_t axis, uint32_t bins)
      : low_(component(cell.min, axis)),
        width_((double(component(cell.max, axis)) - double(low_)) / bins),
        inverse_(width_ > 0 ? 1 / width_ : 0),
        last_(bins - 1) {}
  uint32_t bin(float at) const {
    return std::min(static_cast<uint32_t>((double(at) - double(low_)) * inverse_), last_);
  }
  float plane(uint32_t bin) const { return static_cast<float>(double(low_) + width_ * bin); }

 private:
  float low_;
  double width_, inverse_;
  uint32_t last_;
};

void add_counts(Counts& sum, const Counts& part, uint32_t bins) {
  for (uint32_t axis = 0; axis < 3; ++axis)
    for (uint32_t bin = 0; bin < bins; ++bin) {
      sum.begins[axis][bin] += part.begins[axis][bin];
      sum.ends[axis][bin] += part.ends[axis][bin];
    }
}

Counts count_boxes(std::span<const BoxSet::Item> items, const std::array<BinScale, 3>& scales,
                   uint32_t bins) {
  const auto count = [&](size_t begin, size_t end, Counts& counts) {
    for (size_t i = begin; i < end; ++i)
      for (uint32_t axis = 0; axis < 3; ++axis) {
        ++counts.begins[axis][scales[axis].bin(component(items[i].box.min, axis))];
        ++counts.ends[axis][scales[axis].bin(component(items[i].box.max, axis))];
      }
  };
  Counts counts;
  if (items.size() < 2 * kParallel) {
    count(0, items.size(), counts);
    return counts;
  }
  std::vector<Counts> parts((items.size() + kParallel - 1) / kParallel);
  parallel_chunks(items.size(), kParallel,
                  [&](size_t begin, size_t end) { count(begin, end, parts[begin / kParallel]); });
  for (const Counts& part : parts) add_counts(counts, part, bins);
  return counts;
}

}  // namespace

std::vector<uint32_t> BoxSet::triangles() const {
  std::vector<uint32_t> numbers;
  numbers.reserve(items_.size());
  for (const Item& item : items_) numbers.push_back(item.triangle);
  return numbers;
}

Split BoxSet::best_split(const Aabb& cell) const {
  const std::array<BinScale, 3> scales{BinScale(cell, 0, bins_), BinScale(cell, 1, bins_),
                                       BinScale(cell, 2, bins_)};
  const Counts counts = count_boxes(items_, scales, bins_);
  Split best;
  for (uint32_t axis = 0; axis < 3; ++axis) {
    const PlaneCost cost(*rule_, cell, axis);
    uint32_t below = 0, above = size();
    for (uint32_t bin = 1; bin < bins_; ++bin) {
      below += counts.begins[axis][bin - 1];
      above -= counts.ends[axis][bin - 1];
      const float plane = scales[axis].plane(bin);
      // Bins may be thinner than floats can tell.
      if (plane > cost.low() && plane < cost.high()) cost.consider(plane, below, 0, above, best);
    }
  }
  return best;
}

bool BoxSet::split(const Aabb& cell, const Split& split, uint64_t spare, BoxSet& below,
                   BoxSet& above) const {
  std::vector<Item> first, second;
  std::vector<uint32_t> both;
  for (uint32_t i = 0; i < items_.size(); ++i) {
    const Item& item = items_[i];
    if (component(item.box.max, split.axis) <= split.at)
      first.push_back(item);
    else if (component(item.box.min, split.axis) >= split.at)
      second.push_back(item);
    else
      both.push_back(i);
  }
  if (both.size() > spare) return false;
  std::vector<Halves> halves(both.size());
  parallel_for(both.size(), 512, [&](size_t i) {
    halves[i] = primitives_->halves(items_[both[i]].triangle, cell, split);
  });
  for (size_t i = 0; i < both.size(); ++i) {
    const uint32_t triangle = items_[both[i]].triangle;
    if (!is_empty(halves[i].below)) first.push_back({halves[i].below, triangle});
    if (!is_empty(halves[i].above)) second.push_back({halves[i].above, triangle});
  }
  below = BoxSet(*primitives_, *rule_, bins_, std::move(first));
  above = BoxSet(*primitives_, *rule_, bins_, std::move(second));
  return true;
}

double BoxSet::grow_small(const CostRule& rule, const Aabb& cell, const Allowance& left,
                          Subtree& out) const {
  SmallSet small(*primitives_);
  for (const Item& item : items_) small.push(item.triangle, item.box);
  return small.grow(rule, cell, left, out);
}

void build_binned(const Input& input, const Config& config, Progress& progress, Branch& root) {
  std::vector<BoxSet::Item> items(input.boxes.size());
  for (size_t i = 0; i < items.size(); ++i) items[i] = {input.boxes[i], input.triangles[i]};
  Grower<BoxSet>(input.rule, progress)
      .build(BoxSet(input.primitives, input.rule, config.bins, std::move(items)), input.bounds,
             input.allowance, root);
}

}  // namespace umbel::kdtree
