// Micro-clusters by a recursive counting sort: items go to the cells of a grid along a Morton
// curve, and crowded cells are grids of their own (as the buckets of a most-significant-digit radix
// sort). The largest cells of the binary hierarchy over the curve that hold few enough items become
// micro-clusters.
#include "cluster/micros.hpp"

#include <bit>
#include <cmath>
#include <memory>

#include "base/parallel.hpp"

namespace umbel::cluster {
namespace {

constexpr size_t kChunk = 1 << 15;
constexpr uint32_t kMostBits = 11;
constexpr uint32_t kMostAxisBits = 8;

// Cells that are numbered along a Morton curve. Each bit of the number halves the cells along the
// axis on which they are longest, so that flat and long inputs get useful cells too.
class SmallGrid {
 public:
  SmallGrid(const std::array<uint32_t, 3>& low, const std::array<uint32_t, 3>& high,
            uint32_t bits) {
    std::array<uint32_t, 3> length, axis_bits{};
    for (int k = 0; k < 3; ++k) {
      origin_[k] = low[k];
      length[k] = high[k] - low[k] + 1;
    }
    std::array<uint8_t, kMostBits> axes;
    while (bits_ < bits) {
      int axis = -1;
      for (int k = 0; k < 3; ++k)
        if (axis_bits[k] < kMostAxisBits && (axis < 0 || length[k] > length[axis])) axis = k;
      if (axis < 0 || length[axis] <= 1) break;
      length[axis] = (length[axis] + 1) / 2;
      ++axis_bits[axis];
      axes[bits_++] = static_cast<uint8_t>(axis);
    }
    for (int k = 0; k < 3; ++k) {
      factor_[k] = (1u << (16 + axis_bits[k])) / (high[k] - low[k] + 1);
      spread_[k][0] = 0;
    }
    std::array<uint32_t, 3> filled{1, 1, 1};
    for (uint32_t bit = 0; bit < bits_; ++bit) {
      const int axis = axes[bits_ - 1 - bit];
      for (uint32_t v = 0; v < filled[axis]; ++v)
        spread_[axis][filled[axis] + v] = static_cast<uint16_t>(spread_[axis][v] | 1u << bit);
      filled[axis] *= 2;
    }
  }
  uint32_t bits() const { return bits_; }
  uint32_t code(Center8 c) const {
    return spread_[0][(c[0] - origin_[0]) * factor_[0] >> 16] |
           spread_[1][(c[1] - origin_[1]) * factor_[1] >> 16] |
           spread_[2][(c[2] - origin_[2]) * factor_[2] >> 16];
  }

 private:
  uint32_t bits_ = 0;
  std::array<uint32_t, 3> origin_, factor_;
  std::array<std::array<uint16_t, 1 << kMostAxisBits>, 3> spread_;
};

// Sorts one range of items in a cache.
class Sorter {
 public:
  Sorter(uint32_t* order, uint32_t most) : order_(order), most_(most) {}

  // Items are in `from`; `to` is room for as many.
  void sort(SmallBox* from, SmallBox* to, uint32_t begin, uint32_t n) {
    if (n <= most_) return emit(from, begin, n);
    Center8 low = center_of(from[begin]), high = low;
    for (uint32_t i = begin + 1; i < begin + n; ++i) {
      const Center8 c = center_of(from[i]);
      low = c < low ? c : low;
      high = c > high ? c : high;
    }
    const SmallGrid grid({low[0], low[1], low[2]}, {high[0], high[1], high[2]},
                         std::min<uint32_t>(std::bit_width(n), kMostBits));
    if (grid.bits() == 0) return emit(from, begin, n);
    std::array<uint32_t, (1 << kMostBits) + 1> ends;
    const uint32_t cells = 1u << grid.bits();
    std::fill_n(ends.begin(), cells + 1, 0u);
    if (codes_.size() < n) codes_.resize(n);
    for (uint32_t i = 0; i < n; ++i) {
      codes_[i] = static_cast<uint16_t>(grid.code(center_of(from[begin + i])));
      ++ends[codes_[i] + 1];
    }
    // ends[c + 1] is where cell c starts, until its items have come.
    uint32_t sum = begin;
    for (uint32_t c = 0; c < cells; ++c) sum += std::exchange(ends[c + 1], sum);
    ends[0] = begin;
    for (uint32_t i = 0; i < n; ++i) to[ends[codes_[i] + 1]++] = from[begin + i];
    walk(to, from, ends.data(), 0, grid.bits());
  }

  std::vector<Micro> micros;

 private:
  // The cells from `code` on that share all but the last `level` bits.
  void walk(SmallBox* from, SmallBox* to, const uint32_t* ends, uint32_t code, uint32_t level) {
    const uint32_t begin = ends[code], n = ends[code + (1u << level)] - begin;
    if (n == 0) return;
    if (n <= most_) return emit(from, begin, n);
    if (level == 0) return sort(from, to, begin, n);
    walk(from, to, ends, code, level - 1);
    walk(from, to, ends, code + (1u << (level - 1)), level - 1);
  }

