// MicroCluster-clusters by a recursive counting sort: items go to the cells of a grid along a
// Morton curve, and cells with many items are grids of their own (as the buckets of a
// most-significant-digit radix sort). The largest cells of the binary hierarchy over the curve that
// hold few enough items become micro-clusters.
#include "cluster/bisect/micro_clusters.hpp"

#include <bit>
#include <cmath>
#include <utility>

#include "base/parallel.hpp"

namespace umbel::cluster {
namespace {

constexpr size_t kMicroItemsAtOnce = 1 << 15;
constexpr size_t kCached = 1 << 8;  ///< items that go through several loops in a cache
constexpr uint32_t kMostBits = 11;
constexpr uint32_t kMostAxisBits = 8;
constexpr uint32_t kItemsPerCell = 4;

// Cells that are numbered along a Morton curve. Each bit of the number halves the cells along the
// axis on which they are longest, so that flat and long inputs get useful cells too.
class SmallGrid {
 public:
  SmallGrid(const std::array<uint32_t, 3>& low, const std::array<uint32_t, 3>& high,
            uint32_t bits) {
    std::array<uint32_t, 3> length, axis_bits{};
    for (int k = 0; k < 3; ++k) {
      origin_[k] = static_cast<uint16_t>(low[k]);
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
      // The multiplier moves the largest offset to the top of 16 bits.
      const uint32_t last = high[k] - low[k];
      const uint32_t shift = last ? 16 - std::bit_width(last) : 0;
      multiplier_[k] = static_cast<uint16_t>(1u << shift);
      factor_[k] = static_cast<uint16_t>(
          axis_bits[k] ? (uint64_t(1) << (16 + axis_bits[k])) / (uint64_t(last + 1) << shift) : 0);
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
  uint32_t code(UShort8 c) const {
    const UShort8 cell = multiply_high((c - origin_) * multiplier_, factor_);
    return spread_[0][cell[0]] | spread_[1][cell[1]] | spread_[2][cell[2]];
  }

 private:
  uint32_t bits_ = 0;
  UShort8 origin_{}, multiplier_{}, factor_{};
  std::array<std::array<uint16_t, 1 << kMostAxisBits>, 3> spread_;
};

// Sorts one range of items in a cache.
class Sorter {
 public:
  explicit Sorter(const MicroClusterSizes& sizes) : sizes_(sizes) {}

  // Items are in `from`; `to` is room for as many.
  void sort(ShortBox* from, ShortBox* to, uint32_t n) {
    const bool is_group = begin_group(n);
    sort_grouped(from, to, n);
    if (is_group) end_group();
  }

  /// Once all is sorted: points the groups to their parts in `micros`, and appends them.
  void link_groups(std::vector<MicroCluster>& all) {
    for (MicroCluster& group : groups_) {
      group.parts = micros.data() + firsts_[&group - groups_.data()];
      all.push_back(group);
    }
  }

  std::vector<MicroCluster> micros, coincident;

 private:
  bool begin_group(uint32_t n) {
    if (grouped_ || n > sizes_.group) return false;
    firsts_.push_back(static_cast<uint32_t>(micros.size()));
    return grouped_ = true;
  }

  void end_group() {
    MicroCluster group{empty_short_box(), {nullptr}, 0, 0};
    for (size_t m = firsts_.back(); m < micros.size(); ++m) {
      group.box = join(group.box, micros[m].box);
      group.count += micros[m].count;
      ++group.part_count;
    }
    if (group.count)
      groups_.push_back(group);
    else
      firsts_.pop_back();
    grouped_ = false;
  }

  void sort_grouped(ShortBox* from, ShortBox* to, uint32_t n) {
    if (n <= sizes_.micro) return emit(from, n);
    ShortBox centers = empty_short_box();
    for (uint32_t i = 0; i < n; ++i) centers = join(centers, centers_of(from[i]));
    const auto bound = [&](int lane) { return uint32_t(std::abs(int(centers[lane]))); };
    const SmallGrid grid({bound(0), bound(1), bound(2)}, {bound(4), bound(5), bound(6)},
                         std::clamp<uint32_t>(std::bit_width(n / kItemsPerCell), 3, kMostBits));
    if (grid.bits() == 0) return emit(from, n);
    std::array<uint32_t, (1 << kMostBits) + 1> ends;
    const uint32_t cells = 1u << grid.bits();
    std::fill_n(ends.begin(), cells + 1, 0u);
    if (codes_.size() < n) codes_.resize(n);
    uint16_t* codes = codes_.data();
    for (uint32_t i = 0; i < n; ++i) {
      codes[i] = static_cast<uint16_t>(grid.code(center_of(from[i])));
      ++ends[codes[i] + 1];
    }
    // ends[c + 1] is where cell c starts, until its items have come.
    uint32_t sum = 0;
    for (uint32_t c = 0; c < cells; ++c) sum += std::exchange(ends[c + 1], sum);
    for (uint32_t i = 0; i < n; ++i) to[ends[codes[i] + 1]++] = from[i];
    visit_cells(to, from, ends.data(), 0, grid.bits());
  }

  // The cells from `code` on that share all but the last `level` bits.
  void visit_cells(ShortBox* from, ShortBox* to, const uint32_t* ends, uint32_t code,
                   uint32_t level) {
    const uint32_t begin = ends[code], n = ends[code + (1u << level)] - begin;
    if (n == 0) return;
    const bool is_group = begin_group(n);
    if (n <= sizes_.micro) {
      emit(from + begin, n);
    } else if (level == 0) {
      sort_grouped(from + begin, to + begin, n);
    } else {
      visit_cells(from, to, ends, code, level - 1);
      visit_cells(from, to, ends, code + (1u << (level - 1)), level - 1);
    }
    if (is_group) end_group();
  }

  void emit(ShortBox* items, uint32_t n) {
    ShortBox box = empty_short_box();
    for (uint32_t i = 0; i < n; ++i) box = join(box, items[i]);
    if (n >= sizes_.coincident) return coincident.push_back({box, {items}, n, 0});
    const bool is_group = begin_group(0);
    micros.push_back({box, {items}, n, 0});
    if (is_group) end_group();
  }

  const MicroClusterSizes& sizes_;
  bool grouped_ = false;
  std::vector<MicroCluster> groups_;
  std::vector<uint32_t> firsts_;  ///< of their parts
  std::vector<uint16_t> codes_;
};

constexpr float kLastStep = 32767.0f;  ///< of the longest side

struct Rounding {
  explicit Rounding(const Box4& bounds) : origin(bounds.low) {
    origin[3] = 0;
    scale = splat(kLastStep / bounds.longest());
  }
  // Both corners are rounded down.
  ShortBox round(const Box4& b, uint32_t tag) const {
    const Int4 low = __builtin_convertvector((b.low - origin) * scale, Int4);
    const Int4 high = __builtin_convertvector((-b.negated_high - origin) * scale, Int4);
    ShortBox box = pack(low, -high);
    box[3] = static_cast<int16_t>(tag);
    box[7] = static_cast<int16_t>(tag >> 16);
    return box;
  }
  Float4 origin, scale;
};

// By one thread: rounds few boxes. Returns the box of all items.
Box4 round_few(const Source& source, const uint32_t* items, uint32_t count,
               const Rounding& rounding, ShortBox* boxes) {
  Box4 all = Box4::empty();
  for (uint32_t i = 0; i < count; ++i) {
    source.prefetch(items[std::min(i + 24, count - 1)]);
    source.prefetch_box(items[std::min(i + 8, count - 1)]);
    const Box4 record = source.record(items[i]);
    all.extend(record);
    boxes[i] = rounding.round(record, items[i]);
  }
  return all;
}

void make_of_few(const MicroClusterSizes& sizes, uint32_t count, MicroClusterSet& set) {
  Sorter sorter(sizes);
  sorter.sort(set.boxes.data(), set.sorted.data(), count);
  sorter.link_groups(set.groups);
  set.micros.push_back(std::move(sorter.micros));
  set.coincident = std::move(sorter.coincident);
}

// By all threads: rounds all boxes, sorts them into the cells of one grid, and then each cell.
class ManyItems {
 public:
  ManyItems(const Source& source, const uint32_t* items, uint32_t count, const Rounding& rounding,
            const SmallGrid& grid, MicroClusterSet& set)
      : source_(source),
        items_(items),
        count_(count),
        rounding_(rounding),
        grid_(grid),
        set_(set),
        cells_(1u << grid.bits()),
        // Few chunks, so that their counts cost little.
        chunk_(std::max<size_t>(kMicroItemsAtOnce, (count + 63) / 64)),
        codes_(count),
        next_((count + chunk_ - 1) / chunk_) {}

  // Counts the items of each cell, by chunk. Returns the box of all items.
  Box4 round() {
    std::vector<Box4> parts(next_.size());
    parallel_chunks(count_, chunk_, [&](size_t begin, size_t end) {
      parts[begin / chunk_] = round_chunk(begin, end, next_[begin / chunk_]);
    });
    Box4 all = Box4::empty();
    for (const Box4& part : parts) all.extend(part);
    return all;
  }

  void make(const MicroClusterSizes& sizes) {
    const std::vector<uint32_t> begins = sort_by_cell();
    // Runs of cells that are large enough to be worth a task.
    std::vector<uint32_t> tasks{0};
    for (uint32_t c = 1; c <= cells_; ++c)
      if (begins[c] - begins[tasks.back()] >= kMicroItemsAtOnce || c == cells_) tasks.push_back(c);
    set_.micros.resize(tasks.size() - 1);
    std::vector<std::vector<MicroCluster>> groups(set_.micros.size()),
        coincident(set_.micros.size());
    ShortBox *boxes = set_.boxes.data(), *sorted = set_.sorted.data();
    parallel_for(groups.size(), 1, [&](size_t t) {
      Sorter sorter(sizes);
      for (uint32_t c = tasks[t]; c < tasks[t + 1]; ++c)
        if (begins[c + 1] > begins[c])
          sorter.sort(sorted + begins[c], boxes + begins[c], begins[c + 1] - begins[c]);
      sorter.link_groups(groups[t]);
      set_.micros[t] = std::move(sorter.micros);
      coincident[t] = std::move(sorter.coincident);
    });
    for (const auto& part : groups) set_.groups.insert(set_.groups.end(), part.begin(), part.end());
    for (const auto& part : coincident)
      set_.coincident.insert(set_.coincident.end(), part.begin(), part.end());
  }

 private:
  Box4 round_chunk(size_t begin, size_t end, std::vector<uint32_t>& own) {
    ShortBox* boxes = set_.boxes.data();
    uint16_t* codes = codes_.data();
    // Neighbours often share a cell, and two counts at one address would wait for each other.
    std::vector<uint32_t> counts(2 * size_t(cells_), 0);
    Box4 all = Box4::empty();
    // Counts that wait for each other would hold up the boxes behind them in the same loop.
    for (size_t from = begin; from < end; from += kCached) {
      const size_t to = std::min(from + kCached, end);
      for (size_t i = from; i < to; ++i) {
        const Box4 record = source_.record(items_[i]);
        all.extend(record);
        boxes[i] = rounding_.round(record, items_[i]);
      }
      for (size_t i = from; i < to; ++i)
        codes[i] = static_cast<uint16_t>(grid_.code(center_of(boxes[i])));
      for (size_t i = from; i < to; ++i) ++counts[2 * codes[i] + (i & 1)];
    }
    own.resize(cells_);
    for (uint32_t c = 0; c < cells_; ++c) own[c] = counts[2 * c] + counts[2 * c + 1];
    return all;
  }

  // Returns where each cell's items begin.
  std::vector<uint32_t> sort_by_cell() {
    std::vector<uint32_t> begins(cells_ + 1);
    uint32_t sum = 0;
    for (uint32_t c = 0; c < cells_; ++c) {
      begins[c] = sum;
      for (auto& own : next_) sum += std::exchange(own[c], sum);
    }
    begins[cells_] = sum;
    const ShortBox* boxes = set_.boxes.data();
    ShortBox* sorted = set_.sorted.data();
    const uint16_t* codes = codes_.data();
    parallel_chunks(count_, chunk_, [&](size_t begin, size_t end) {
      uint32_t* own = next_[begin / chunk_].data();
      for (size_t i = begin; i < end; ++i) sorted[own[codes[i]]++] = boxes[i];
    });
    return begins;
  }

  const Source& source_;
  const uint32_t* items_;
  const uint32_t count_;
  const Rounding& rounding_;
  const SmallGrid& grid_;
  MicroClusterSet& set_;
  const uint32_t cells_;
  const size_t chunk_;
  CpuBuffer<uint16_t> codes_;
  std::vector<std::vector<uint32_t>> next_;  ///< by chunk and cell: counts, then where items go
};

}  // namespace

bool suits_short_boxes(const Box4& bounds) {
  const float extent = bounds.longest();
  return extent > 0x1p-100f && extent < 0x1p126f;
}

Box4 box_of(const Source& source, const uint32_t* items, uint32_t count) {
  std::vector<Box4> parts((count + kMicroItemsAtOnce - 1) / kMicroItemsAtOnce);
  parallel_chunks(count, kMicroItemsAtOnce, [&](size_t begin, size_t end) {
    Box4 box = Box4::empty();
    for (size_t i = begin; i < end; ++i) {
      source.prefetch(items[std::min(i + 24, end - 1)]);
      source.prefetch_box(items[std::min(i + 8, end - 1)]);
      box.extend(source.record(items[i]));
    }
    parts[begin / kMicroItemsAtOnce] = box;
  });
  Box4 all = Box4::empty();
  for (const Box4& part : parts) all.extend(part);
  return all;
}

MicroClusterSet make_micro_clusters(const Source& source, const uint32_t* items, uint32_t count,
                                    const Box4& bounds, const MicroClusterSizes& sizes) {
  // Without coordinates that no item uses, the grid is finer.
  const auto make_within = [&](const Box4& smallest) {
    return suits_short_boxes(smallest) ? make_micro_clusters(source, items, count, smallest, sizes)
                                       : MicroClusterSet(0);
  };
  const Rounding rounding(bounds);
  MicroClusterSet set(count);
  if (count <= kMicroItemsAtOnce) {
    const Box4 smallest = round_few(source, items, count, rounding, set.boxes.data());
    if (!same_box(smallest, bounds)) return make_within(smallest);
    make_of_few(sizes, count, set);
    return set;
  }
  std::array<uint32_t, 3> low{}, high;
  for (int k = 0; k < 3; ++k) high[k] = static_cast<uint32_t>(bounds.extent(k) * rounding.scale[0]);
  const SmallGrid grid(low, high, kMostBits);
  ManyItems all(source, items, count, rounding, grid, set);
  if (const Box4 smallest = all.round(); !same_box(smallest, bounds)) return make_within(smallest);
  all.make(sizes);
  return set;
}

}  // namespace umbel::cluster
