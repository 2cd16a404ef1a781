#include "scale/route.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdio>
#include <span>
#include <utility>

#include "base/parallel.hpp"
#include "mesh/vertex_bits.hpp"
#include "scale/route_file.hpp"
#include "scale/vertex_rows.hpp"

namespace umbel::scale {
namespace {

using PositionBits = std::array<uint32_t, 3>;

void sort_unique(std::vector<Vec3>& points) {
  const auto less = [](const Vec3& a, const Vec3& b) {
    return std::bit_cast<PositionBits>(a) < std::bit_cast<PositionBits>(b);
  };
  std::sort(points.begin(), points.end(), less);
  points.erase(std::unique(points.begin(), points.end(),
                           [](const Vec3& a, const Vec3& b) { return same_value(a, b); }),
               points.end());
}

/// What a stretch of the source holds for each unit, until it is written.
class Router {
 public:
  Router(const Partition& partition, const RouteConfig& config, const io::SourceStreams& streams,
         SharedLeafCounts before)
      : partition_(partition),
        config_(config),
        streams_(streams),
        counts_(std::move(before)),
        slices_(partition.units()) {}

  void add(const io::TriangleBlock& block) {
    const std::vector<Vec3> points = points_of(block, config_.rule);
    const VertexRows rows(block, points, streams_);
    std::vector<uint32_t> homes(points.size());
    parallel_for(points.size(), 1 << 14, [&](size_t v) { homes[v] = partition_.home(points[v]); });
    const std::vector<uint32_t> units = units_of(block, points);
    // By unit, in order within each.
    std::vector<uint32_t> order(units.size());
    std::vector<uint32_t> begin(partition_.units() + 1, 0);
    for (uint32_t u : units) ++begin[u + 1];
    for (size_t u = 0; u + 1 < begin.size(); ++u) begin[u + 1] += begin[u];
    std::vector<uint32_t> at(begin.begin(), begin.end() - 1);
    for (uint32_t t = 0; t < units.size(); ++t) order[at[units[t]]++] = t;
    number_.assign(points.size(), kNone);
    for (uint32_t u = 0; u + 1 < begin.size(); ++u)
      append(block, rows, points, homes, u,
             std::span<const uint32_t>(order).subspan(begin[u], begin[u + 1] - begin[u]));
  }

  void write(const std::filesystem::path& path) {
    RouteWriter writer(path, VertexRows::floats(streams_), streams_.materials);
    for (uint32_t u = 0; u < slices_.size(); ++u) {
      RouteSlice& slice = slices_[u];
      sort_unique(slice.mail);
      if (!slice.triangles.empty() || !slice.mail.empty()) writer.add(u, slice);
      slice = {};
    }
    writer.commit();
  }

 private:
  std::vector<uint32_t> units_of(const io::TriangleBlock& block, const std::vector<Vec3>& points) {
    std::vector<uint32_t> leaves(block.triangles.size());
    parallel_for(leaves.size(), 1 << 14, [&](size_t t) {
      const Triangle& c = block.triangles[t];
      leaves[t] = partition_.leaf(centroid(points[c[0]], points[c[1]], points[c[2]]));
    });
    for (uint32_t& leaf : leaves) {
      uint32_t unit = partition_.first_unit(leaf);
      const uint32_t count = partition_.unit_count(leaf);
      if (count > 1) {
        const uint64_t share = counts_[leaf]++ / config_.capacity;
        unit += static_cast<uint32_t>(std::min<uint64_t>(share, count - 1));
      }
      leaf = unit;
    }
    return leaves;
  }

  void append(const io::TriangleBlock& block, const VertexRows& rows,
              const std::vector<Vec3>& points, const std::vector<uint32_t>& homes, uint32_t unit,
              std::span<const uint32_t> triangles) {
    RouteSlice& slice = slices_[unit];
    const uint32_t floats = VertexRows::floats(streams_);
    used_.clear();
    for (uint32_t t : triangles) {
      Triangle corners{};
      for (size_t k = 0; k < 3; ++k) {
        const uint32_t v = block.triangles[t][k];
        if (number_[v] == kNone) {
          number_[v] = static_cast<uint32_t>(slice.vertices.size() / floats);
          used_.push_back(v);
          rows.append(v, slice.vertices);
          if (homes[v] != unit) slices_[homes[v]].mail.push_back(points[v]);
        }
        corners[k] = number_[v];
      }
      slice.triangles.push_back(corners);
      if (!block.materials.empty()) slice.materials.push_back(block.materials[t]);
    }
    for (uint32_t v : used_) number_[v] = kNone;
  }

