// Spatial clusters by recursive axis-aligned bisection: every node is split at the cheapest legal
// position of three axes, by the surface area heuristic (Goldsmith and Salmon, "Automatic
// creation of object hierarchies for ray tracing", 1987) with penalties for clusters that are not
// full, for overlap, and for connections between the sides (ratio cut). The legal positions and
// penalties are those of nv_cluster_builder's published description
// (https://github.com/nvpro-samples/nv_cluster_builder).
#include "cluster/bisect/bisect.hpp"

#include <tbb/enumerable_thread_specific.h>

#include <functional>
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

// Writes a part's items to their segment, and their boxes to `boxes`.
void load(const Segment& segment, const CellSet& set, const Part& part, Box4* boxes) {
  uint32_t* to = segment.items;
  for (const Cell& cell : part.cells)
    for (uint32_t i = 0; i < cell.count; ++i) *to++ = set.order[cell.begin + i];
  const uint32_t* items = segment.items;
  const uint32_t last = part.count - 1;
  for (uint32_t i = 0; i < part.count; ++i) {
    segment.source.prefetch(items[std::min(i + 24, last)]);
    segment.source.prefetch_box(items[std::min(i + 8, last)]);
    boxes[i] = record_of(segment.source, items[i], set.scale).tagged(items[i]);
  }
}

// What depends on more than boxes does not suit micro-clusters.
bool suits_micro_clusters(const Segment& segment) {
  const Source& source = segment.source;
  const SplitConstraints& constraints = segment.constraints;
  const ClusterConfig& config = constraints.config;
  return config.coarse && constraints.simple && config.max_items >= 16 && !config.max_vertices &&
         config.overlap_cost == 0.0f && !config.presplit_threshold &&
         source.connections.ranges.empty() && source.shared_vertex_weight == 0.0f &&
         source.centroids.empty() && segment.count > kMicroClustersFrom;
}

// What a bisection needs beside its segment.
struct Resources {
  std::function<Block&()> block;  // this thread's
  std::function<void(uint32_t count)> done = [](uint32_t) {};
  /// As soon as items are in cluster order.
  std::function<void(uint32_t offset, uint32_t count)> visit = [](uint32_t, uint32_t) {};
  bool alone = false;  // no other segment keeps threads busy
};

// By the items themselves: in a block, or in parts of a block's size.
void bisect_items(const Segment& segment, const Box4* bounds, const Resources& resources) {
  const Source& source = segment.source;
  const uint32_t most = block_size(source, segment.constraints);
  if (segment.count <= most) {
    if (resources.alone && is_connected(source))
      resources.block().bisect_in_parallel(segment);
    else
      resources.block().bisect(segment);
    resources.visit(0, segment.count);
    return resources.done(segment.count);
  }
  split_cells(segment, most, bounds, [&](const CellSet& set, const Part& part) {
    Block& block = resources.block();
    const Segment own = segment.part(part.offset, part.count);
    load(own, set, part, block.prepare(part.count));
    block.bisect_prepared(own);
    resources.visit(part.offset, part.count);
    resources.done(part.count);
  });
}

// `bounds` holds all items, or is null.
void bisect_segment(const Segment& segment, const Box4* bounds, const Resources& resources) {
  if (!suits_micro_clusters(segment)) return bisect_items(segment, bounds, resources);
  const Box4 box = bounds ? *bounds : box_of(segment.source, segment.items, segment.count);
  if (!suits_short_boxes(box)) return bisect_items(segment, bounds, resources);
  const auto exact = [&](uint32_t offset, uint32_t count) {
    bisect_items(segment.part(offset, count), nullptr, {.block = resources.block});
  };
  bisect_micro_clusters(segment, box, exact, resources.done);
  resources.visit(0, segment.count);
}

Clusters build(const Source& source, uint32_t count, std::span<const Range> input_segments,
               const ClusterConfig& config, const BuildOptions& options, const Box4* bounds,
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
    const auto visit_items = [&](uint32_t offset, uint32_t items) {
      const uint32_t begin = r.offset + offset;
      if (visit)
        visit(begin, std::span(out.items).subspan(begin, items),
              std::span(first).subspan(begin, items));
    };
    bisect_segment(
        {source, constraints, out.items.data() + r.offset, first.data() + r.offset, r.count},
        r.count == count ? bounds : nullptr,
        {.block = [&]() -> Block& { return blocks.local(); },
         .done = [&](uint32_t items) { clustered.add(items); },
         .visit = visit_items,
         .alone = segments.size() == 1});
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
      bisect_segment({source, constraints, out.items.data() + r.offset,
                      scratch_->first.data() + r.offset, r.count},
                     nullptr, {.block = [&]() -> Block& { return scratch_->block; }});
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
    const Box4 bounds = validate_triangles(mesh, config, shared_vertex_weight);
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
