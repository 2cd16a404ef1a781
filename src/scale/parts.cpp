#include "scale/parts.hpp"

#include <algorithm>
#include <utility>

#include "base/math.hpp"
#include "scale/vertex_table.hpp"

namespace umbel::scale {
namespace {

// A few megabytes of clusters.
constexpr uint32_t kBlockGroups = 64;

std::filesystem::path summary_file(std::filesystem::path parts) {
  return parts.replace_extension(".groups");
}

}  // namespace

template <typename Visit>
void for_each_array(PartsSummary& summary, Visit& visit) {
  visit(summary.groups), visit(summary.blocks), visit(summary.triangles), visit(summary.box);
  visit(summary.largest_material), visit(summary.streams), visit(summary.extras);
  visit(summary.extra_ranges);
}

template <typename Visit>
void for_each_array(PartsBlock& block, Visit& visit) {
  for_each_array(block.vertices, visit);
  visit(block.materials);
  for_each_array(block.clusters, visit);
  visit(block.generators);
}

PartsWriter::PartsWriter(const std::filesystem::path& path, const lod::Unit& unit,
                         const std::vector<Generator>& generators, uint32_t serial)
    : path_(path), file_(path), unit_(unit), known_(generators), serial_(serial) {
  summary_.triangles = {0};
  summary_.box = {Aabb{}};
  summary_.largest_material = {0};
}

void PartsWriter::add_group(const lod::NewGroup& group) {
  summary_.groups.push_back({static_cast<uint32_t>(group.members.size()), group.level, group.method,
                             group.limiting_factor, group.sphere, group.error});
  members_.insert(members_.end(), group.members.begin(), group.members.end());
}

void PartsWriter::finish_level(const lod::ClusterSet& pending) {
  size_t member = 0;
  number_.resize(unit_.source.mesh.positions.size(), kNone);  // there may be new ones
  while (written_ < summary_.groups.size()) {
    const auto groups =
        static_cast<uint32_t>(std::min<size_t>(kBlockGroups, summary_.groups.size() - written_));
    for (const size_t end = written_ + groups; written_ < end; ++written_)
      for (uint32_t i = 0; i < summary_.groups[written_].clusters; ++i)
        add_cluster(pending, members_[member++]);
    write_block(groups);
  }
  members_.clear();
}

void PartsWriter::add_cluster(const lod::ClusterSet& pending, uint32_t cluster) {
  lod::ClusterSet& clusters = block_.clusters;
  const size_t first = clusters.vertices.size();
  clusters.append(pending.cluster_vertices(cluster), pending.cluster_corners(cluster), kNone,
                  pending.material[cluster], pending.boxes[cluster]);
  for (uint32_t& v : std::span(clusters.vertices).subspan(first)) {
    uint32_t& number = number_[v];
    if (number == kNone) {
      const uint32_t material = unit_.source.material(v);
      number = static_cast<uint32_t>(used_.size());
      lod::append_vertex(block_.vertices, unit_.source.mesh, v);
      if (!unit_.source.vertex_materials.empty()) block_.materials.push_back(material);
      used_.push_back(v);
      summary_.largest_material[0] = std::max(summary_.largest_material[0], material);
    }
    v = number;
  }
  extend(summary_.box[0], pending.boxes[cluster]);
  summary_.triangles[0] += pending.cluster_corners(cluster).size() / 3;
  const uint32_t g = pending.generating_group[cluster];
  const auto known = static_cast<uint32_t>(known_.size());
  block_.generators.push_back(g == kNone  ? kNoGenerator
                              : g < known ? known_[g].id
                                          : group_id(serial_, g - known));
}

void PartsWriter::write_block(uint32_t groups) {
  block_.vertices.extras = unit_.source.mesh.extras;
  drop_negative_zeros(block_.vertices);
  asset::add(statistics_, asset::vertex_statistics(block_.vertices, 0));
  file_.add(static_cast<uint32_t>(summary_.blocks.size()), bytes_of(block_));
  summary_.blocks.push_back(groups);
  block_ = {};
  for (const uint32_t v : used_) number_[v] = kNone;
  used_.clear();
}

void PartsWriter::commit() {
  summary_.streams = {statistics_.streams};
  summary_.extras = statistics_.extras;
  summary_.extra_ranges = statistics_.extra_ranges;
  file_.commit();
  write_record(summary_file(path_), summary_);
}

PartsSummary read_summary(const std::filesystem::path& parts) {
  return read_record<PartsSummary>(summary_file(parts));
}

PartsBlock read_block(const std::filesystem::path& parts, uint32_t block) {
  return record_of<PartsBlock>(SliceReader(parts).read(block));
}

}  // namespace umbel::scale
