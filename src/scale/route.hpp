// The third pass: every triangle to its unit, and mail to the homes of its vertices.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <vector>

#include "io/source/triangle_source.hpp"
#include "scale/partition.hpp"
#include "scale/point_rule.hpp"
#include "scale/unit_input.hpp"

namespace umbel::scale {

/// Triangles of a stretch of the source that is routed at once: what is held in memory.
inline constexpr uint64_t kShardTriangles = uint64_t{2} << 20;

/// Triangles in leaves that several units share, by leaf: which of them gets a triangle depends on
/// how many stand before it in the source.
using SharedLeafCounts = std::map<uint32_t, uint64_t>;

/// Of the triangles [begin, end). Empty where no leaf is shared, without reading anything.
SharedLeafCounts count_shared_leaves(const io::TriangleSource& source, const PointRule& rule,
                                     const Partition& partition, uint64_t begin, uint64_t end);

struct RouteConfig {
  PointRule rule;
  uint64_t capacity = uint64_t{4} << 20;  ///< as the partition was made with
};

/// Writes what the triangles [begin, end) are for all units to one file. `before`: how many
/// triangles of shared leaves stand before `begin`.
void route_shard(const io::TriangleSource& source, const Partition& partition,
                 const RouteConfig& config, const SharedLeafCounts& before, uint64_t begin,
                 uint64_t end, const std::filesystem::path& path);

/// Routes a whole source, a file for every `shard` triangles, and gives the files in order.
std::vector<std::filesystem::path> route(const io::TriangleSource& source,
                                         const Partition& partition, const RouteConfig& config,
                                         const std::filesystem::path& folder,
                                         uint64_t shard = kShardTriangles);

/// One unit, of all files in the order of the source. It does not depend on how the source was
/// taken apart. `box` is around all triangles; `streams` are the source's.
UnitInput read_unit(const std::vector<std::filesystem::path>& files, const Partition& partition,
                    const io::SourceStreams& streams, const Aabb& box, uint32_t unit);

}  // namespace umbel::scale
