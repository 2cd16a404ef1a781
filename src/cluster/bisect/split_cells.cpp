// The surface area heuristic at the planes of a grid (binned as by Wald, "On fast construction of
// SAH-based bounding volume hierarchies", 2007, but the items are binned once for many levels).
// Where the number of items left of a plane is not legal, the layer of cells at the nearest legal
// number is split item by item.
#include "cluster/bisect/split_cells.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>

#include "base/parallel.hpp"
#include "cluster/bisect/cell_bins.hpp"
#include "cluster/bisect/cell_connections.hpp"
#include "cluster/bisect/scaling.hpp"

namespace umbel::cluster {
namespace {

constexpr int kBins = kCellBins;
constexpr size_t kCellsAtOnce = 1 << 13;  ///< cells that one thread bins
constexpr size_t kFewCells = 8;           ///< too few to choose from: a finer grid is made
constexpr uint32_t kMaxGrids = 8;         ///< one inside another

struct CellNode {
  Part part;
  uint32_t depth;
};

struct Bin {
  Box4 box = Box4::empty();
  uint32_t count = 0;
  template <typename Items>
  void add(const Items& items) {
    box.extend(items.box);
    count += items.count;
  }
};

struct Choice {
  uint32_t position;  ///< items on the left; 0: none found
  int axis;
  float weight = 0.0f;  ///< of the connections between the sides
};

struct Item {
  float center;
  uint32_t item;
  bool operator<(const Item& o) const {
    return center != o.center ? center < o.center : item < o.item;
  }
};

class CellSplitter {
 public:
  using Done = std::function<void(const CellSet&, const Part&)>;

  CellSplitter(const Segment& segment, uint32_t most, const Done& done)
      : source_(segment.source),
        constraints_(segment.constraints),
        connections_(segment),
        most_(most),
        done_(done) {}

  void split_items(const uint32_t* items, uint32_t offset, uint32_t count, uint32_t grids,
                   uint32_t depth, const Box4* bounds) const {
    CellSet set = make_cells(source_, items, count, bounds);
    std::vector<Cell> cells = std::move(set.cells);
    split(set, {{offset, count, std::move(cells)}, depth}, grids, true);
  }

 private:
  void split(CellSet& set, CellNode node, uint32_t grids, bool is_whole) const {
    const uint32_t n = node.part.count;
    if (n <= most_) return done_(set, node.part);
    const CellExtent extent(node.part.cells);
    if (node.part.cells.size() < kFewCells && !is_whole && grids < kMaxGrids)
      return split_again(set, node, grids);
    if (extent.single()) return done_(set, node.part);
    const Choice choice = choose(set, node, extent);
    CellNode left, right;
    left.depth = right.depth = node.depth ? node.depth - 1 : 0;
    separate(set, node.part, choice, left.part, right.part);
    node.part.cells = {};
    const auto go = [&](CellNode& side) { split(set, std::move(side), grids, false); };
    parallel_invoke([&] { go(left); }, [&] { go(right); });
  }

  void split_again(const CellSet& set, const CellNode& node, uint32_t grids) const {
    std::vector<uint32_t> items;
    items.reserve(node.part.count);
    for (const Cell& cell : node.part.cells)
      items.insert(items.end(), set.order.begin() + cell.begin,
                   set.order.begin() + cell.begin + cell.count);
    split_items(items.data(), node.part.offset, node.part.count, grids + 1, node.depth, nullptr);
  }

  Choice choose(const CellSet& set, const CellNode& node, const CellExtent& extent) const {
    const uint32_t n = node.part.count, presplit = constraints_.config.presplit_threshold;
    int longest = 0;
    for (int k = 1; k < 3; ++k)
      if (extent.box.extent(k) > extent.box.extent(longest)) longest = k;
    if (presplit && n > presplit)
      if (const Choice half = plane_nearest_to_half(node.part, longest); half.position) return half;
    if (node.depth == 0 || (presplit && n > presplit)) return {constraints_.middle(n), longest};
    const Choice best = cheapest(set, node.part, extent);
    if (best.position == 0) return {constraints_.middle(n), longest};
    if (connections_.active())
      if (const uint32_t position =
              connections_.refine(set, node.part, extent, best.axis, best.position, best.weight))
        return {position, best.axis};
    if (constraints_.legal(best.position, n)) return best;
    return {constraints_.full_near(best.position, n), best.axis};
  }

  // A plane of the grid with at least a quarter of the items on each side, where there is one:
  // no layer has to be split then.
  Choice plane_nearest_to_half(const Part& part, int axis) const {
    std::vector<uint32_t> layers(size_t(1) << 12, 0);
    for (const Cell& cell : part.cells) layers[cell.position[axis]] += cell.count;
    const uint32_t n = part.count;
    Choice best{0, axis};
    uint32_t before = 0;
    for (const uint32_t layer : layers) {
      before += layer;
      const auto off = [&](uint32_t i) { return i > n / 2 ? i - n / 2 : n / 2 - i; };
      if (before < n / 4 || before > n - n / 4 || !constraints_.legal(before, n)) continue;
      if (best.position == 0 || off(before) < off(best.position)) best.position = before;
    }
    return best;
  }

  using Bins = std::array<std::array<Bin, kBins>, 3>;

