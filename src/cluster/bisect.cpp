// Spatial clusters by recursive axis-aligned bisection: every node is split at the cheapest legal
// position of three axes, by the surface area heuristic (Goldsmith and Salmon, "Automatic
// creation of object hierarchies for ray tracing", 1987) with prices on clusters that are not
// full, on overlap, and on cut connections (ratio cut). The legal positions and prices are those
// of nv_cluster_builder's published description.
#include "cluster/bisect.hpp"

#include <atomic>
#include <numeric>
#include <thread>

#include <tbb/enumerable_thread_specific.h>

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "cluster/block.hpp"
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

// Tells the caller how far we are. Only the thread that called may call back.
class Meter {
 public:
  Meter(const BuildOptions& options, uint32_t total) : progress_(options), total_(total) {}
  void add(uint32_t items) {
    const uint64_t done = done_.fetch_add(items, std::memory_order_relaxed) + items;
    if (std::this_thread::get_id() == caller_)
      progress_.report(double(done) / double(std::max(total_, 1u)), kStage);
  }
  void report(double fraction) { progress_.report(fraction, kStage); }

 private:
  static constexpr std::string_view kStage = "clustering";
  Progress progress_;
  const uint32_t total_;
  const std::thread::id caller_ = std::this_thread::get_id();
  std::atomic<uint64_t> done_{0};
};

Clusters build(const Source& source, uint32_t count, std::span<const Range> input_segments,
               const ClusterConfig& config, const BuildOptions& options) {
  const Rules rules(config);
  const std::vector<Range> segments = segments_of(input_segments, count);
  Clusters out;
  out.items.resize(count);
  std::iota(out.items.begin(), out.items.end(), 0u);
  std::vector<uint8_t> first(count, 0);
  Meter meter(options, count);
  meter.report(0);
  tbb::enumerable_thread_specific<Block> blocks;
  with_threads(options.threads, [&] {
    parallel_for(segments.size(), 1, [&](size_t s) {
      const Range& r = segments[s];
      blocks.local().bisect(source, rules, out.items.data() + r.offset, first.data() + r.offset,
                            r.count);
      meter.add(r.count);
    });
  });
  collect(segments, first, out);
  meter.report(1);
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
  const Rules rules(config);
  const Source source = Source::of(input);
  const Range whole{0, count};
  std::span<const Range> segments = input.segments;
  if (segments.empty() && count) segments = {&whole, 1};
  out.items.resize(count);
  std::iota(out.items.begin(), out.items.end(), 0u);
  scratch_->first.assign(count, 0);
  for (const Range& r : segments)
    scratch_->block.bisect(source, rules, out.items.data() + r.offset,
                           scratch_->first.data() + r.offset, r.count);
  collect(segments, scratch_->first, out);
}

}  // namespace cluster

Clusters build_clusters(const ClusterInput& input, const ClusterConfig& config,
                        const BuildOptions& options) {
  cluster::validate_config(config);
  cluster::validate_layout(input, config);
  with_threads(options.threads, [&] {
    parallel_chunks(input.boxes.size(), 1 << 16, [&](size_t begin, size_t end) {
      cluster::validate_boxes(input, begin, end);
    });
  });
  return cluster::build(cluster::Source::of(input), static_cast<uint32_t>(input.boxes.size()),
                        input.segments, config, options);
}

Clusters cluster_mesh(const MeshView& mesh, const ClusterConfig& config,
                      float shared_vertex_weight, const BuildOptions& options) {
  cluster::validate_config(config);
  cluster::validate_triangles(mesh, config, shared_vertex_weight, options);
  return cluster::build(cluster::Source::of(mesh, shared_vertex_weight),
                        static_cast<uint32_t>(mesh.triangles.size()), {}, config, options);
}

}  // namespace umbel
