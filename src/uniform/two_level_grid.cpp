// The two-level grid (Kalojanov, Billeter & Slusallek, "Two-Level Grids for Ray Tracing on GPUs",
// 2011): triangles are paired with the top cells that they touch and the pairs are sorted; each top
// cell then gets a grid of its own for what lies in it. Nothing depends on the number of threads.
#include <algorithm>
#include <cmath>
#include <string>

#include "base/parallel.hpp"
#include "base/printed.hpp"
#include "base/radix_sort_pairs.hpp"
#include "query/shape_kernels.hpp"
#include "uniform/build_over.hpp"
#include "uniform/ray_kernels.hpp"
#include "uniform/touched_cells.hpp"

namespace umbel {
namespace {

/// Cells so that there are about density times `count`, as near to cubes as whole numbers allow.
GridSize size_for(const Aabb& box, double count, double density) {
  std::array<double, 3> extent;
  for (uint32_t axis = 0; axis < 3; ++axis)
    extent[axis] = double(component(box.max, axis)) - double(component(box.min, axis));
  const double longest = std::max({extent[0], extent[1], extent[2]});
  GridSize size{1, 1, 1};
  if (!(longest > 0)) return size;
  double volume = 1;
  for (double& e : extent) volume *= std::max(e / longest, 1e-3);
  const double side = longest * std::cbrt(volume / (density * count));
  for (uint32_t axis = 0; axis < 3; ++axis)
    size[axis] =
        static_cast<uint8_t>(std::clamp(std::round(extent[axis] / side), 1.0, double(kMostCells)));
  return size;
}

/// The size for that density, or for less where triangles would touch too many cells in all:
/// total(frame) is to be at most `most`.
template <typename Total>
GridFrame frame_for(const Aabb& box, double count, double density, uint64_t most,
                    const Total& total) {
  while (true) {
    const GridFrame frame{box, size_for(box, count, density)};
    if (frame.count() == 1 || total(frame) <= most) return frame;
    density *= 0.5;
  }
}

/// Which triangles lie in which top cell.
struct TopLists {
  std::vector<uint32_t> offsets;  ///< of each cell
  std::vector<uint32_t> triangles;
};

class GridBuilder {
 public:
  GridBuilder(const MeshView& mesh, const uniform::GridConfig& config)
      : mesh_(mesh),
        config_(config),
        triangles_(usable_triangles(mesh, config.invalid == bvh::InvalidTriangles::kDrop)) {
    boxes_.resize(triangles_.size());
    parallel_for(triangles_.size(), 4096, [&](size_t i) { boxes_[i] = box_of(triangles_[i]); });
  }

  void build(std::span<const uint32_t> masks, GridData& data, Progress& progress) const {
    for (const Aabb& box : boxes_) extend(data.bounds, box);
    data.compact = config_.compact;
    std::vector<uint32_t> references;
    if (!triangles_.empty()) {
      data.frame = frame_for(data.bounds, double(triangles_.size()), config_.density,
                             most_of(triangles_.size(), top_share()),
                             [&](const GridFrame& frame) { return touched_at_most(frame); });
      references = fill_cells(top_lists(data.frame), data, progress);
      if (references.size() > kMaxReferences)
        throw Error(ErrorCode::kUnsupported, "a grid of " + std::to_string(references.size()) +
                                                 " references is larger than the " +
                                                 std::to_string(kMaxReferences) + " supported");
    }
    fill_store(data.cells, references, mesh_, masks, data);
  }

 private:
  static constexpr size_t kChunk = 2048;

  /// The references of a triangle that the two levels may make: together max_references.
  double top_share() const { return std::max(1.0, double(config_.max_references) / 8); }
  double inner_share() const { return std::min(double(config_.max_references), 8.0); }
  static uint64_t most_of(size_t count, double share) {
    return static_cast<uint64_t>(double(count) * share);
  }

  Aabb box_of(uint32_t triangle) const {
    Aabb box;
    for (const Vec3& corner : corners_of(mesh_, triangle)) extend(box, corner);
    return box;
  }

