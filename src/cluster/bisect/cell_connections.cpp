#include "cluster/bisect/cell_connections.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <vector>

#include "base/parallel.hpp"
#include "cluster/bisect/scaling.hpp"

namespace umbel::cluster {
namespace {

constexpr uint32_t kSampledItems = 1 << 11;    ///< of a node, about
constexpr size_t kLeastCells = 1 << 6;         ///< in a sample, where there are as many
constexpr uint32_t kSampledCorners = 1 << 14;  ///< of a node, at most about
constexpr uint32_t kWindow = 1 << 10;          ///< items on each side of a plane, at least
constexpr size_t kRankedAtOnce = 1 << 13;      ///< items that one thread ranks
constexpr size_t kAhead = 16;                  ///< items whose vertices are fetched early

// One vertex in 2^k has at least this rank.
int rank_of(uint32_t vertex) { return std::countl_zero((vertex + 1) * 0x9e3779b1u); }

// A connection of this weight between bins a and b.
void connect(std::array<float, kCellBins>& change, int a, int b, float weight) {
  if (a == b) return;
  const auto [low, high] = std::minmax(a, b);
  change[low + 1] += weight;
  if (high + 1 < kCellBins) change[high + 1] -= weight;
}

// Of the planes, from what changes at each; multiplied by `factor`.
void add_up(AtPlanes& change, float factor) {
  for (auto& axis : change) {
    float sum = 0;
    for (float& at : axis) {
      sum += at;
      at = std::max(sum, 0.0f) * factor;
    }
  }
}

// Where an item lies, or a corner at a vertex.
struct Place {
  uint32_t number;  ///< of the item or vertex
  std::array<uint8_t, 3> bins;
};

std::array<uint8_t, 3> bins_of(const Cell& cell, const CellExtent& extent) {
  std::array<uint8_t, 3> bins;
  for (int k = 0; k < 3; ++k) bins[k] = static_cast<uint8_t>(extent.bin(k, cell.position[k]));
  return bins;
}

}  // namespace

struct CellConnections::Window {
  struct Item {
    float center;
    uint32_t item;
    bool operator<(const Item& o) const {
      return center != o.center ? center < o.center : item < o.item;
    }
  };
  std::vector<Item> items;                           ///< sorted along the axis
  uint32_t before = 0;                               ///< items of the node on their left
  Box4 left = Box4::empty(), right = Box4::empty();  ///< of the node's other items
};

CellConnections::CellConnections(const Segment& segment)
    : source_(segment.source),
      constraints_(segment.constraints),
      explicit_(!segment.source.connections.targets.empty()),
      by_vertices_(segment.source.vertices && segment.source.shared_vertex_weight > 0) {
  if (segment.count == 0 || !active()) return;
  const auto [first, last] = std::minmax_element(segment.items, segment.items + segment.count);
  first_item_ = *first;
  last_item_ = *last;
  if (by_vertices_) rank_items(segment);
}

void CellConnections::rank_items(const Segment& segment) {
  ranks_.resize(size_t(last_item_ - first_item_) + 1);
  parallel_chunks(segment.count, kRankedAtOnce, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const uint32_t item = segment.items[i];
      const uint32_t* vertices = source_.vertices + size_t(item) * source_.arity;
      int most = 0;
      for (uint32_t k = 0; k < source_.arity; ++k) most = std::max(most, rank_of(vertices[k]));
      ranks_[item - first_item_] = static_cast<uint8_t>(most);
    }
  });
}

AtPlanes CellConnections::weigh_planes(const CellSet& set, const Part& part,
                                       const CellExtent& extent) const {
  AtPlanes weights{}, by_vertices{};
  if (explicit_) sample_explicit(set, part, extent, weights);
  if (by_vertices_) {
    sample_vertices(set, part, extent, by_vertices);
    for (int k = 0; k < 3; ++k)
      for (int b = 0; b < kCellBins; ++b) weights[k][b] += by_vertices[k][b];
  }
  return weights;
}

// Where an item of the node lies. Items of other nodes in layers that both have pass as well: they
// are few.
bool CellConnections::locate(const CellSet& set, const CellExtent& extent, uint32_t item,
                             Float4& center, Int4& layers) const {
  if (item < first_item_ || item > last_item_) return false;
  const Box4 record = record_of(source_, item, set.scale);
  center = item_center(source_, record, item, set.centroid_scale);
  if (!set.mapping.holds(center)) return false;
  layers = set.mapping.position(center);
  for (int k = 0; k < 3; ++k)
    if (layers[k] < extent.low[k] || layers[k] > extent.high[k]) return false;
  return true;
}

