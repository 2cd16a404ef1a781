// Spatial clusters by recursive axis-aligned bisection: every node is split at the cheapest legal
// position of three axes, by the surface area heuristic (Goldsmith and Salmon, "Automatic
// creation of object hierarchies for ray tracing", 1987) with prices on clusters that are not
// full, on overlap, and on cut connections (ratio cut). The legal positions and prices are those
// of nv_cluster_builder's published description.
#include "cluster/bisect/bisect.hpp"

#include <tbb/enumerable_thread_specific.h>

#include <numeric>

#include "base/big_vector.hpp"
#include "base/parallel.hpp"
#include "base/shared_progress.hpp"
#include "cluster/bisect/bisect_micro_clusters.hpp"
#include "cluster/bisect/block.hpp"
#include "cluster/bisect/split_cells.hpp"
#include "cluster/validate.hpp"

namespace umbel {
namespace cluster {
namespace {

std::vector<Range> segments_of(std::span<const Range> segments, uint32_t count) {
  if (!segments.empty()) return {segments.begin(), segments.end()};
  if (count == 0) return {};
  return {Range{0, count}};
}

// `first` marks where clusters start; the items of each segment are already in cluster order.
void collect(std::span<const Range> segments, const std::vector<uint8_t>& first, Clusters& out) {
  out.ranges.clear();
  out.segments.clear();
  for (const Range& segment : segments) {
    const uint32_t start = static_cast<uint32_t>(out.ranges.size());
    for (uint32_t i = segment.offset; i < segment.offset + segment.count; ++i) {
      if (first[i]) out.ranges.push_back({i, 0});
      ++out.ranges.back().count;
    }
    out.segments.push_back({start, static_cast<uint32_t>(out.ranges.size()) - start});
  }
}

constexpr std::string_view kStage = "clustering";

// Above this, nodes are split by runs of items; below, by the items themselves, in a cache.
constexpr uint32_t kBlock = 1 << 12;
// Connections between items have no meaning between runs, so blocks are larger where there are any.
constexpr uint32_t kConnectedBlock = 1 << 16;

// Fewer items than this are not worth micro-clusters.
constexpr uint32_t kMicroClustersFrom = 1 << 10;

bool is_connected(const Source& source) {
  return !source.connections.ranges.empty() || source.shared_vertex_weight > 0;
}

uint32_t block_size(const Source& source, const SplitConstraints& constraints) {
  // A part must be no smaller than one cluster.
  return std::max(is_connected(source) ? kConnectedBlock : kBlock, constraints.config.max_items);
}

// Puts a part's items in place, and their boxes into `boxes`.
void load(const Source& source, const CellSet& set, const Part& part, uint32_t* items,
          BoxRecord* boxes) {
  uint32_t* to = items;
  for (const Cell& cell : part.cells)
    for (uint32_t i = 0; i < cell.count; ++i) *to++ = set.order[cell.begin + i];
  const uint32_t last = part.count - 1;
  for (uint32_t i = 0; i < part.count; ++i) {
    source.prefetch(items[std::min(i + 24, last)]);
    source.prefetch_box(items[std::min(i + 8, last)]);
    boxes[i] = record_of(source, items[i], set.scale).tagged(items[i]);
  }
}

// What has to be looked at item by item does not suit micro-clusters.
bool suits_micro_clusters(const Source& source, const SplitConstraints& constraints,
                          uint32_t count) {
  const ClusterConfig& config = constraints.config;
  return config.coarse && constraints.simple && config.max_items >= 16 && !config.max_vertices &&
         config.overlap_cost == 0.0f && !config.presplit_threshold &&
         source.connections.ranges.empty() && source.shared_vertex_weight == 0.0f &&
         source.centroids.empty() && count > kMicroClustersFrom;
}

// Calls visit(offset, count) as soon as that many items are in the order of clusters. `alone`: no
// other segment keeps threads busy.
template <typename LocalBlock>
void bisect_segment(const Source& source, const SplitConstraints& constraints, uint32_t* items,
                    uint8_t* first, uint32_t count, const BoxRecord* bounds,
                    const LocalBlock& local, bool alone, const std::function<void(uint32_t)>& done,
                    const std::function<void(uint32_t, uint32_t)>& visit,
                    bool by_micro_clusters = true) {
  if (by_micro_clusters && suits_micro_clusters(source, constraints, count)) {
    const BoxRecord box = bounds ? *bounds : box_of(source, items, count);
    if (suits_small_boxes(box)) {
      const auto exact = [&](uint32_t offset, uint32_t n) {
        bisect_segment(
            source, constraints, items + offset, first + offset, n, nullptr, local, false,
            [](uint32_t) {}, [](uint32_t, uint32_t) {}, false);
      };
      bisect_micro_clusters(source, constraints, items, first, count, box, exact, done);
      return visit(0, count);
    }
  }
  const uint32_t most = block_size(source, constraints);
  if (count <= most) {
    if (alone && is_connected(source))
      local().bisect_in_parallel(source, constraints, items, first, count);
    else
      local().bisect(source, constraints, items, first, count);
    visit(0, count);
    return done(count);
  }
  split_cells(source, constraints, items, count, most, bounds,
              [&](const CellSet& set, const Part& part) {
                Block& block = local();
                uint32_t* own = items + part.offset;
                load(source, set, part, own, block.prepare(source, constraints, part.count));
                block.bisect_prepared(own, first + part.offset);
                visit(part.offset, part.count);
                done(part.count);
              });
}

Clusters build(const Source& source, uint32_t count, std::span<const Range> input_segments,
               const ClusterConfig& config, const BuildOptions& options, const BoxRecord* bounds,
               const VisitClusters& visit = nullptr) {
  const SplitConstraints constraints(config);
  const std::vector<Range> segments = segments_of(input_segments, count);
  Clusters out;
  reserve_big(out.items, count);
  out.items.resize(count);
  std::iota(out.items.begin(), out.items.end(), 0u);
  std::vector<uint8_t> first(count, 0);
  Progress progress(options);
  progress.report(0, kStage);
  SharedProgress clustered(progress, kStage, 0, 1, count, SharedProgress::OnCancel::kThrow);
  tbb::enumerable_thread_specific<Block> blocks;
  parallel_for(segments.size(), 1, [&](size_t s) {
    const Range& r = segments[s];
    bisect_segment(
        source, constraints, out.items.data() + r.offset, first.data() + r.offset, r.count,
        r.count == count ? bounds : nullptr, [&]() -> Block& { return blocks.local(); },
        segments.size() == 1, [&](uint32_t items) { clustered.add(items); },
        [&](uint32_t offset, uint32_t items) {
          const uint32_t begin = r.offset + offset;
          if (visit)
            visit(begin, std::span(out.items).subspan(begin, items),
                  std::span(first).subspan(begin, items));
        });
  });
  collect(segments, first, out);
  progress.report(1, kStage);
  return out;
}

}  // namespace

struct Bisector::Scratch {
  Block block;
  std::vector<uint8_t> first;
};

Bisector::Bisector() : scratch_(std::make_unique<Scratch>()) {}
Bisector::~Bisector() = default;
Bisector::Bisector(Bisector&&) noexcept = default;
Bisector& Bisector::operator=(Bisector&&) noexcept = default;

void Bisector::build(const ClusterInput& input, const ClusterConfig& config, Clusters& out) {
  validate_config(config);
  validate_layout(input, config);
  const uint32_t count = static_cast<uint32_t>(input.boxes.size());
  validate_boxes(input, 0, count);
  build(Source::of(input), count, input.segments, config, out);
}

void Bisector::build(const MeshView& mesh, std::span<const Range> segments,
                     const ClusterConfig& config, Clusters& out) {
  validate_config(config);
  build(Source::of(mesh, 0.0f), static_cast<uint32_t>(mesh.triangles.size()), segments, config,
        out);
}

void Bisector::build(const Source& source, uint32_t count, std::span<const Range> segments,
                     const ClusterConfig& config, Clusters& out) {
  const SplitConstraints constraints(config);
  const Range whole{0, count};
  if (segments.empty() && count) segments = {&whole, 1};
  out.items.resize(count);
  std::iota(out.items.begin(), out.items.end(), 0u);
  scratch_->first.assign(count, 0);
  const auto bisect = [&] {
    for (const Range& r : segments)
      bisect_segment(
          source, constraints, out.items.data() + r.offset, scratch_->first.data() + r.offset,
          r.count, nullptr, [&]() -> Block& { return scratch_->block; }, false, [](uint32_t) {},
          [](uint32_t, uint32_t) {});
  };
  bool large = false;
  for (const Range& r : segments) large |= r.count > block_size(source, constraints);
  if (large) {
    with_threads(1, bisect);  // the splits of large nodes would otherwise go to other threads
  } else {
    bisect();
  }
  collect(segments, scratch_->first, out);
}

Clusters cluster_triangles(const MeshView& mesh, std::span<const Range> segments,
                           const ClusterConfig& config, float shared_vertex_weight,
                           const BuildOptions& options, const VisitClusters& visit) {
  validate_config(config);
  Clusters clusters;
  with_threads(options.threads, [&] {
    const BoxRecord bounds = validate_triangles(mesh, config, shared_vertex_weight);
    clusters = cluster::build(Source::of(mesh, shared_vertex_weight),
                              static_cast<uint32_t>(mesh.triangles.size()), segments, config,
                              options, &bounds, visit);
  });
  return clusters;
}

}  // namespace cluster

Clusters build_clusters(const ClusterInput& input, const ClusterConfig& config,
                        const BuildOptions& options) {
  cluster::validate_config(config);
  cluster::validate_layout(input, config);
  Clusters clusters;
  with_threads(options.threads, [&] {
    cluster::validate_all_boxes(input);
    clusters = cluster::build(cluster::Source::of(input), static_cast<uint32_t>(input.boxes.size()),
                              input.segments, config, options, nullptr);
  });
  return clusters;
}

Clusters cluster_mesh(const MeshView& mesh, const ClusterConfig& config, float shared_vertex_weight,
                      const BuildOptions& options) {
  return cluster::cluster_triangles(mesh, {}, config, shared_vertex_weight, options);
}

}  // namespace umbel