  uint64_t touched_at_most(const GridFrame& frame) const {
    std::vector<uint64_t> parts((boxes_.size() + kChunk - 1) / kChunk);
    parallel_chunks(boxes_.size(), kChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        parts[begin / kChunk] += block_of(frame, boxes_[i]).count();
    });
    uint64_t total = 0;
    for (const uint64_t part : parts) total += part;
    return total;
  }

  TopLists top_lists(const GridFrame& frame) const {
    struct Pair {
      uint32_t cell, triangle;
    };
    std::vector<std::vector<Pair>> parts((triangles_.size() + kChunk - 1) / kChunk);
    parallel_chunks(triangles_.size(), kChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        for_touched_cells(frame, block_of(frame, boxes_[i]), corners_of(mesh_, triangles_[i]),
                          [&](uint32_t x, uint32_t y, uint32_t z) {
                            parts[begin / kChunk].push_back({frame.index(x, y, z), triangles_[i]});
                          });
    });
    std::vector<size_t> begins{0};
    for (const auto& part : parts) begins.push_back(begins.back() + part.size());
    const size_t count = begins.back();
    TopLists lists;
    std::vector<uint32_t> cells(count);
    lists.triangles.resize(count);
    parallel_for(parts.size(), 1, [&](size_t k) {
      for (size_t i = 0; i < parts[k].size(); ++i) {
        cells[begins[k] + i] = parts[k][i].cell;
        lists.triangles[begins[k] + i] = parts[k][i].triangle;
      }
    });
    const CpuBuffer<KeyAndValue<uint32_t>> spare(count);
    radix_sort_pairs(count, cells.data(), lists.triangles.data(), 0, 24, spare.data());
    lists.offsets.resize(frame.count() + 1);
    for (const uint32_t cell : cells) ++lists.offsets[cell + 1];
    for (size_t i = 1; i < lists.offsets.size(); ++i) lists.offsets[i] += lists.offsets[i - 1];
    return lists;
  }

  /// What one task makes of some top cells; leaves are numbered from 0.
  struct Part {
    std::vector<Range> cells;
    std::vector<uint32_t> references;
  };

  /// Makes all grids of top cells; the references of their leaves.
  std::vector<uint32_t> fill_cells(const TopLists& lists, GridData& data,
                                   Progress& progress) const {
    constexpr size_t kTops = 64;
    const size_t count = data.frame.count();
    data.tops.resize(count);
    std::vector<Part> parts((count + kTops - 1) / kTops);
    SharedProgress shared = node_progress(progress, lists.triangles.size());
    parallel_chunks(count, kTops, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        fill_top(data.frame, i, lists, data.tops[i], parts[begin / kTops]);
      shared.add(lists.offsets[end] - lists.offsets[begin]);
    });
    std::vector<uint32_t> references;
    for (size_t k = 0; k < parts.size(); ++k) {
      const auto first_cell = static_cast<uint32_t>(data.cells.size());
      const auto first = static_cast<uint32_t>(references.size());
      for (size_t i = k * kTops; i < std::min(count, (k + 1) * kTops); ++i)
        data.tops[i].first += first_cell;
      for (const Range& cell : parts[k].cells)
        data.cells.push_back({cell.count == 0 ? 0 : first + cell.offset, cell.count});
      references.insert(references.end(), parts[k].references.begin(), parts[k].references.end());
    }
    return references;
  }

  void fill_top(const GridFrame& frame, size_t index, const TopLists& lists, TopCell& top,
                Part& part) const {
    const auto x = static_cast<uint32_t>(index % frame.size[0]),
               y = static_cast<uint32_t>(index / frame.size[0] % frame.size[1]),
               z = static_cast<uint32_t>(index / frame.size[0] / frame.size[1]);
    const std::span<const uint32_t> here(lists.triangles.data() + lists.offsets[index],
                                         lists.offsets[index + 1] - lists.offsets[index]);
    const Aabb cell = frame.cell(x, y, z);
    const auto blocks_in = [&](const GridFrame& inner) {
      uint64_t total = 0;
      for (const uint32_t triangle : here) total += block_of(inner, box_of(triangle)).count();
      return total;
    };
    const GridFrame inner = frame_for(cell, double(here.size()), config_.leaf_density,
                                      most_of(here.size(), inner_share()), blocks_in);
    top.first = static_cast<uint32_t>(part.cells.size());
    top.size = inner.size;
    std::vector<uint32_t> counts(inner.count() + 1);
    const auto for_pairs = [&](const auto& visit) {
      for (const uint32_t triangle : here)
        for_touched_cells(
            inner, block_of(inner, box_of(triangle)), corners_of(mesh_, triangle),
            [&](uint32_t a, uint32_t b, uint32_t c) { visit(inner.index(a, b, c), triangle); });
    };
    for_pairs([&](uint32_t at, uint32_t) { ++counts[at + 1]; });
    auto first = static_cast<uint32_t>(part.references.size());
    for (size_t i = 1; i < counts.size(); ++i) {
      part.cells.push_back({first + counts[i - 1], counts[i]});
      counts[i] += counts[i - 1];
    }
    part.references.resize(first + counts.back());
    for_pairs(
        [&](uint32_t at, uint32_t triangle) { part.references[first + counts[at]++] = triangle; });
  }

  const MeshView& mesh_;
  const uniform::GridConfig& config_;
  std::vector<uint32_t> triangles_;
  std::vector<Aabb> boxes_;
};