// The connections of all items of every n-th cell, which depends on geometry alone.
void CellConnections::sample_explicit(const CellSet& set, const Part& part,
                                      const CellExtent& extent, AtPlanes& change) const {
  const Connections& connections = source_.connections;
  const size_t cells = part.cells.size();
  const size_t stride =
      std::clamp<size_t>(part.count / kSampledItems, 1, std::max<size_t>(cells / kLeastCells, 1));
  uint64_t sampled = 0;
  for (size_t c = 0; c < cells; c += stride) {
    const Cell& cell = part.cells[c];
    const std::array<uint8_t, 3> bins = bins_of(cell, extent);
    sampled += cell.count;
    for (uint32_t i = cell.begin; i < cell.begin + cell.count; ++i) {
      const Range& range = connections.ranges[set.order[i]];
      for (uint32_t k = range.offset; k < range.offset + range.count; ++k) {
        Float4 center;
        Int4 layers;
        if (!locate(set, extent, connections.targets[k], center, layers)) continue;
        // Half from each end, as in nodes that are swept.
        const float weight = 0.5f * weight_of(connections, k);
        for (int axis = 0; axis < 3; ++axis)
          connect(change[axis], bins[axis], extent.bin(axis, layers[axis]), weight);
      }
    }
  }
  add_up(change, static_cast<float>(double(part.count) / double(std::max<uint64_t>(sampled, 1))));
}

// All corners at one in 2^k vertices, chosen by hash. As in ConnectionCost, l of a vertex's m items
// on the left are l (m - l) connections.
void CellConnections::sample_vertices(const CellSet& set, const Part& part,
                                      const CellExtent& extent, AtPlanes& change) const {
  const uint64_t corner_count = uint64_t(part.count) * source_.arity;
  const int rank = std::bit_width(corner_count / kSampledCorners);
  std::vector<Place> items, corners;
  for (const Cell& cell : part.cells) {
    const std::array<uint8_t, 3> bins = bins_of(cell, extent);
    for (uint32_t i = cell.begin; i < cell.begin + cell.count; ++i)
      if (const uint32_t item = set.order[i]; ranks_[item - first_item_] >= rank)
        items.push_back({item, bins});
  }
  const auto vertices_of = [&](const Place& item) {
    return source_.vertices + size_t(item.number) * source_.arity;
  };
  for (size_t i = 0; i < items.size(); ++i) {
    __builtin_prefetch(vertices_of(items[std::min(i + kAhead, items.size() - 1)]));
    const uint32_t* vertices = vertices_of(items[i]);
    for (uint32_t k = 0; k < source_.arity; ++k)
      if (rank_of(vertices[k]) >= rank) corners.push_back({vertices[k], items[i].bins});
  }
  std::sort(corners.begin(), corners.end(),
            [](const Place& a, const Place& b) { return a.number < b.number; });
  std::vector<uint8_t> own;
  for (size_t begin = 0; begin < corners.size();) {
    size_t end = begin;
    while (end < corners.size() && corners[end].number == corners[begin].number) ++end;
    for (int axis = 0; axis < 3; ++axis) {
      own.clear();
      for (size_t c = begin; c < end; ++c) own.push_back(corners[c].bins[axis]);
      std::sort(own.begin(), own.end());
      for (size_t l = 1; l < own.size(); ++l)
        connect(change[axis], own[l - 1], own[l], float(l) * float(own.size() - l));
    }
    begin = end;
  }
  add_up(change, source_.shared_vertex_weight * std::ldexp(1.0f, rank));
}

// The kWindow items on each side of a position, if there are as many. Found in their layers.
CellConnections::Window CellConnections::window_near(const CellSet& set, const Part& part,
                                                     const CellExtent& extent, int axis,
                                                     uint32_t position) const {
  const int low = extent.low[axis], high = extent.high[axis];
  std::vector<uint32_t> layers(size_t(high - low) + 1, 0);
  for (const Cell& cell : part.cells) layers[cell.position[axis] - low] += cell.count;
  int first = low, last;
  uint32_t until = 0;
  Window window;
  for (; first < high && window.before + layers[first - low] + kWindow <= position; ++first)
    window.before += layers[first - low];
  for (last = first, until = window.before + layers[first - low];
       last < high && until < uint64_t(position) + kWindow;)
    until += layers[++last - low];
  for (const Cell& cell : part.cells) {
    const int layer = cell.position[axis];
    if (layer < first) window.left.extend(cell.box);
    if (layer > last) window.right.extend(cell.box);
    if (layer < first || layer > last) continue;
    for (uint32_t i = cell.begin; i < cell.begin + cell.count; ++i) {
      const uint32_t item = set.order[i];
      const Box4 record = record_of(source_, item, set.scale);
      window.items.push_back({item_center(source_, record, item, set.centroid_scale)[axis], item});
    }
  }
  narrow(set, position - window.before, window);
  return window;
}

