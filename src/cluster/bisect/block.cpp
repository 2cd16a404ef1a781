#include "cluster/bisect/block.hpp"

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "base/parallel.hpp"
#include "base/radix_sort.hpp"

namespace umbel::cluster {
namespace {

// Boxes are scaled only where areas would leave the range of floats, and then by a power of two,
// which changes no comparison.
float scale_for(const BoxRecord& bounds) {
  float extent = 0, magnitude = 0;
  for (int k = 0; k < 3; ++k) {
    extent = std::max(extent, bounds.negated_high[k] * -0.5f - bounds.low[k] * 0.5f);
    magnitude = std::max({magnitude, std::abs(bounds.low[k]), std::abs(bounds.negated_high[k])});
  }
  if (extent == 0.0f || (extent > 0x1p-30f && extent < 0x1p30f && magnitude < 0x1p60f)) return 1.0f;
  const int most = 60 - std::ilogb(magnitude);
  return std::ldexp(1.0f, std::clamp(std::min(-std::ilogb(extent), most), -126, 127));
}

Float4 pad_for(const BoxRecord& bounds) {
  const float extent = bounds.longest();
  return splat(extent > 0.0f ? std::ldexp(1.0f, std::max(std::ilogb(extent) - 20, -60)) : 1.0f);
}

}  // namespace

void Block::bisect(const Source& source, const SplitConstraints& constraints, uint32_t* items,
                   uint8_t* first, uint32_t count) {
  if (count == 0) return;
  BoxRecord* boxes = prepare(source, constraints, count);
  for (uint32_t i = 0; i < count; ++i) {
    boxes[i] = source.record(items[i]).tagged(items[i]);
  }
  bisect_prepared(items, first);
}

void Block::bisect_in_parallel(const Source& source, const SplitConstraints& constraints,
                               uint32_t* items, uint8_t* first, uint32_t count) {
  // A copy is of the whole block, so there should be few.
  constexpr uint32_t kLeast = 512, kPart = 3;
  fork_from_ = std::max(kLeast, count / kPart);
  bisect(source, constraints, items, first, count);
  fork_from_ = kNone;
}

BoxRecord* Block::prepare(const Source& source, const SplitConstraints& constraints,
                          uint32_t count) {
  source_ = &source;
  constraints_ = constraints;
  most_items_ = constraints.config.max_items;
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

void Block::bisect_prepared(uint32_t* items, uint8_t* first) {
  items_ = items;
  first_ = first;
  if (count_ == 0) return;
  for (uint32_t i = 0; i < count_; ++i) items_[i] = boxes_[i].tag();
  connection_cost_.load(*source_, items_, count_);
  shared_.load(*source_, items_, count_);
  BoxRecord all = BoxRecord::empty();
  for (uint32_t i = 0; i < count_; ++i) all.extend(boxes_[i]);
  if (const float more = scale_for(all); more != 1.0f) {
    for (uint32_t i = 0; i < count_; ++i) boxes_[i].scale(more);
    all.scale(more);
  }
  if (constraints_.config.max_vertices) expect_vertices();
  find_centers();
  for (int axis = 0; axis < 3; ++axis) sort_axis(axis);
  split(0, count_, 2 * std::bit_width(count_) + 8);
}

// Given centroids, or twice the boxes' centres: only their order matters.
void Block::find_centers() {
  const Int4 mask{-1, -1, -1, 0};  // without the tag, which as a float is slow to compute with
  lowest_ = splat(std::numeric_limits<float>::max());
  highest_ = -lowest_;
  for (uint32_t i = 0; i < count_; ++i) {
    const BoxRecord& box = boxes_[i];
    Float4 c = std::bit_cast<Float4>(std::bit_cast<Int4>(box.low) & mask) - box.negated_high;
    if (!source_->centroids.empty()) {
      const Vec3& given = source_->centroids[box.tag()];
      c = Float4{given.x, given.y, given.z, 0};
    }
    lowest_ = min4(lowest_, c);
    highest_ = max4(highest_, c);
    for (int axis = 0; axis < 3; ++axis) centers_[axis][i] = c[axis];
  }
}

// By centres rounded to as many bits as a word has beside the index: two cheap passes over words
// that stay in the nearest cache. What those bits cannot tell apart, settle_ties does.
void Block::sort_axis(int axis) {
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
    const Float4 place = min4((center * splat(0.5f) - splat(low)) * splat(step), splat(last));
    const Int4 word = __builtin_convertvector(place, Int4) << int(index_bits) | index;
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
void Block::settle_ties(int axis) {
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

void Block::sort_exactly(int axis) {
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

void Block::split(uint32_t begin, uint32_t end, uint32_t depth) {
  if (is_leaf(begin, end, 0)) return make_leaf(begin, end, 0);
  split_node(begin, end, depth);
}

void Block::split_node(uint32_t begin, uint32_t end, uint32_t depth) {
  const ClusterConfig& config = constraints_.config;
  const uint32_t presplit = config.presplit_threshold;
  Split best{};
  if (depth > 0 && !(presplit && end - begin > presplit)) best = cheapest(begin, end);
  if (!best.position) best = median(begin, end);
  const uint32_t middle = begin + best.position;
  const bool left_leaf = is_leaf(begin, middle, best.axis);
  const bool right_leaf = is_leaf(middle, end, best.axis);
  // Leaves need no other order than the one at hand.
  if (!left_leaf || !right_leaf) partition(begin, end, best);
  const uint32_t left = depth > 0 ? depth - 1 : 0;
  if (end - begin >= fork_from_ && !left_leaf && !right_leaf)
    return split_halves(begin, middle, end, left);
  left_leaf ? make_leaf(begin, middle, best.axis) : split_node(begin, middle, left);
  right_leaf ? make_leaf(middle, end, best.axis) : split_node(middle, end, left);
}

// They share no items, and what is kept of items a copy has as well.
void Block::split_halves(uint32_t begin, uint32_t middle, uint32_t end, uint32_t depth) {
  Block other(*this);
  tbb::parallel_invoke([&] { split_node(begin, middle, depth); },
                       [&] { other.split_node(middle, end, depth); });
}

bool Block::is_leaf(uint32_t begin, uint32_t end, int axis) {
  const ClusterConfig& config = constraints_.config;
  const uint32_t n = end - begin;
  if (n > most_items_) return false;
  return n == 1 || !config.max_vertices || uint64_t(n) * source_->arity <= config.max_vertices ||
         count_vertices(begin, end, axis) <= config.max_vertices;
}

void Block::make_leaf(uint32_t begin, uint32_t end, int axis) {
  for (uint32_t i = begin; i < end; ++i) {
    items_[i] = boxes_[orders_[axis][i]].tag();
    first_[i] = i == begin;
  }
}

BoxRecord Block::bounds(uint32_t begin, uint32_t end) const {
  BoxRecord all = BoxRecord::empty();
  for (uint32_t i = begin; i < end; ++i) all.extend(boxes_[orders_[0][i]]);
  return all;
}

// Sets the padding that suits a node, and scales its boxes up where splitting off something far
// away has left only tiny ones.
void Block::normalise(uint32_t begin, uint32_t end, const BoxRecord& bounds) {
  BoxRecord scaled = bounds;
  if (const float extent = bounds.longest(); extent > 0.0f && extent < 0x1p-40f) {
    const float scale = scale_for(bounds);
    scaled.scale(scale);
    for (uint32_t i = begin; i < end; ++i) boxes_[orders_[0][i]].scale(scale);
  }
  pad_ = pad_for(scaled);
}

Block::Split Block::median(uint32_t begin, uint32_t end) const {
  const BoxRecord all = bounds(begin, end);
  int axis = 0;
  for (int k = 1; k < 3; ++k)
    if (all.extent(k) > all.extent(axis)) axis = k;
  const uint32_t n = end - begin;
  return {0.0f, n > most_items_ ? constraints_.middle(n) : n / 2, axis};
}

void Block::partition(uint32_t begin, uint32_t end, const Split& split) {
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
