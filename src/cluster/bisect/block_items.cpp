#include "cluster/bisect/block_items.hpp"

#include <bit>
#include <cstring>
#include <limits>
#include <utility>

#include "base/radix_sort.hpp"
#include "cluster/bisect/scaling.hpp"

namespace umbel::cluster {
namespace {

float block_scale(const Box4& bounds) { return scale_for(bounds, 0x1p30f, 60); }

}  // namespace

Box4* BlockItems::prepare(uint32_t count) {
  count_ = count;
  if (boxes_.size() < count) {
    boxes_.resize(count);
    spare_.resize(count);
    right_.resize(count);
    for (int axis = 0; axis < 3; ++axis) {
      orders_[axis].resize(count);
      centers_[axis].resize(count + 3);  // four are read at a time
    }
  }
  return boxes_.data();
}

// Of the source, or twice the boxes' centres: only their order matters.
void BlockItems::find_centers(const Source& source) {
  Box4 all = Box4::empty();
  for (uint32_t i = 0; i < count_; ++i) all.extend(boxes_[i]);
  if (const float scale = block_scale(all); scale != 1.0f)
    for (uint32_t i = 0; i < count_; ++i) boxes_[i].scale(scale);
  const Int4 mask{-1, -1, -1, 0};  // without the tag, which as a float is slow to compute with
  lowest_ = splat(std::numeric_limits<float>::max());
  highest_ = -lowest_;
  for (uint32_t i = 0; i < count_; ++i) {
    const Box4& box = boxes_[i];
    Float4 c = std::bit_cast<Float4>(std::bit_cast<Int4>(box.low) & mask) - box.negated_high;
    if (!source.centroids.empty()) {
      const Vec3& given = source.centroids[box.tag()];
      c = Float4{given.x, given.y, given.z, 0};
    }
    lowest_ = min4(lowest_, c);
    highest_ = max4(highest_, c);
    for (int axis = 0; axis < 3; ++axis) centers_[axis][i] = c[axis];
  }
}

void BlockItems::gather(std::span<const uint32_t> firsts, float share) {
  const auto center = [&](uint32_t i) {
    return Float4{centers_[0][i], centers_[1][i], centers_[2][i], 0};
  };
  components_.assign(count_, Box4::empty());
  for (uint32_t i = 0; i < count_; ++i) components_[firsts[i]].extend({center(i), -center(i)});
  const Float4 half = splat(0.5f);
  for (uint32_t i = 0; i < count_; ++i) {
    const Box4& bounds = components_[firsts[i]];
    const Float4 middle = bounds.low * half - bounds.negated_high * half;
    const Float4 moved = center(i) * splat(1.0f - share) + middle * splat(share);
    const Float4 within = min4(max4(moved, bounds.low), -bounds.negated_high);
    for (int axis = 0; axis < 3; ++axis) centers_[axis][i] = within[axis];
  }
}

void BlockItems::sort() {
  for (int axis = 0; axis < 3; ++axis) sort_axis(axis);
}

// By centres rounded to as many bits as a word has beside the index: two cheap passes over words
// that stay in the nearest cache. What those bits cannot tell apart, settle_ties does.
void BlockItems::sort_axis(int axis) {
  if (count_ < 128 || count_ > 0x10000) return sort_exactly(axis);
  constexpr uint32_t kDigit = 10;
  const uint32_t count = count_, index_bits = std::max<uint32_t>(std::bit_width(count - 1), 12);
  const float* centers = centers_[axis].data();
  const float low = lowest_[axis] * 0.5f, range = highest_[axis] * 0.5f - low;
  const float last = static_cast<float>((1 << (32 - index_bits)) - 1);
  const float step = range > 0x1p-100f ? last / range : 0.0f;
  if (words_.size() < 2 * size_t(count) + 4) words_.resize(2 * size_t(count) + 4);
  uint32_t *spare = words_.data(), *words = spare + count;  // with room behind the last
  Int4 index{0, 1, 2, 3};
  for (uint32_t i = 0; i < count; i += 4, index += 4) {
    Float4 center;
    memcpy(&center, centers + i, sizeof center);
    const Float4 key = min4((center * splat(0.5f) - splat(low)) * splat(step), splat(last));
    const Int4 word = __builtin_convertvector(key, Int4) << int(index_bits) | index;
    memcpy(words + i, &word, sizeof word);
  }
  std::array<uint32_t, 1 << kDigit> offsets[2] = {};
  for (uint32_t i = 0; i < count; ++i) {
    const uint32_t key = words[i] >> index_bits;
    ++offsets[0][key & ((1u << kDigit) - 1)];
    ++offsets[1][key >> kDigit];
  }
  for (auto& of_digit : offsets) {
    uint32_t sum = 0;
    for (uint32_t& offset : of_digit) sum += std::exchange(offset, sum);
  }
  for (uint32_t i = 0; i < count; ++i)
    spare[offsets[0][words[i] >> index_bits & ((1u << kDigit) - 1)]++] = words[i];
  uint32_t* order = orders_[axis].data();
  const uint32_t index_mask = (1u << index_bits) - 1;
  for (uint32_t i = 0; i < count; ++i)
    order[offsets[1][spare[i] >> (index_bits + kDigit)]++] = spare[i] & index_mask;
  settle_ties(axis);
}

// Equal keys are in order of their indices already, and most of them stand for equal centres.
void BlockItems::settle_ties(int axis) {
  const float* centers = centers_[axis].data();
  uint32_t* order = orders_[axis].data();
  const uint32_t count = count_;
  uint32_t steps = 0;
  float previous = centers[order[0]];
  for (uint32_t i = 1; i < count; ++i) {
    const uint32_t item = order[i];
    const float own = centers[item];
    if (!(previous > own)) {
      previous = own;
      continue;
    }
    uint32_t at = i;
    for (; at > 0 && centers[order[at - 1]] > own; --at) order[at] = order[at - 1];
    order[at] = item;
    steps += i - at;
    if (steps > count) return sort_exactly(axis);
  }
}

void BlockItems::sort_exactly(int axis) {
  if (long_words_.size() < count_) {
    long_words_.resize(count_);
    spare_long_words_.resize(count_);
  }
  uint64_t* words = long_words_.data();
  for (uint32_t i = 0; i < count_; ++i)
    words[i] = uint64_t(float_to_key(centers_[axis][i])) << 32 | i;
  if (count_ < 128)
    std::sort(words, words + count_);
  else
    words = radix_sort(words, spare_long_words_.data(), count_, 32, 64);
  for (uint32_t i = 0; i < count_; ++i) orders_[axis][i] = static_cast<uint32_t>(words[i]);
}

Box4 BlockItems::bounds(uint32_t begin, uint32_t end) const {
  Box4 all = Box4::empty();
  for (uint32_t i = begin; i < end; ++i) all.extend(boxes_[orders_[0][i]]);
  return all;
}

Float4 BlockItems::normalise(uint32_t begin, uint32_t end, const Box4& bounds) {
  Box4 scaled = bounds;
  if (const float extent = bounds.longest(); extent > 0.0f && extent < 0x1p-40f) {
    const float scale = block_scale(bounds);
    scaled.scale(scale);
    for (uint32_t i = begin; i < end; ++i) boxes_[orders_[0][i]].scale(scale);
  }
  return pad_for(scaled);
}

void BlockItems::partition(uint32_t begin, uint32_t end, const AxisSplit& split) {
  const uint32_t n = end - begin;
  uint8_t* right = right_.data();
  uint32_t* spare = spare_.data();
  const uint32_t* sorted = orders_[split.axis].data() + begin;
  for (uint32_t i = 0; i < split.position; ++i) right[sorted[i]] = 0;
  for (uint32_t i = split.position; i < n; ++i) right[sorted[i]] = 1;
  for (int axis = 0; axis < 3; ++axis) {
    if (axis == split.axis) continue;
    uint32_t* order = orders_[axis].data() + begin;
    uint32_t l = 0, r = 0;
    for (uint32_t i = 0; i < n; ++i) {
      const uint32_t item = order[i];
      const uint32_t side = right[item];
      order[l] = item;
      spare[r] = item;
      l += 1 - side;
      r += side;
    }
    std::copy_n(spare, r, order + l);
  }
}

}  // namespace umbel::cluster
