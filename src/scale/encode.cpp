#include "scale/encode.hpp"

#include <algorithm>
#include <utility>

#include "asset/file/group_chunk.hpp"
#include "lod/build/dag_writer.hpp"
#include "scale/work_file.hpp"
#include "scale/work_folder.hpp"

namespace umbel::scale {

template <typename Visit>
void for_each_array(EncodePlan& plan, Visit& visit) {
  visit(plan.attributes), visit(plan.is_smooth), visit(plan.bounds), visit(plan.first_material);
  visit(plan.has_materials), visit(plan.runs), visit(plan.first_run), visit(plan.first_serial);
}

template <typename Visit>
void for_each_array(EncodedBlock& block, Visit& visit) {
  visit(block.bytes), visit(block.references), visit(block.chunk_bytes);
}

namespace {

// With the numbers of the groups that generated them.
std::vector<lod::Cluster> clusters_of(const EncodePlan& plan, const PartsBlock& block) {
  std::vector<lod::Cluster> clusters;
  for (uint32_t c = 0; c < block.clusters.size(); ++c) {
    const uint64_t generator = block.generators[c];
    uint32_t number = kNone;
    if (generator != kNoGenerator)
      number =
          plan.number_of(static_cast<uint32_t>(generator >> 32), static_cast<uint32_t>(generator));
    clusters.push_back({kNone, number, block.clusters.material[c],
                        static_cast<uint32_t>(block.clusters.cluster_vertices(c).size()),
                        static_cast<uint32_t>(block.clusters.cluster_corners(c).size() / 3),
                        block.clusters.boxes[c]});
  }
  return clusters;
}

}  // namespace

uint32_t EncodePlan::number_of(uint32_t serial, uint32_t group) const {
  const std::span<const Run> own =
      std::span(runs).subspan(first_run.at(serial), first_run.at(serial + 1) - first_run[serial]);
  const auto after = std::ranges::upper_bound(own, group, {}, &Run::first);
  if (after == own.begin() || group - (after - 1)->first >= (after - 1)->count)
    corrupt("a cluster was made from a group that is not there");
  return (after - 1)->number + (group - (after - 1)->first);
}

uint64_t hash_of(EncodePlan& plan) {
  const std::vector<std::byte> bytes = bytes_of(plan);
  return xxh64(bytes.data(), bytes.size());
}

void write_encode_plan(const std::filesystem::path& path, EncodePlan& plan) {
  write_record(path, plan);
}

EncodedBlock encode_block(const EncodePlan& plan, const BlockName& name,
                          const std::filesystem::path& parts, std::span<const uint32_t> groups) {
  PartsBlock block = read_block(parts, name.block);
  if (plan.has_materials.at(0) != 0) {
    block.materials.resize(block.vertices.positions.size());
    lod::keep_vertex_materials(block.materials, block.vertices);
  }
  const std::vector<lod::Cluster> clusters = clusters_of(plan, block);
  const asset::VertexFormat vertices{plan.attributes, plan.is_smooth};
  const asset::ChunkFormat format{vertices, plan.bounds.at(0), plan.first_material.at(0)};
  EncodedBlock made;
  uint32_t first = 0;
  for (uint32_t i = 0; i < groups.size(); ++i) {
    const uint32_t count = groups[i];
    if (first + uint64_t{count} > clusters.size()) corrupt("a block of parts is too short");
    const asset::GroupView group{
        plan.number_of(name.serial, name.first_group + i),
        std::span(clusters).subspan(first, count),
        std::span(block.clusters.vertex_offsets).subspan(first, count + size_t{1}),
        std::span(block.clusters.triangle_offsets).subspan(first, count + size_t{1}),
        block.clusters.vertices,
        block.clusters.corners,
        block.vertices};
    const std::vector<uint32_t> children = asset::children_of(group.clusters);
    asset::check_references(group.number, children.size());
    const std::vector<std::byte> chunk = asset::encode_chunk(format, group, children);
    made.references.push_back(static_cast<uint32_t>(children.size()));
    made.chunk_bytes.push_back(static_cast<uint32_t>(chunk.size()));
    made.bytes.insert(made.bytes.end(), chunk.begin(), chunk.end());
    first += count;
  }
  return made;
}

void encode_unit(const std::filesystem::path& work, const Task& task) {
  const auto plan = read_record<EncodePlan>(encode_plan_file(work, task.plan));
  const uint32_t serial = plan.first_serial.at(task.tier) + task.unit;
  const std::filesystem::path parts = unit_file(work, task, ".parts");
  const PartsSummary summary = read_summary(parts);
  std::vector<uint32_t> clusters;
  for (const FinishedGroup& group : summary.groups) clusters.push_back(group.clusters);
  SliceWriter file(chunks_file(work, task));
  uint32_t first = 0;
  for (uint32_t b = 0; b < summary.blocks.size(); ++b) {
    const uint32_t groups = summary.blocks[b];
    EncodedBlock made = encode_block(plan, {serial, b, first, groups}, parts,
                                     std::span(clusters).subspan(first, groups));
    file.add(b, bytes_of(made));
    first += groups;
  }
  file.commit();
}

EncodedBlock read_encoded(const std::filesystem::path& chunks, uint32_t block) {
  return record_of<EncodedBlock>(SliceReader(chunks).read(block));
}

}  // namespace umbel::scale
