// Clusters of meshes that change every frame, on the processor. See the headers that are included.
#include "umbel/frame_clusters.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "base/printed.hpp"
#include "base/progress.hpp"
#include "base/refuse.hpp"
#include "cluster/frame/build_frame.hpp"
#include "cluster/frame/rebuild_worst.hpp"
#include "cluster/validate.hpp"

namespace umbel {
namespace {

constexpr uint32_t kMostTriangles = (uint32_t(1) << 31) / 3;

void check_range(const char* name, uint64_t value, uint64_t least, uint64_t most) {
  if (value < least || value > most)
    refuse(std::string(name) + " must be from " + std::to_string(least) + " to " +
           std::to_string(most) + ", not " + std::to_string(value));
}

}  // namespace

cluster::CheckedFrameConfig cluster::CheckedFrameConfig::of(const FrameClusterConfig& config,
                                                            uint64_t triangles) {
  const bool is_hybrid = config.method == FrameMethod::kHybrid;
  if (!is_hybrid && config.method != FrameMethod::kMorton)
    refuse("method is " + std::to_string(static_cast<uint32_t>(config.method)) +
           ", but must be 0 (Morton) or 1 (hybrid)");
  if (triangles > kMostTriangles)
    throw Error(ErrorCode::kUnsupported, "there are " + std::to_string(triangles) +
                                             " triangles, but at most " +
                                             std::to_string(kMostTriangles) + " can be clustered");
  check_range("max_triangles", config.max_triangles, is_hybrid ? 2 : 1, kMaxMeshletTriangles);
  const uint32_t half = std::max(config.max_triangles / 2, 1u);
  if (config.min_triangles != 0) check_range("min_triangles", config.min_triangles, 1, half);
  if (config.max_vertices != 0)
    check_range("max_vertices", config.max_vertices, 3, TeamVertexTable::kMost);
  if (!(config.underfill_cost >= 0.0f && config.underfill_cost <= 4.0f))
    refuse("underfill_cost must be from 0 to 4, not " + printed(config.underfill_cost));
  if (config.code_bits != 0 && config.code_bits != 30 && config.code_bits != 63)
    refuse("code_bits must be 0, 30 or 63, not " + std::to_string(config.code_bits));
  constexpr uint64_t kManyTriangles = uint64_t(1) << 22;
  const uint32_t least =
      config.min_triangles ? config.min_triangles : std::max(config.max_triangles / 4, 1u);
  const uint32_t max = config.max_triangles;
  return {{least, max, static_cast<uint32_t>(config.underfill_cost * 16.0f),
           ((uint32_t(1) << 22) + max - 1) / max},
          config.method,
          config.max_vertices,
          config.code_bits             ? config.code_bits
          : triangles > kManyTriangles ? 63u
                                       : 30u};
}

uint32_t cluster::CheckedFrameConfig::most_clusters(uint32_t triangles) const {
  const uint32_t by_size = method == FrameMethod::kHybrid ? triangles / block.min_items + 1
                                                          : runs_of(triangles, block.max_items);
  // A cluster that ends at the vertex limit has at least a third as many triangles.
  const uint32_t by_vertices = max_vertices ? triangles / std::max(max_vertices / 3, 1u) : 0;
  return std::min(by_size + by_vertices, triangles);
}

uint32_t max_frame_clusters(uint32_t triangles, const FrameClusterConfig& config) {
  return cluster::CheckedFrameConfig::of(config, triangles).most_clusters(triangles);
}

namespace {

/// Arrays for clusters of one frame.
struct Arrays {
  CpuBuffer<uint32_t> items, offsets, count;
  CpuBuffer<Triangle> triangles;
  CpuBuffer<Aabb> boxes;
  CpuBuffer<uint64_t> at_build;

