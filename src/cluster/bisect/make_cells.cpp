// One pass finds each item's cell and grows the cells' boxes, a counting sort brings the items of
// a cell together. Boxes and counts of threads are merged by minimum and sum, which are exact, so
// it does not matter which thread saw what.
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <bit>
#include <limits>
#include <utility>

#include "base/big_vector.hpp"
#include "base/parallel.hpp"
#include "cluster/bisect/cells.hpp"
#include "cluster/bisect/scaling.hpp"

namespace umbel::cluster {
namespace {

constexpr uint32_t kMaxAxisBits = 12;
constexpr size_t kItemsAtOnce = 1 << 13;
constexpr size_t kFetched = 64;  ///< items whose cells are fetched at the same time

struct Bounds {
  Box4 boxes = Box4::empty(), centers = Box4::empty();
  void extend(const Bounds& o) {
    boxes.extend(o.boxes);
    centers.extend(o.centers);
  }
};

// At the input's own scale.
Bounds bounds_of(const Source& source, const uint32_t* items, uint32_t count) {
  std::vector<Bounds> parts((count + kItemsAtOnce - 1) / kItemsAtOnce);
  parallel_chunks(count, kItemsAtOnce, [&](size_t begin, size_t end) {
    Bounds b;
    for (size_t i = begin; i < end; ++i) {
      const Box4 record = record_of(source, items[i], 1.0f);
      const Float4 center = item_center(source, record, items[i], 1.0f);
      b.boxes.extend(record);
      b.centers.extend({center, -center});
    }
    parts[begin / kItemsAtOnce] = b;
  });
  Bounds all;
  for (const Bounds& b : parts) all.extend(b);
  if (source.centroids.empty()) all.centers = all.boxes;
  return all;
}

float grid_scale(const Box4& b) { return scale_for(b, std::numeric_limits<float>::infinity(), 40); }

// A grid whose cells are numbered along a Morton curve; each bit of the number halves the cells
// along the axis on which they are longest, so that flat and long inputs get useful cells too.
class Grid {
 public:
  Grid(const Box4& centers, uint32_t bits) {
    std::array<float, 3> length;
    for (int k = 0; k < 3; ++k) length[k] = centers.extent(k);
    std::array<std::vector<uint32_t>, 3> bits_of;
    for (uint32_t bit = bits; bit-- > 0;) {
      int axis = -1;
      for (int k = 0; k < 3; ++k)
        if (bits_of[k].size() < kMaxAxisBits && (axis < 0 || length[k] > length[axis])) axis = k;
      if (axis < 0 || length[axis] <= 0x1p-100f) break;
      bits_of[axis].push_back(bit);
      length[axis] *= 0.5f;
    }
    mapping_.origin = centers.low;
    for (int k = 0; k < 3; ++k) {
      const uint32_t cells = 1u << bits_of[k].size();
      mapping_.scale[k] = cells > 1 ? float(cells) / centers.extent(k) : 0.0f;
      mapping_.last[k] = static_cast<float>(cells - 1);
      spread_[k].assign(cells, 0);
      for (uint32_t v = 0; v < cells; ++v)
        for (size_t b = 0; b < bits_of[k].size(); ++b)
          spread_[k][v] |= (v >> (bits_of[k].size() - 1 - b) & 1) << bits_of[k][b];
    }
  }
  const GridMapping& mapping() const { return mapping_; }
  uint32_t code(Int4 position) const {
    return spread_[0][position[0]] | spread_[1][position[1]] | spread_[2][position[2]];
  }

 private:
  std::array<std::vector<uint32_t>, 3> spread_;
  GridMapping mapping_;
};

using GridPosition = std::array<uint16_t, 3>;

// The boxes of the cells that one thread has seen, numbered in the order in which they came.
class Tally {
 public:
  explicit Tally(uint32_t bits) : number(size_t(1) << bits, kNone) {}

  void prefetch(uint32_t code) const { __builtin_prefetch(&number[code]); }
  // The number of a code's cell, which may be a new one.
  uint32_t find(uint32_t code, Int4 position) {
    uint32_t& n = number[code];
    if (n == kNone) {
      n = static_cast<uint32_t>(boxes.size());
      boxes.push_back(Box4::empty());
      codes.push_back(code);
      positions.push_back({uint16_t(position[0]), uint16_t(position[1]), uint16_t(position[2])});
    }
    __builtin_prefetch(&boxes[n]);
    return n;
  }