  void emit(const SmallBox* from, uint32_t begin, uint32_t n) {
    SmallBox box = empty_small_box();
    for (uint32_t i = begin; i < begin + n; ++i) {
      box = join(box, from[i]);
      order_[i] = tag_of(from[i]);
    }
    micros.push_back({box, begin, n});
  }

  uint32_t* order_;
  const uint32_t most_;
  std::vector<uint16_t> codes_;
};

struct Rounding {
  explicit Rounding(const BoxRecord& bounds) : origin(bounds.low) {
    origin[3] = 0;
    scale = splat(kSmallBoxLast / bounds.longest());
  }
  // Both corners are rounded down.
  SmallBox round(const BoxRecord& b, uint32_t tag) const {
    const Int4 low = __builtin_convertvector((b.low - origin) * scale, Int4);
    const Int4 high = __builtin_convertvector((-b.negated_high - origin) * scale, Int4);
    SmallBox box = pack(low, -high);
    box[3] = static_cast<int16_t>(tag);
    box[7] = static_cast<int16_t>(tag >> 16);
    return box;
  }
  Float4 origin, scale;
};

}  // namespace

bool suits_small_boxes(const BoxRecord& bounds) {
  const float extent = bounds.longest();
  return extent > 0x1p-100f && extent < 0x1p126f;
}

BoxRecord box_of(const Source& source, const uint32_t* items, uint32_t count) {
  std::vector<BoxRecord> parts((count + kChunk - 1) / kChunk);
  parallel_chunks(count, kChunk, [&](size_t begin, size_t end) {
    BoxRecord box = BoxRecord::empty();
    for (size_t i = begin; i < end; ++i) box.extend(source.record(items[i]));
    parts[begin / kChunk] = box;
  });
  BoxRecord all = BoxRecord::empty();
  for (const BoxRecord& part : parts) all.extend(part);
  return all;
}

MicroSet make_micros(const Source& source, const uint32_t* items, uint32_t count,
                     const BoxRecord& bounds, uint32_t most) {
  const Rounding rounding(bounds);
  std::array<uint32_t, 3> low{}, high;
  for (int k = 0; k < 3; ++k) high[k] = static_cast<uint32_t>(bounds.extent(k) * rounding.scale[0]);
  const SmallGrid grid(low, high, kMostBits);
  const uint32_t cells = 1u << grid.bits();
  std::unique_ptr<SmallBox[]> boxes(new SmallBox[count]), sorted(new SmallBox[count]);
  std::unique_ptr<uint16_t[]> codes(new uint16_t[count]);
  // Few chunks, so that their counts cost little.
  const size_t chunk = std::max<size_t>(kChunk, (count + 63) / 64);
  std::vector<std::vector<uint32_t>> next((count + chunk - 1) / chunk);
  parallel_chunks(count, chunk, [&](size_t begin, size_t end) {
    std::vector<uint32_t>& own = next[begin / chunk];
    own.assign(cells, 0);
    for (size_t i = begin; i < end; ++i) {
      const SmallBox box = rounding.round(source.record(items[i]), items[i]);
      boxes[i] = box;
      ++own[codes[i] = static_cast<uint16_t>(grid.code(center_of(box)))];
    }
  });
  std::vector<uint32_t> begins(cells + 1);
  uint32_t sum = 0;
  for (uint32_t c = 0; c < cells; ++c) {
    begins[c] = sum;
    for (auto& own : next) sum += std::exchange(own[c], sum);
  }
  begins[cells] = sum;
  parallel_chunks(count, chunk, [&](size_t begin, size_t end) {
    std::vector<uint32_t>& own = next[begin / chunk];
    for (size_t i = begin; i < end; ++i) sorted[own[codes[i]]++] = boxes[i];
  });
  // Runs of cells that are large enough to be worth a task.
  std::vector<uint32_t> tasks{0};
  for (uint32_t c = 1; c <= cells; ++c)
    if (begins[c] - begins[tasks.back()] >= kChunk || c == cells) tasks.push_back(c);
  MicroSet set;
  set.order.resize(count);
  std::vector<std::vector<Micro>> micros(tasks.size() - 1);
  parallel_for(micros.size(), 1, [&](size_t t) {
    Sorter sorter(set.order.data(), most);
    for (uint32_t c = tasks[t]; c < tasks[t + 1]; ++c)
      if (begins[c + 1] > begins[c])
        sorter.sort(sorted.get(), boxes.get(), begins[c], begins[c + 1] - begins[c]);
    micros[t] = std::move(sorter.micros);
  });
  size_t total = 0;
  for (const auto& part : micros) total += part.size();
  set.micros.reserve(total);
  for (const auto& part : micros) set.micros.insert(set.micros.end(), part.begin(), part.end());
  return set;
}

}  // namespace umbel::cluster
