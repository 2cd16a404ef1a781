// Reads the geometry of all clusters for verification, checks each by itself, and the clusters of
// level 0 together against the source.
#include "lod/verify/verify_geometry.hpp"

#include <numeric>

#include "lod/verify/cluster_check.hpp"

namespace umbel::lod {
namespace {

class Reader {
 public:
  Reader(const Tables& tables, const VerifyConfig& config, Findings& findings)
      : tables_(tables), config_(config), findings_(findings) {
    uint64_t triangles = 0;
    for (const Cluster& cluster : tables.clusters)
      triangles += std::min(cluster.triangle_count, 256u);
    builder_.reserve(triangles);
  }

  void read(uint32_t cluster, const GeometryReader& geometry) {
    try {
      const ClusterGeometry g = geometry(cluster);
      const Cluster& entry = tables_.clusters[cluster];
      if (check_cluster(cluster, entry, tables_.groups[entry.group], g, config_, findings_)) {
        builder_.add(g);
        if (entry.generating_group == kNone) add_to_source(g);
        return;
      }
    } catch (const Error& error) {
      if (error.code() == ErrorCode::kCancelled || error.code() == ErrorCode::kIo) throw;
      name_unreadable(cluster, error.what(), findings_);
    }
    complete_ = false;
    builder_.add({});
  }

  Topology finish() {
    topology_ = builder_.take();
    topology_.complete = complete_;
    find_allowed_edges();
    return std::move(topology_);
  }

  const Mesh& source() const { return source_; }

 private:
  void add_to_source(const ClusterGeometry& g) {
    const uint32_t first = static_cast<uint32_t>(source_.positions.size());
    source_.positions.insert(source_.positions.end(), g.positions.begin(), g.positions.end());
    for (size_t t = 0; t + 2 < g.triangles.size(); t += 3)
      source_.triangles.push_back(
          {first + g.triangles[t], first + g.triangles[t + 1], first + g.triangles[t + 2]});
  }

  /// Components of positions joined by the source's non-manifold edges, by union-find.
  void find_allowed_edges() {
    std::vector<uint8_t> forward(topology_.edges.size(), 0), backward(topology_.edges.size(), 0);
    for (uint32_t c = 0; c < tables_.clusters.size(); ++c) {
      if (tables_.clusters[c].generating_group != kNone) continue;
      for (const Side& side : topology_.sides_of(c)) {
        uint8_t& count = side.backward ? backward[side.edge] : forward[side.edge];
        count += count < 255;
      }
    }
    std::vector<uint32_t> parent(topology_.positions.size());
    std::iota(parent.begin(), parent.end(), 0u);
    const auto find = [&](uint32_t p) {
      while (parent[p] != p) p = parent[p] = parent[parent[p]];
      return p;
    };
    const auto join = [&](size_t e) {
      const uint32_t a = find(topology_.edges[e] >> 32);
      const uint32_t b = find(static_cast<uint32_t>(topology_.edges[e]));
      parent[std::max(a, b)] = std::min(a, b);
    };
    for (size_t e = 0; e < topology_.edges.size(); ++e) {
      const uint32_t triangles = forward[e] + backward[e];
      if (triangles == 0) continue;
      if (triangles == 2 && forward[e] == 1) continue;
      topology_.oriented &= triangles != 2;
      join(e);
    }
    for (const uint32_t e : new_open_edges()) join(e);
    topology_.allowed.resize(topology_.edges.size());
    for (size_t e = 0; e < topology_.edges.size(); ++e)
      topology_.allowed[e] =
          find(topology_.edges[e] >> 32) == find(static_cast<uint32_t>(topology_.edges[e]));
  }