void check_config(const uniform::GridConfig& c) {
  const auto check = [](const char* name, float value, float low, float high) {
    if (!(value >= low && value <= high))
      throw Error(ErrorCode::kInvalidArgument, std::string(name) + " is " + printed(value) +
                                                   ", but must be from " + printed(low) + " to " +
                                                   printed(high));
  };
  check("density", c.density, 0.001f, 16);
  check("leaf_density", c.leaf_density, 0.001f, 16);
  check("max_references", c.max_references, 1, 64);
}

void build_grid(const MeshView& mesh, const uniform::GridConfig& config,
                std::span<const uint32_t> masks, GridData& data, Progress& progress) {
  GridBuilder(mesh, config).build(masks, data, progress);
}

}  // namespace

uniform::Statistics measure(const GridData& data, const bvh::CostModel& cost) {
  uniform::Statistics s{};
  s.bytes =
      data.tops.size() * sizeof(TopCell) + data.cells.size() * sizeof(Range) + data.leaf_bytes();
  if (data.cells.empty()) return s;
  s.nodes = static_cast<uint32_t>(data.tops.size() + data.cells.size());
  s.leaves = static_cast<uint32_t>(data.cells.size());
  s.max_depth = 2;
  const double whole = cell_area(data.bounds);
  const auto share = [&](const Aabb& cell) { return whole > 0 ? cell_area(cell) / whole : 1; };
  const GridSize& size = data.frame.size;
  for (uint32_t z = 0; z < size[2]; ++z)
    for (uint32_t y = 0; y < size[1]; ++y)
      for (uint32_t x = 0; x < size[0]; ++x) {
        const TopCell& top = data.tops[data.frame.index(x, y, z)];
        const GridFrame inner = data.inner({x, y, z});
        s.inner_visits += share(inner.box);
        // Cells of one grid are alike, up to rounding.
        const double each = share(inner.cell(0, 0, 0));
        for (uint32_t i = 0; i < inner.count(); ++i) {
          const uint32_t count = data.cells[top.first + i].count;
          s.references += count;
          s.empty_leaves += count == 0;
          s.leaf_visits += each;
          s.tests += each * count;
        }
      }
  s.sah_cost = double(cost.traversal) * (s.inner_visits + s.leaf_visits) +
               double(cost.intersection) * s.tests;
  return s;
}

void prepare(GridData& data, Simd simd) {
  data.frame.box = data.bounds;
  set_queries(data, simd, portable_grid_kernels(), avx2_grid_kernels(),
              &shape_kernels_of<GridNodes>);
}

namespace uniform {

TwoLevelGrid::TwoLevelGrid() : UniformStructure(store_without_triangles<GridData>()) {}

TwoLevelGrid TwoLevelGrid::build(const MeshView& mesh, const GridConfig& config,
                                 std::span<const uint32_t> masks, const BuildOptions& options) {
  check_config(config);
  TwoLevelGrid result;
  result.store_ = build_over<GridData>(mesh, config, masks, options, build_grid);
  return result;
}

}  // namespace uniform
}  // namespace umbel
