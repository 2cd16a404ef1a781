#include "scale/build_partition.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

namespace umbel::scale {
namespace {

constexpr double kFirstPlane[] = {1.0 / 2, 1.0 / 3};

void add_to(uint32_t& cell, uint32_t count) {
  if (count > std::numeric_limits<uint32_t>::max() - cell)
    throw Error(ErrorCode::kUnsupported, "over 4294967295 triangles in one cell of a mesh");
  cell += count;
}

float at(const Vec3& v, size_t axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

}  // namespace

/// A box of cells, [low, high), of one grid.
struct PartitionBuilder::Cells {
  const CellGrid& grid;
  const std::vector<uint32_t>& counts;
  uint32_t depth;
  std::array<uint32_t, 3> low, high;

  /// Sums across each axis.
  std::array<std::vector<uint64_t>, 3> sums() const {
    std::array<std::vector<uint64_t>, 3> sums;
    for (size_t a = 0; a < 3; ++a) sums[a].assign(high[a] - low[a], 0);
    for (uint32_t z = low[2]; z < high[2]; ++z)
      for (uint32_t y = low[1]; y < high[1]; ++y) {
        const uint32_t* row = counts.data() + grid.number({0, y, z});
        uint64_t sum = 0;
        for (uint32_t x = low[0]; x < high[0]; ++x) {
          sums[0][x - low[0]] += row[x];
          sum += row[x];
        }
        sums[1][y - low[1]] += sum;
        sums[2][z - low[2]] += sum;
      }
    return sums;
  }
};

void CellCounts::merge(const CellCounts& other) {
  for (size_t g = 0; g < grids.size(); ++g)
    for (size_t k = 0; k < grids[g].size(); ++k) add_to(grids[g][k], other.grids[g][k]);
}

PartitionBuilder::PartitionBuilder(const Aabb& box, const PartitionConfig& config)
    : config_(config) {
  if (config.capacity == 0 || config.resolution == 0 || config.inner_resolution < 2)
    throw Error(ErrorCode::kInvalidArgument, "units of no triangles, or grids of no cells");
  if (box.min.x <= box.max.x) partition_.grids_[0] = {box.min, box.max, config.resolution};
  partition_.units_ = 0;
  pending_.push_back({0, 0, 0});
}

CellCounts PartitionBuilder::empty_counts() const {
  CellCounts counts;
  for (const Pending& one : pending_)
    counts.grids.emplace_back(partition_.grids_[one.grid].cells(), 0u);
  return counts;
}

void PartitionBuilder::count(CellCounts& counts, const Vec3& centroid, uint32_t weight) const {
  size_t which = 0;
  if (pending_[0].node != 0) {
    const uint32_t leaf = partition_.leaf(centroid);
    // Rising by node, as they were made.
    const auto found = std::lower_bound(pending_.begin(), pending_.end(), leaf,
                                        [](const Pending& p, uint32_t n) { return p.node < n; });
    if (found == pending_.end() || found->node != leaf) return;
    which = static_cast<size_t>(found - pending_.begin());
  }
  const CellGrid& grid = partition_.grids_[pending_[which].grid];
  add_to(counts.grids[which][grid.number(grid.cell_of(centroid))], weight);
}

uint32_t PartitionBuilder::new_unit(uint64_t weight) {
  const uint64_t count = std::max<uint64_t>(1, (weight + config_.capacity - 1) / config_.capacity);
  const uint32_t first = partition_.units_;
  partition_.units_ += static_cast<uint32_t>(count);
  return first;
}

void PartitionBuilder::advance(const CellCounts& counts) {
  const std::vector<Pending> now = std::exchange(pending_, {});
  next_.clear();
  for (size_t k = 0; k < now.size(); ++k) {
    const CellGrid grid = partition_.grids_[now[k].grid];
    const Cells all{grid,
                    counts.grids[k],
                    now[k].depth,
                    {0, 0, 0},
                    {grid.resolution, grid.resolution, grid.resolution}};
    uint32_t root = now[k].node;
    if (root != 0 || now[k].grid != 0) {
      partition_.nodes_.push_back({});
      root = static_cast<uint32_t>(partition_.nodes_.size() - 1);
      partition_.nodes_[now[k].node] = {Partition::Kind::kGrid, 0, 0, now[k].grid, root};
    }
    cut(all, root, 0);
  }
  pending_ = std::move(next_);
  next_ = {};
  std::sort(pending_.begin(), pending_.end(),
            [](const Pending& a, const Pending& b) { return a.node < b.node; });
}

// A cell that has too much: a grid of its own, or units by order.
void PartitionBuilder::fill(const Cells& cells, uint32_t node) {
  const uint64_t weight = cells.counts[cells.grid.number(cells.low)];
  const CellGrid inner = cells.grid.within(cells.low, config_.inner_resolution);
  const bool has_size =
      inner.low.x < inner.high.x || inner.low.y < inner.high.y || inner.low.z < inner.high.z;
  const uint32_t first = partition_.units_;
  if (has_size && cells.depth + 1 < config_.most_grids) {
    // Until it is counted, its node is a unit without a number.
    partition_.nodes_[node] = {Partition::Kind::kUnit, 0, 0, first, 1};
    partition_.grids_.push_back(inner);
    next_.push_back({node, static_cast<uint32_t>(partition_.grids_.size() - 1), cells.depth + 1});
    return;
  }
  new_unit(weight);
  partition_.nodes_[node] = {Partition::Kind::kUnit, 0, 0, first, partition_.units_ - first};
}

void PartitionBuilder::cut(const Cells& cells, uint32_t node, uint32_t used) {
  const auto sums = cells.sums();
  uint64_t total = 0;
  for (uint64_t s : sums[0]) total += s;
  if (total <= config_.capacity) {
    const uint32_t first = new_unit(total);
    partition_.nodes_[node] = {Partition::Kind::kUnit, 0, 0, first, 1};
    return;
  }
  // Only what holds something counts.
  Cells tight = cells;
  size_t axis = 3;
  float longest = -1;
  for (size_t a = 0; a < 3; ++a) {
    uint32_t begin = 0, end = static_cast<uint32_t>(sums[a].size());
    while (sums[a][begin] == 0) ++begin;
    while (sums[a][end - 1] == 0) --end;
    tight.low[a] = cells.low[a] + begin;
    tight.high[a] = cells.low[a] + end;
    const float side = (at(cells.grid.high, a) - at(cells.grid.low, a)) *
                       static_cast<float>(end - begin) / static_cast<float>(cells.grid.resolution);
    if (end - begin > 1 && side > longest) {
      longest = side;
      axis = a;
    }
  }
  if (axis == 3) return fill(tight, node);
  const double share = (used >> axis & 1u) != 0 ? 1.0 / 2 : kFirstPlane[config_.tier % 2];
  const double wanted = share * static_cast<double>(total);
  uint64_t below = 0;
  uint32_t plane = tight.low[axis];
  // The plane whose sum comes nearest, with something on either side.
  while (true) {
    const uint64_t more = below + sums[axis][plane - cells.low[axis]];
    const bool is_last = plane + 1 >= tight.high[axis] - 1;
    const bool nearer = static_cast<double>(more) - wanted <= wanted - static_cast<double>(below);
    if (plane > tight.low[axis] && !nearer) break;
    below = more;
    ++plane;
    if (is_last || static_cast<double>(below) >= wanted) break;
  }
  const auto left = static_cast<uint32_t>(partition_.nodes_.size());
  partition_.nodes_.resize(partition_.nodes_.size() + 2);
  partition_.nodes_[node] = {Partition::Kind::kPlane, static_cast<uint32_t>(axis), plane, left,
                             left + 1};
  Cells low = tight, high = tight;
  low.high[axis] = plane;
  high.low[axis] = plane;
  cut(low, left, used | 1u << axis);
  cut(high, left + 1, used | 1u << axis);
}

CellCounts count_cells(const io::TriangleSource& source, const PointRule& rule,
                       const PartitionBuilder& builder, uint64_t begin, uint64_t end,
                       const CellPass& pass) {
  SourceMeasure* const measure = pass.measure;
  CellCounts counts = builder.empty_counts();
  io::for_each_block(source, begin, end, io::kBlockTriangles, [&](const io::TriangleBlock& block) {
    const std::vector<Vec3> points = points_of(block, rule);
    for (const Triangle& t : block.triangles)
      builder.count(counts, centroid(points[t[0]], points[t[1]], points[t[2]]), 1);
    if (pass.taken) pass.taken->add(points);
    if (!measure) return;
    MeshView view;
    view.positions = points;
    view.triangles = block.triangles;
    measure->digest += triangle_set_digest(view);
    if (measure->is_exact != 0) return;
    const RoundingLoss loss = rounding_loss(block.positions, rule.origin, points, block.triangles);
    measure->degenerate += loss.degenerate;
    measure->largest_move = std::max(measure->largest_move, loss.largest_move);
  });
  return counts;
}

Partition build_partition(const io::TriangleSource& source, const PointRule& rule, const Aabb& box,
                          const PartitionConfig& config, SourceMeasure* measure) {
  PartitionBuilder builder(box, config);
  for (; !builder.is_done(); measure = nullptr)  // once is enough
    builder.advance(count_cells(source, rule, builder, 0, source.triangles(), {measure}));
  return builder.finished();
}

}  // namespace umbel::scale