  std::vector<uint32_t> number;  ///< of each code's cell
  std::vector<Box4> boxes;
  std::vector<uint32_t> codes;
  std::vector<GridPosition> positions;
};

// Numbers the cells by code, and leaves their numbers in the first tally.
std::vector<Cell> merge(std::vector<Tally*>& tallies) {
  Tally& all = *tallies[0];
  for (size_t t = 1; t < tallies.size(); ++t) {
    const Tally& other = *tallies[t];
    for (size_t c = 0; c < other.boxes.size(); ++c) {
      const GridPosition& p = other.positions[c];
      all.boxes[all.find(other.codes[c], Int4{p[0], p[1], p[2], 0})].extend(other.boxes[c]);
    }
  }
  std::vector<Cell> cells;
  cells.reserve(all.boxes.size());
  for (uint32_t& n : all.number) {
    if (n == kNone) continue;
    cells.push_back({all.boxes[n], 0, 0, all.positions[n]});
    n = static_cast<uint32_t>(cells.size() - 1);
  }
  return cells;
}

// Brings the items of each cell together, in the order in which they came.
void sort_by_cell(const uint32_t* items, const std::vector<uint32_t>& number_of_code,
                  std::span<const uint32_t> codes, CellSet& set) {
  const size_t count = codes.size(), chunk = (count + 7) / 8;
  std::vector<std::vector<uint32_t>> next((count + chunk - 1) / chunk);
  parallel_chunks(count, chunk, [&](size_t begin, size_t end) {
    std::vector<uint32_t>& own = next[begin / chunk];
    own.assign(set.cells.size(), 0);
    for (size_t i = begin; i < end; ++i) ++own[number_of_code[codes[i]]];
  });
  uint32_t at = 0;
  for (size_t c = 0; c < set.cells.size(); ++c) {
    set.cells[c].begin = at;
    for (auto& own : next) at += std::exchange(own[c], at);
    set.cells[c].count = at - set.cells[c].begin;
  }
  reserve_big(set.order, count);
  set.order.resize(count);
  parallel_chunks(count, chunk, [&](size_t begin, size_t end) {
    std::vector<uint32_t>& own = next[begin / chunk];
    for (size_t i = begin; i < end; ++i) set.order[own[number_of_code[codes[i]]]++] = items[i];
  });
}

}  // namespace

CellSet make_cells(const Source& source, const uint32_t* items, uint32_t count,
                   const Box4* bounds) {
  CellSet set;
  const Bounds all = bounds ? Bounds{*bounds, *bounds} : bounds_of(source, items, count);
  set.scale = grid_scale(all.boxes);
  set.centroid_scale = source.centroids.empty() ? set.scale : grid_scale(all.centers);
  Box4 centers = all.centers;
  centers.scale(set.centroid_scale);
  const uint32_t bits = std::clamp<uint32_t>(std::bit_width(count) - 2, 6, 21);
  const Grid grid(centers, bits);
  set.mapping = grid.mapping();
  BigVector<uint32_t> codes(count);
  tbb::enumerable_thread_specific<Tally> tallies([&] { return Tally(bits); });
  parallel_chunks(count, kItemsAtOnce, [&](size_t begin, size_t end) {
    Tally& tally = tallies.local();
    std::array<Box4, kFetched> records;
    std::array<Int4, kFetched> positions;
    std::array<uint32_t, kFetched> cells;
    for (size_t first = begin; first < end; first += kFetched) {
      const size_t n = std::min(kFetched, end - first);
      for (size_t i = 0; i < n; ++i) {
        const uint32_t item = items[first + i];
        records[i] = record_of(source, item, set.scale);
        positions[i] =
            set.mapping.position(item_center(source, records[i], item, set.centroid_scale));
        tally.prefetch(codes[first + i] = grid.code(positions[i]));
      }
      for (size_t i = 0; i < n; ++i) cells[i] = tally.find(codes[first + i], positions[i]);
      for (size_t i = 0; i < n; ++i) tally.boxes[cells[i]].extend(records[i]);
    }
  });
  std::vector<Tally*> list;
  for (Tally& tally : tallies) list.push_back(&tally);
  set.cells = merge(list);
  if (bounds) {
    Box4 own = Box4::empty(), given = *bounds;
    for (const Cell& cell : set.cells) own.extend(cell.box);
    given.scale(set.scale);
    if (!same_box(own, given)) return make_cells(source, items, count, nullptr);
  }
  sort_by_cell(items, list[0]->number, codes, set);
  return set;
}

}  // namespace umbel::cluster