// To the kWindow items on each side of the one that is `at`-th along the axis.
void CellConnections::narrow(const CellSet& set, uint32_t at, Window& window) const {
  std::vector<Window::Item>& items = window.items;
  const size_t first = at > kWindow ? at - kWindow : 0;
  const size_t last = std::min(items.size(), first + 2 * kWindow);
  std::nth_element(items.begin(), items.begin() + ptrdiff_t(first), items.end());
  if (last < items.size())
    std::nth_element(items.begin() + ptrdiff_t(first), items.begin() + ptrdiff_t(last),
                     items.end());
  for (size_t i = 0; i < items.size(); ++i)
    if (i < first || i >= last)
      (i < first ? window.left : window.right).extend(record_of(source_, items[i].item, set.scale));
  window.before += static_cast<uint32_t>(first);
  items.erase(items.begin() + ptrdiff_t(last), items.end());
  items.erase(items.begin(), items.begin() + ptrdiff_t(first));
  std::sort(items.begin(), items.end());
}

// What the weight between the sides grows by as the item moves to the left one.
float CellConnections::gain(const CellSet& set, const CellExtent& extent, int axis,
                            uint32_t item) const {
  const Connections& connections = source_.connections;
  const Box4 record = record_of(source_, item, set.scale);
  const float own = item_center(source_, record, item, set.centroid_scale)[axis];
  const Range& range = connections.ranges[item];
  float sum = 0;
  for (uint32_t k = range.offset; k < range.offset + range.count; ++k) {
    const uint32_t target = connections.targets[k];
    Float4 center;
    Int4 layers;
    if (target == item || !locate(set, extent, target, center, layers)) continue;
    const bool is_right = center[axis] != own ? center[axis] > own : target > item;
    sum += is_right ? weight_of(connections, k) : -weight_of(connections, k);
  }
  return sum;
}

uint32_t CellConnections::refine(const CellSet& set, const Part& part, const CellExtent& extent,
                                 int axis, uint32_t position, float weight) const {
  if (!explicit_) return constraints_.legal(position, part.count) ? position : 0;
  const Window window = window_near(set, part, extent, axis, position);
  const size_t count = window.items.size();
  const Float4 pad = pad_for(extent.box);
  std::vector<Box4> right(count);
  Box4 side = window.right;
  for (size_t i = count; i-- > 0;) {
    side.extend(record_of(source_, window.items[i].item, set.scale));
    right[i] = side;
  }
  // The weights relative to that before the window; then that at the plane is as estimated.
  std::vector<double> cuts(count);
  double sum = 0, least = 0, at_position = 0;
  for (size_t i = 0; i < count; ++i) {
    if (window.before + i == position) at_position = sum;
    cuts[i] = sum;
    least = std::min(least, sum);
    sum += gain(set, extent, axis, window.items[i].item);
  }
  const double offset = std::max(double(weight) - at_position, -least);
  const uint32_t n = part.count;
  const bool feasible = constraints_.feasible(n);
  const float underfill_cost = constraints_.underfill_cost(n);
  const float area = extent.box.half_area(pad), overlap_cost = constraints_.config.overlap_cost;
  uint32_t best = 0;
  float best_cost = std::numeric_limits<float>::infinity();
  side = window.left;
  for (size_t i = 0; i < count; ++i) {
    const uint32_t left = window.before + static_cast<uint32_t>(i);
    if (left > 0 && constraints_.legal(left, n, feasible)) {
      const float cost = side.half_area(pad) * constraints_.weight(left, underfill_cost) +
                         right[i].half_area(pad) * constraints_.weight(n - left, underfill_cost) +
                         overlap_cost * overlap_weight(side, right[i], n) +
                         area * ratio_cut(static_cast<float>(cuts[i] + offset), left, n);
      if (cost < best_cost) {
        best_cost = cost;
        best = left;
      }
    }
    side.extend(record_of(source_, window.items[i].item, set.scale));
  }
  return best;
}

}  // namespace umbel::cluster