  /// Edges between positions that no finer cluster has, of enlarged parts of a group's simplified
  /// form, that are not regular there.
  std::vector<uint32_t> new_open_edges() const {
    std::vector<uint32_t> found;
    std::vector<uint32_t> first_level(topology_.positions.size(), kNone);
    const auto level_of = [&](uint32_t c) {
      const uint32_t from = tables_.clusters[c].generating_group;
      return from == kNone ? 0 : tables_.groups[from].level + 1;
    };
    std::vector<uint32_t> sloppy;  // clusters, by the group that they were made from
    for (uint32_t c = 0; c < tables_.clusters.size(); ++c) {
      for (const uint32_t p : topology_.positions_of(c))
        first_level[p] = std::min(first_level[p], level_of(c));
      const uint32_t from = tables_.clusters[c].generating_group;
      if (from != kNone && tables_.groups[from].method == SimplifyMethod::kSloppy)
        sloppy.push_back(c);
    }
    const auto from = [&](uint32_t c) { return tables_.clusters[c].generating_group; };
    std::stable_sort(sloppy.begin(), sloppy.end(),
                     [&](uint32_t a, uint32_t b) { return from(a) < from(b); });
    for (size_t i = 0; i < sloppy.size();) {
      const size_t begin = i;
      while (i < sloppy.size() && from(sloppy[i]) == from(sloppy[begin])) ++i;
      const uint32_t level = level_of(sloppy[begin]);
      for_each_irregular(
          topology_, std::span(sloppy).subspan(begin, i - begin),
          [&](uint32_t edge) {
            return first_level[topology_.edges[edge] >> 32] == level &&
                   first_level[static_cast<uint32_t>(topology_.edges[edge])] == level;
          },
          [&](uint32_t edge) { found.push_back(edge); });
    }
    return found;
  }

  const Tables& tables_;
  const VerifyConfig& config_;
  Findings& findings_;
  TopologyBuilder builder_;
  Topology topology_;
  bool complete_ = true;
  Mesh source_;
};

}  // namespace

void TopologyBuilder::add(const ClusterGeometry& g) {
  ids_.clear();
  for (const Vec3& p : g.positions)
    ids_.push_back(positions_.insert(without_negative_zero(p)).first);
  topology_.cluster_positions.insert(topology_.cluster_positions.end(), ids_.begin(), ids_.end());
  for (size_t t = 0; t + 2 < g.triangles.size(); t += 3)
    add_triangle(ids_[g.triangles[t]], ids_[g.triangles[t + 1]], ids_[g.triangles[t + 2]]);
  topology_.side_offsets.push_back(topology_.sides.size());
  topology_.position_offsets.push_back(topology_.cluster_positions.size());
}

void TopologyBuilder::add_triangle(uint32_t a, uint32_t b, uint32_t c) {
  if (a == b || b == c || c == a) return;
  for (const auto& [from, to] : {std::pair{a, b}, std::pair{b, c}, std::pair{c, a}}) {
    const uint64_t key = uint64_t{std::min(from, to)} << 32 | std::max(from, to);
    const uint32_t edge = edges_.insert(key).first;
    if (edge >> 31)
      throw Error(ErrorCode::kUnsupported, "verify: more than 2147483648 different edges");
    topology_.sides.push_back({edge, from > to});
  }
}

Topology TopologyBuilder::take() {
  topology_.positions = positions_.take();
  topology_.edges = edges_.take();
  return std::move(topology_);
}

Topology read_topology(const Tables& tables, const GeometryReader& geometry,
                       const VerifyConfig& config, Findings& findings, Progress& progress) {
  constexpr uint32_t kReportEvery = 1024;
  findings.begin_stage();
  Reader reader(tables, config, findings);
  const uint32_t clusters = static_cast<uint32_t>(tables.clusters.size());
  for (uint32_t c = 0; c < clusters; ++c) {
    if (c % kReportEvery == 0) progress.report(0.02 + 0.58 * c / clusters, "reading clusters");
    reader.read(c, geometry);
  }
  findings.begin_stage();
  Topology topology = reader.finish();
  if (topology.complete)
    verify_source(
        reader.source().triangles.size(),
        [&] { return triangle_set_digest(reader.source().view()); }, config, findings);
  return topology;
}

}  // namespace umbel::lod