  Arrays(uint32_t size, uint32_t clusters)
      : items(size),
        offsets(size_t(clusters) + 1),
        count(1),
        triangles(size),
        boxes(clusters),
        at_build(clusters) {
    count[0] = offsets[0] = 0;
  }
  cluster::FrameClusters view() const {
    return {items.data(), triangles.data(), offsets.data(), boxes.data(), count.data()};
  }
};

}  // namespace

struct FrameClusterer::State {
  cluster::CheckedFrameConfig checked;  // first, so that what is refused is not copied
  std::vector<Triangle> source;
  size_t vertices;
  uint32_t most;
  Arrays current, next;
  CpuBuffer<uint64_t> now, total;
  bool built = false;

  State(std::span<const Triangle> triangles, size_t vertex_count, const FrameClusterConfig& config)
      : checked(cluster::CheckedFrameConfig::of(config, triangles.size())),
        source(triangles.begin(), triangles.end()),
        vertices(vertex_count),
        most(checked.most_clusters(size())),
        current(size(), most),
        next(size(), most),
        now(most),
        total(2) {
    total[0] = total[1] = 0;
  }

  uint32_t size() const { return static_cast<uint32_t>(source.size()); }
  cluster::AreaShares shares(const Arrays& of) const {
    return {now.data(), of.at_build.data(), total.data()};
  }
  static cluster::Positions strided(std::span<const Vec3> positions) {
    return {reinterpret_cast<const char*>(positions.data()), sizeof(Vec3)};
  }

  /// Runs `work` on an executor after the positions have been checked.
  template <typename Work>
  void run(std::span<const Vec3> positions, const BuildOptions& options, const Work& work) {
    if (positions.size() != vertices)
      refuse("there are " + std::to_string(positions.size()) + " positions, but the mesh has " +
             std::to_string(vertices) + " vertices");
    Progress progress(options);
    progress.report(0, "clustering");
    with_threads(options.threads, [&] {
      cluster::validate_triangles({positions, source, {}, {}, {}, {}, {}}, ClusterConfig{}, 0.0f);
      progress.report(0.1, "clustering");
      CpuExec exec;
      work(exec, strided(positions));
    });
    progress.report(1, "clustering");
  }

