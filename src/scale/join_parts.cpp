#include "scale/join_parts.hpp"

#include <algorithm>
#include <unordered_map>
#include <utility>

#include "lod/build/dag_writer.hpp"
#include "lod/build/hierarchy.hpp"
#include "scale/exits.hpp"
#include "scale/vertex_table.hpp"
#include "scale/work_file.hpp"

namespace umbel::scale {
namespace {

// A group of one of the parts.
struct PlacedGroup {
  uint32_t level, serial, group;
  uint32_t first_cluster;  // of the part
};

class Joiner {
 public:
  Joiner(const std::vector<std::filesystem::path>& files, lod::Dag& dag) : dag_(dag) {
    dag_.vertex_offsets = dag_.triangle_offsets = {0};
    for (const std::filesystem::path& file : files) add(read_record<Parts>(file));
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
  void add(Parts parts) {
    std::vector<uint32_t> numbers(parts.vertices.positions.size(), kNone);
    for (uint32_t& v : parts.clusters.vertices) {
      if (numbers[v] == kNone)
        numbers[v] =
            table_.insert(parts.vertices, v, parts.materials.empty() ? 0 : parts.materials[v]);
      v = numbers[v];
    }
    parts.vertices = {};
    uint32_t first = 0;
    for (uint32_t g = 0; g < parts.groups.size(); ++g) {
      order_.push_back({parts.groups[g].level, static_cast<uint32_t>(parts_.size()), g, first});
      first += parts.groups[g].clusters;
    }
    parts_.push_back(std::move(parts));
  }

  void add_group(const PlacedGroup& placed, const std::unordered_map<uint64_t, uint32_t>& number) {
    const Parts& parts = parts_[placed.serial];
    const Parts::FinishedGroup& from = parts.groups[placed.group];
    lod::Tables& tables = dag_.tables;
    lod::Group group;
    group.clusters = {static_cast<uint32_t>(tables.clusters.size()), from.clusters};
    group.level = static_cast<uint32_t>(tables.levels.size() - 1);
    group.method = from.method;
    group.sphere = from.sphere;
    group.error = from.error;
    const auto id = static_cast<uint32_t>(tables.groups.size());
    tables.groups.push_back(group);
    dag_.limiting_factors.push_back(from.limiting_factor);
    const auto method = static_cast<size_t>(from.method);
    ++dag_.report.groups_by_method[method];
    ++dag_.report.groups_by_limiting_factor[method][static_cast<size_t>(from.limiting_factor)];
    for (uint32_t i = 0; i < from.clusters; ++i)
      add_cluster(parts, placed.first_cluster + i, id, number);
  }

  void add_cluster(const Parts& parts, uint32_t c, uint32_t group,
                   const std::unordered_map<uint64_t, uint32_t>& number) {
    const auto vertices = parts.clusters.cluster_vertices(c);
    const auto corners = parts.clusters.cluster_corners(c);
    const uint64_t generator = parts.generators[c];
    dag_.tables.clusters.push_back(
        {group, generator == kNoGenerator ? kNone : number.at(generator),
         parts.clusters.material[c], static_cast<uint32_t>(vertices.size()),
         static_cast<uint32_t>(corners.size() / 3), parts.clusters.boxes[c]});
    dag_.cluster_vertices.insert(dag_.cluster_vertices.end(), vertices.begin(), vertices.end());
    dag_.cluster_triangles.insert(dag_.cluster_triangles.end(), corners.begin(), corners.end());
    dag_.vertex_offsets.push_back(static_cast<uint32_t>(dag_.cluster_vertices.size()));
    dag_.triangle_offsets.push_back(static_cast<uint32_t>(dag_.cluster_triangles.size() / 3));
  }

  lod::Dag& dag_;
  VertexTable table_;
  std::vector<Parts> parts_;
  std::vector<PlacedGroup> order_;
};

}  // namespace

void join_parts(const std::vector<std::filesystem::path>& files, lod::Dag& dag) {
  Joiner(files, dag).run();
}

}  // namespace umbel::scale
