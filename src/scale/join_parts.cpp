#include "scale/join_parts.hpp"

#include <algorithm>
#include <unordered_map>
#include <utility>

#include "lod/build/dag_writer.hpp"
#include "lod/build/hierarchy.hpp"
#include "scale/parts.hpp"
#include "scale/vertex_table.hpp"

namespace umbel::scale {
namespace {

// A group of one of the parts, in one of their blocks.
struct PlacedGroup {
  uint32_t level, serial, group;
  uint32_t block, first_cluster;
};

class Joiner {
 public:
  Joiner(const std::vector<std::filesystem::path>& files, lod::Dag& dag) : dag_(dag) {
    dag_.vertex_offsets = dag_.triangle_offsets = {0};
    for (const std::filesystem::path& file : files) add(file);
  }

  void run() {
    std::ranges::stable_sort(order_, {}, &PlacedGroup::level);
    std::unordered_map<uint64_t, uint32_t> number;
    for (const PlacedGroup& placed : order_) {
      number.emplace(group_id(placed.serial, placed.group), static_cast<uint32_t>(number.size()));
    }
    uint32_t level = kNone;
    for (const PlacedGroup& placed : order_) {
      if (placed.level != level)
        dag_.tables.levels.push_back({static_cast<uint32_t>(dag_.tables.groups.size()), 0});
      level = placed.level;
      ++dag_.tables.levels.back().count;
      add_group(placed, number);
    }
    dag_.tables.nodes = lod::build_hierarchy(dag_.tables);
    dag_.vertices = table_.take_mesh();
    const std::vector<uint32_t> materials = table_.take_materials();
    if (dag_.config.mix_materials && std::ranges::any_of(materials, [](uint32_t m) { return m; }))
      lod::keep_vertex_materials(materials, dag_.vertices);
  }

 private:
  void add(const std::filesystem::path& file) {
    const auto serial = static_cast<uint32_t>(summaries_.size());
    const PartsSummary& summary = summaries_.emplace_back(read_summary(file));
    uint32_t group = 0;
    for (uint32_t b = 0; b < summary.blocks.size(); ++b) {
      uint32_t first = 0;
      for (uint32_t i = 0; i < summary.blocks[b]; ++i, ++group) {
        order_.push_back({summary.groups[group].level, serial, group,
                          static_cast<uint32_t>(blocks_.size()), first});
        first += summary.groups[group].clusters;
      }
      add(read_block(file, b));
    }
  }

  void add(PartsBlock block) {
    std::vector<uint32_t> numbers;
    for (uint32_t v = 0; v < block.vertices.positions.size(); ++v)
      numbers.push_back(
          table_.insert(block.vertices, v, block.materials.empty() ? 0 : block.materials[v]));
    for (uint32_t& v : block.clusters.vertices) v = numbers[v];
    block.vertices = {};
    blocks_.push_back(std::move(block));
  }

  void add_group(const PlacedGroup& placed, const std::unordered_map<uint64_t, uint32_t>& number) {
    const FinishedGroup& from = summaries_[placed.serial].groups[placed.group];
    lod::Tables& tables = dag_.tables;
    lod::Group group = group_of(from);
    group.clusters = {static_cast<uint32_t>(tables.clusters.size()), from.clusters};
    group.level = static_cast<uint32_t>(tables.levels.size() - 1);
    const auto id = static_cast<uint32_t>(tables.groups.size());
    tables.groups.push_back(group);
    dag_.limiting_factors.push_back(from.limiting_factor);
    lod::count_group(from.method, from.limiting_factor, dag_.report);
    for (uint32_t i = 0; i < from.clusters; ++i)
      add_cluster(blocks_[placed.block], placed.first_cluster + i, id, number);
  }

  void add_cluster(const PartsBlock& block, uint32_t c, uint32_t group,
                   const std::unordered_map<uint64_t, uint32_t>& number) {
    const auto vertices = block.clusters.cluster_vertices(c);
    const auto corners = block.clusters.cluster_corners(c);
    const uint64_t generator = block.generators[c];
    dag_.tables.clusters.push_back(
        {group, generator == kNoGenerator ? kNone : number.at(generator),
         block.clusters.material[c], static_cast<uint32_t>(vertices.size()),
         static_cast<uint32_t>(corners.size() / 3), block.clusters.boxes[c]});
    dag_.cluster_vertices.insert(dag_.cluster_vertices.end(), vertices.begin(), vertices.end());
    dag_.cluster_triangles.insert(dag_.cluster_triangles.end(), corners.begin(), corners.end());
    dag_.vertex_offsets.push_back(static_cast<uint32_t>(dag_.cluster_vertices.size()));
    dag_.triangle_offsets.push_back(static_cast<uint32_t>(dag_.cluster_triangles.size() / 3));
  }

  lod::Dag& dag_;
  VertexTable table_;
  std::vector<PartsSummary> summaries_;  // by serial
  std::vector<PartsBlock> blocks_;
  std::vector<PlacedGroup> order_;
};

}  // namespace

void join_parts(const std::vector<std::filesystem::path>& files, lod::Dag& dag) {
  Joiner(files, dag).run();
}

}  // namespace umbel::scale
