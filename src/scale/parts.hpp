// Files of parts: the groups that a unit has finished, in blocks that can be read one by one. A
// summary of them is in a file of its own, since that is all the driver of many machines reads.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "asset/codec/choose_format.hpp"
#include "lod/build/group_sink.hpp"
#include "lod/build/unit.hpp"
#include "scale/exits.hpp"
#include "scale/work_file.hpp"

namespace umbel::scale {

/// A group, without its clusters.
struct FinishedGroup {
  uint32_t clusters, level;
  lod::SimplifyMethod method;
  lod::LimitingFactor limiting_factor;
  Sphere sphere;
  float error;
};

/// Without its range of clusters; `level` as the units count.
inline lod::Group group_of(const FinishedGroup& group) {
  return {{}, group.level, group.method, group.sphere, group.error};
}

/// What is known of all of a unit's groups; of what is one value, an array of one.
struct PartsSummary {
  std::vector<FinishedGroup> groups;  ///< rising by level
  std::vector<uint32_t> blocks;       ///< groups in each
  std::vector<uint64_t> triangles;
  std::vector<Aabb> box;  ///< of all clusters
  std::vector<uint32_t> largest_material;
  std::vector<asset::StreamStatistics> streams;
  std::vector<Extra> extras;
  std::vector<asset::ValueRange> extra_ranges;
};

/// Some groups of one level, with vertices of their own.
struct PartsBlock {
  Mesh vertices;                     ///< no two with the same values; no -0
  std::vector<uint32_t> materials;   ///< one a vertex; empty where all are 0
  lod::ClusterSet clusters;          ///< group by group; generating_group means nothing
  std::vector<uint64_t> generators;  ///< ids, one a cluster; kNoGenerator at level 0
};
inline constexpr uint64_t kNoGenerator = ~uint64_t{0};

/// The id of the i-th group of a unit; units are numbered through all tiers.
inline uint64_t group_id(uint32_t serial, uint32_t group) { return uint64_t{serial} << 32 | group; }

/// Writes groups as they are finished.
class PartsWriter final : public lod::GroupSink {
 public:
  /// `generators`: of the clusters that the unit begins with. Both must outlive the writer.
  PartsWriter(const std::filesystem::path& path, const lod::Unit& unit,
              const std::vector<Generator>& generators, uint32_t serial);

  void add_group(const lod::NewGroup& group) override;
  void finish_level(const lod::ClusterSet& pending) override;
  /// Gives the file its name, and writes the summary.
  void commit();

 private:
  void add_cluster(const lod::ClusterSet& pending, uint32_t cluster);
  void write_block(uint32_t groups);

  std::filesystem::path path_;
  SliceWriter file_;
  const lod::Unit& unit_;
  const std::vector<Generator>& known_;
  uint32_t serial_;
  PartsSummary summary_;
  asset::VertexStatistics statistics_;
  std::vector<uint32_t> members_;  // of groups that were added since the last level
  size_t written_ = 0;             // groups
  PartsBlock block_;
  std::vector<uint32_t> number_;  // in the block, of each vertex of the unit, or kNone
  std::vector<uint32_t> used_;    // the unit's vertices that have one
};

/// Of a file of parts, which need not be there itself.
PartsSummary read_summary(const std::filesystem::path& parts);
PartsBlock read_block(const std::filesystem::path& parts, uint32_t block);

}  // namespace umbel::scale