  const Partition& partition_;
  const RouteConfig& config_;
  io::SourceStreams streams_;
  SharedLeafCounts counts_;
  std::vector<RouteSlice> slices_;
  std::vector<uint32_t> number_, used_;
};

}  // namespace

SharedLeafCounts count_shared_leaves(const io::TriangleSource& source, const PointRule& rule,
                                     const Partition& partition, uint64_t begin, uint64_t end) {
  SharedLeafCounts counts;
  if (partition.shared_leaves() == 0) return counts;
  io::for_each_block(source, begin, end, io::kBlockTriangles, [&](const io::TriangleBlock& block) {
    const std::vector<Vec3> points = points_of(block, rule);
    for (const Triangle& t : block.triangles) {
      const uint32_t leaf = partition.leaf(centroid(points[t[0]], points[t[1]], points[t[2]]));
      if (partition.unit_count(leaf) > 1) ++counts[leaf];
    }
  });
  return counts;
}

void route_shard(const io::TriangleSource& source, const Partition& partition,
                 const RouteConfig& config, const SharedLeafCounts& before, uint64_t begin,
                 uint64_t end, const std::filesystem::path& path) {
  Router router(partition, config, source.streams(), before);
  io::for_each_block(source, begin, end, io::kBlockTriangles,
                     [&](const io::TriangleBlock& block) { router.add(block); });
  router.write(path);
}

std::vector<std::filesystem::path> route(const io::TriangleSource& source,
                                         const Partition& partition, const RouteConfig& config,
                                         const std::filesystem::path& folder, uint64_t shard) {
  std::vector<std::filesystem::path> files;
  SharedLeafCounts before;
  for (uint64_t begin = 0; begin < source.triangles(); begin += shard) {
    const uint64_t end = std::min(begin + shard, source.triangles());
    std::array<char, 32> name;
    std::snprintf(name.data(), name.size(), "s%06zu.route", files.size());
    files.push_back(folder / name.data());
    route_shard(source, partition, config, before, begin, end, files.back());
    for (const auto& [leaf, count] :
         count_shared_leaves(source, config.rule, partition, begin, end))
      before[leaf] += count;
  }
  return files;
}

UnitInput read_unit(const std::vector<std::filesystem::path>& files, const Partition& partition,
                    const io::SourceStreams& streams, const Aabb& box, uint32_t unit) {
  Mesh mesh;
  mesh.extras = streams.extras;
  std::vector<Vec3> mail;
  for (const auto& path : files) {
    const RouteFile file(path);
    if (file.floats() != VertexRows::floats(streams) || file.has_materials() != streams.materials)
      throw Error(ErrorCode::kCorrupt, path.string() + " has other streams than its source");
    const RouteSlice slice = file.read(unit);
    const auto base = static_cast<uint32_t>(mesh.positions.size());
    VertexRows::split(slice.vertices, streams, mesh);
    for (const Triangle& t : slice.triangles)
      mesh.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
    mesh.materials.insert(mesh.materials.end(), slice.materials.begin(), slice.materials.end());
    mail.insert(mail.end(), slice.mail.begin(), slice.mail.end());
  }
  sort_unique(mail);
  UnitInput input;
  input.mesh = weld(mesh.view());
  input.box = box;
  input.frozen.resize(input.mesh.positions.size());
  parallel_for(input.frozen.size(), 1 << 14, [&](size_t v) {
    const Vec3& p = input.mesh.positions[v];
    const bool mailed =
        std::binary_search(mail.begin(), mail.end(), p, [](const Vec3& a, const Vec3& b) {
          return std::bit_cast<PositionBits>(a) < std::bit_cast<PositionBits>(b);
        });
    input.frozen[v] = mailed || partition.home(p) != unit ? 1 : 0;
  });
  return input;
}

}  // namespace umbel::scale