  void build(CpuExec& exec, const cluster::FrameMesh& mesh) {
    cluster::build_frame(exec, mesh, checked, next.view());
    std::swap(current, next);
    cluster::measure_area_growth(exec, current.view(), most, shares(current), true);
    built = true;
  }
  void refit(CpuExec& exec, const cluster::Positions& positions) {
    const cluster::FrameMesh ordered{positions, current.triangles.data(), nullptr, size()};
    exec.for_each_team(current.count[0], cluster::RefitCluster{ordered, current.view()});
    cluster::measure_area_growth(exec, current.view(), most, shares(current), false);
  }
};

FrameClusterer::FrameClusterer(std::span<const Triangle> triangles, size_t vertices,
                               const FrameClusterConfig& config)
    : state_(std::make_unique<State>(triangles, vertices, config)) {
  for (size_t i = 0; i < triangles.size(); ++i)
    for (const uint32_t v : triangles[i])
      if (v >= vertices)
        throw Error(ErrorCode::kInvalidMesh, "triangle " + std::to_string(i) + " uses vertex " +
                                                 std::to_string(v) + ", but there are only " +
                                                 std::to_string(vertices));
}
FrameClusterer::~FrameClusterer() = default;
FrameClusterer::FrameClusterer(FrameClusterer&&) noexcept = default;
FrameClusterer& FrameClusterer::operator=(FrameClusterer&&) noexcept = default;

void FrameClusterer::build(std::span<const Vec3> positions, const BuildOptions& options) {
  State& s = *state_;
  s.run(positions, options, [&](CpuExec& exec, const cluster::Positions& p) {
    s.build(exec, {p, s.source.data(), nullptr, s.size()});
  });
}

void FrameClusterer::update(std::span<const Vec3> positions, const BuildOptions& options) {
  State& s = *state_;
  if (!s.built) return build(positions, options);
  s.run(positions, options, [&](CpuExec& exec, const cluster::Positions& p) {
    s.build(exec, {p, s.current.triangles.data(), s.current.items.data(), s.size()});
  });
}

AreaGrowth FrameClusterer::refit(std::span<const Vec3> positions, const BuildOptions& options) {
  State& s = *state_;
  if (!s.built)
    build(positions, options);
  else
    s.run(positions, options,
          [&](CpuExec& exec, const cluster::Positions& p) { s.refit(exec, p); });
  return area_growth();
}

AreaGrowth FrameClusterer::rebuild_worst(std::span<const Vec3> positions, uint32_t clusters,
                                         const BuildOptions& options) {
  State& s = *state_;
  if (s.checked.max_vertices)
    refuse("with max_vertices, only all clusters together can be rebuilt");
  if (!s.built) {
    build(positions, options);
    return area_growth();
  }
  s.run(positions, options, [&](CpuExec& exec, const cluster::Positions& p) {
    s.refit(exec, p);
    cluster::rebuild_worst(exec, p, s.checked, s.current.view(), s.shares(s.current), s.size(),
                           clusters, s.next.view(), s.shares(s.next));
    std::swap(s.current, s.next);
  });
  return area_growth();
}

size_t FrameClusterer::count() const { return state_->current.count[0]; }
std::span<const uint32_t> FrameClusterer::items() const {
  return {state_->current.items.data(), state_->built ? state_->source.size() : 0};
}
std::span<const Triangle> FrameClusterer::triangles() const {
  return {state_->current.triangles.data(), state_->built ? state_->source.size() : 0};
}
std::span<const uint32_t> FrameClusterer::offsets() const {
  return {state_->current.offsets.data(), count() + 1};
}
std::span<const Aabb> FrameClusterer::boxes() const {
  return {state_->current.boxes.data(), count()};
}

AreaGrowth FrameClusterer::area_growth() const {
  const double whole = double(cluster::AreaShares::kWhole);
  return {double(state_->total[0]) / whole, double(state_->total[1]) / whole};
}

FrameVertexLists list_frame_vertices(const FrameClusterer& clusters, const BuildOptions& options) {
  const std::span<const uint32_t> offsets = clusters.offsets();
  const std::span<const Triangle> triangles = clusters.triangles();
  const auto count = static_cast<uint32_t>(clusters.count());
  for (uint32_t c = 0; c < count; ++c) {
    std::vector<uint32_t> used;
    for (uint32_t i = offsets[c]; i < offsets[c + 1]; ++i)
      used.insert(used.end(), triangles[i].begin(), triangles[i].end());
    if (used.size() <= cluster::TeamVertexTable::kMost) continue;
    std::sort(used.begin(), used.end());
    const auto distinct = std::unique(used.begin(), used.end()) - used.begin();
    if (distinct > cluster::TeamVertexTable::kMost)
      refuse("cluster " + std::to_string(c) + " has " + std::to_string(distinct) +
             " vertices, more than the 256 that a byte can count; set max_vertices");
  }
  FrameVertexLists lists;
  lists.vertex_offsets.resize(size_t(count) + 1);
  lists.vertices.resize(triangles.size() * 3);
  lists.corners.resize(triangles.size());
  with_threads(options.threads, [&] {
    CpuExec exec;
    // The lists are only read from these.
    const cluster::FrameClusters view{nullptr, const_cast<Triangle*>(triangles.data()),
                                      const_cast<uint32_t*>(offsets.data()), nullptr,
                                      const_cast<uint32_t*>(&count)};
    cluster::list_vertices(exec, view, count,
                           {lists.vertex_offsets.data(), lists.vertices.data(),
                            reinterpret_cast<uint8_t*>(lists.corners.data())});
  });
  lists.vertices.resize(lists.vertex_offsets[count]);
  return lists;
}

}  // namespace umbel