  Bins fill_bins(const Part& part, const CellExtent& extent) const {
    const size_t count = part.cells.size();
    std::vector<Bins> parts((count + kCellsAtOnce - 1) / kCellsAtOnce);
    parallel_chunks(count, kCellsAtOnce, [&](size_t begin, size_t end) {
      Bins& bins = parts[begin / kCellsAtOnce];
      for (size_t c = begin; c < end; ++c) {
        const Cell& cell = part.cells[c];
        for (int k = 0; k < 3; ++k) bins[k][extent.bin(k, cell.position[k])].add(cell);
      }
    });
    for (size_t p = 1; p < parts.size(); ++p)
      for (int k = 0; k < 3; ++k)
        for (int b = 0; b < kBins; ++b) parts[0][k][b].add(parts[p][k][b]);
    return parts[0];
  }

  Choice cheapest(const CellSet& set, const Part& part, const CellExtent& extent) const {
    const Bins bins = fill_bins(part, extent);
    const Float4 pad = pad_for(extent.box);
    const float underfill_cost = constraints_.underfill_cost(part.count);
    const float overlap_cost = constraints_.config.overlap_cost;
    const float area = extent.box.half_area(pad);
    AtPlanes cuts{};
    if (connections_.active()) cuts = connections_.weigh_planes(set, part, extent);
    Choice best{0, 0};
    float best_cost = std::numeric_limits<float>::infinity();
    for (int k = 0; k < 3; ++k) {
      std::array<Box4, kBins> right;
      Box4 side = Box4::empty();
      for (int b = kBins - 1; b > 0; --b) {
        side.extend(bins[k][b].box);
        right[b] = side;
      }
      side = Box4::empty();
      uint32_t count = 0;
      for (int b = 1; b < kBins; ++b) {
        side.extend(bins[k][b - 1].box);
        count += bins[k][b - 1].count;
        if (count == 0 || count == part.count) continue;
        float cost =
            side.half_area(pad) * constraints_.weight(count, underfill_cost) +
            right[b].half_area(pad) * constraints_.weight(part.count - count, underfill_cost);
        if (overlap_cost > 0.0f) cost += overlap_cost * overlap_weight(side, right[b], part.count);
        if (connections_.active()) cost += area * ratio_cut(cuts[k][b], count, part.count);
        if (cost < best_cost) {
          best_cost = cost;
          best = {count, k, cuts[k][b]};
        }
      }
    }
    return best;
  }

  // Sends exactly choice.position items to the left: those with the smallest centroids.
  void separate(CellSet& set, const Part& part, const Choice& choice, Part& left,
                Part& right) const {
    const int axis = choice.axis;
    left.offset = part.offset;
    left.count = choice.position;
    right.offset = part.offset + choice.position;
    right.count = part.count - choice.position;
    left.cells.reserve(part.cells.size());
    right.cells.reserve(part.cells.size());
    std::vector<uint32_t> layers(size_t(1) << 12, 0);
    for (const Cell& cell : part.cells) layers[cell.position[axis]] += cell.count;
    int layer = 0;
    uint32_t before = 0;
    while (before + layers[layer] <= choice.position) before += layers[layer++];
    for (const Cell& cell : part.cells)
      if (cell.position[axis] != layer || before == choice.position)
        (cell.position[axis] < layer ? left : right).cells.push_back(cell);
    if (before < choice.position)
      split_layer(set, part, axis, layer, choice.position - before, left, right);
  }

  void split_layer(CellSet& set, const Part& part, int axis, int layer, uint32_t rank, Part& left,
                   Part& right) const {
    std::vector<Item> items;
    const auto key = [&](uint32_t item) {
      const Box4 record = record_of(source_, item, set.scale);
      return Item{item_center(source_, record, item, set.centroid_scale)[axis], item};
    };
    for (const Cell& cell : part.cells)
      if (cell.position[axis] == layer)
        for (uint32_t i = cell.begin; i < cell.begin + cell.count; ++i)
          items.push_back(key(set.order[i]));
    std::nth_element(items.begin(), items.begin() + (rank - 1), items.end());
    const Item last = items[rank - 1];
    for (const Cell& cell : part.cells) {
      if (cell.position[axis] != layer) continue;
      uint32_t* begin = set.order.data() + cell.begin;
      uint32_t* end = begin + cell.count;
      uint32_t* middle =
          std::stable_partition(begin, end, [&](uint32_t item) { return !(last < key(item)); });
      add_cell_part(set, cell, begin, middle, left);
      add_cell_part(set, cell, middle, end, right);
    }
  }

  void add_cell_part(const CellSet& set, const Cell& cell, const uint32_t* begin,
                     const uint32_t* end, Part& part) const {
    if (begin == end) return;
    Cell own;
    own.position = cell.position;
    own.begin = static_cast<uint32_t>(begin - set.order.data());
    own.count = static_cast<uint32_t>(end - begin);
    for (const uint32_t* item = begin; item != end; ++item)
      own.box.extend(record_of(source_, *item, set.scale));
    part.cells.push_back(own);
  }

  const Source& source_;
  const SplitConstraints& constraints_;
  const CellConnections connections_;
  const uint32_t most_;
  const Done& done_;
};

}  // namespace

void split_cells(const Segment& segment, uint32_t most, const Box4* bounds,
                 const std::function<void(const CellSet&, const Part&)>& done) {
  const uint32_t count = segment.count;
  CellSplitter(segment, most, done)
      .split_items(segment.items, 0, count, 0, 2 * uint32_t(std::bit_width(count)) + 8, bounds);
}

}  // namespace umbel::cluster
