#include "scale/route_exits.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <map>
#include <utility>

#include "base/interner.hpp"
#include "mesh/vertex_bits.hpp"
#include "scale/unit_task.hpp"
#include "scale/work_file.hpp"

namespace umbel::scale {
namespace {

using PositionBits = std::array<uint32_t, 3>;

bool by_bits(const Vec3& a, const Vec3& b) { return value_bits(a) < value_bits(b); }

// The units that get a cluster with each position.
class UnitsOfPositions {
 public:
  UnitsOfPositions(const Exits& exits, const std::map<uint32_t, std::vector<uint32_t>>& clusters) {
    for (const auto& [unit, members] : clusters)
      for (const uint32_t c : members)
        for (const uint32_t v : exits.clusters.cluster_vertices(c)) {
          const uint32_t p = positions_.insert(exits.vertices.positions[v]).first;
          if (p == units_.size()) units_.emplace_back();
          // Units come in rising order.
          if (units_[p].empty() || units_[p].back() != unit) units_[p].push_back(unit);
        }
  }

  std::vector<uint32_t> of(const PositionEdge& edge) const {
    std::vector<uint32_t> units;
    for (const Vec3& end : {edge.from, edge.to})
      if (const uint32_t p = positions_.find(end); p != kNone)
        units.insert(units.end(), units_[p].begin(), units_[p].end());
    std::sort(units.begin(), units.end());
    units.erase(std::unique(units.begin(), units.end()), units.end());
    return units;
  }

 private:
  Interner<Vec3, ValueHash> positions_;
  std::vector<std::vector<uint32_t>> units_;
};

}  // namespace

Vec3 middle(const Aabb& box) {
  const auto mean = [](float a, float b) { return static_cast<float>((double{a} + b) / 2); };
  return {mean(box.min.x, box.max.x), mean(box.min.y, box.max.y), mean(box.min.z, box.max.z)};
}

void route_exits(const Exits& exits, const Partition& partition, uint64_t capacity,
                 SharedLeafCounts shared, const std::filesystem::path& path) {
  std::map<uint32_t, std::vector<uint32_t>> clusters;  // by unit
  for (uint32_t c = 0; c < exits.clusters.size(); ++c) {
    const uint32_t leaf = partition.leaf(middle(exits.clusters.boxes[c]));
    const uint32_t count = partition.unit_count(leaf);
    uint32_t unit = partition.first_unit(leaf);
    if (count > 1) {
      uint64_t& before = shared[leaf];
      unit += static_cast<uint32_t>(std::min<uint64_t>(before / capacity, count - 1));
      before += exits.clusters.cluster_corners(c).size() / 3;
    }
    clusters[unit].push_back(c);
  }
  std::map<uint32_t, Slice> slices;
  for (const auto& [unit, members] : clusters) {
    Slice& slice = slices[unit];
    slice.exits = select_clusters(exits, members);
    const Exits& part = slice.exits;
    for (size_t v = 0; v < part.flags.size(); ++v) {
      if (!(part.flags[v] & kMayBeShared)) continue;
      const uint32_t home = partition.home(part.vertices.positions[v]);
      if (home != unit) slices[home].mail.push_back(part.vertices.positions[v]);
    }
  }
  const UnitsOfPositions units(exits, clusters);
  for (const PositionEdge& edge : exits.locked_edges)
    for (const uint32_t unit : units.of(edge)) slices[unit].exits.locked_edges.push_back(edge);
  SliceWriter out(path);
  for (auto& [unit, slice] : slices) {
    std::sort(slice.mail.begin(), slice.mail.end(), by_bits);
    slice.mail.erase(std::unique(slice.mail.begin(), slice.mail.end()), slice.mail.end());
    out.add(unit, bytes_of(slice));
  }
  out.commit();
}

std::vector<PositionEdge> non_manifold_edges(std::vector<PositionEdge> undecided) {
  // Each with its lower end first, and whether it ran the other way.
  struct Side {
    PositionBits low, high;
    bool is_reversed;
    auto operator<=>(const Side&) const = default;
    bool same_edge(const Side& other) const { return low == other.low && high == other.high; }
  };
  std::vector<Side> sides;
  sides.reserve(undecided.size());
  for (const PositionEdge& edge : undecided) {
    const PositionBits a = value_bits(edge.from), b = value_bits(edge.to);
    sides.push_back({std::min(a, b), std::max(a, b), b < a});
  }
  undecided = {};
  std::sort(sides.begin(), sides.end());
  std::vector<PositionEdge> result;
  for (size_t begin = 0, end = 0; begin < sides.size(); begin = end) {
    while (end < sides.size() && sides[end].same_edge(sides[begin])) ++end;
    if (end - begin == 2 && sides[begin].is_reversed != sides[begin + 1].is_reversed) continue;
    result.push_back(
        {std::bit_cast<Vec3>(sides[begin].low), std::bit_cast<Vec3>(sides[begin].high)});
  }
  return result;
}

}  // namespace umbel::scale
