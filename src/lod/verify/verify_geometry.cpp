// Reads the geometry of all clusters for verification, and checks each cluster by itself: sizes,
// indices, box, sphere; then the clusters of level 0 together against the source.
#include "lod/verify/verify_geometry.hpp"

#include <bit>
#include <cmath>
#include <numeric>

#include "base/hash.hpp"
#include "base/interner.hpp"
#include "base/math.hpp"
#include "mesh/vertex_bits.hpp"

namespace umbel::lod {
namespace {

struct EdgeHash {
  uint64_t operator()(uint64_t edge) const { return mix64(edge); }
};

class Reader {
 public:
  Reader(const Tables& tables, const VerifyConfig& config, Findings& findings)
      : tables_(tables), config_(config), findings_(findings) {
    uint64_t triangles = 0;
    for (const Cluster& cluster : tables.clusters)
      triangles += std::min(cluster.triangle_count, 256u);
    topology_.sides.reserve(3 * triangles);
    topology_.side_offsets = topology_.position_offsets = {0};
  }

  void read(uint32_t cluster, const GeometryReader& geometry) {
    try {
      const ClusterGeometry g = geometry(cluster);
      if (check(cluster, g)) add(cluster, g);
    } catch (const Error& error) {
      if (error.code() == ErrorCode::kCancelled) throw;
      complain(cluster, std::string("cannot be read: ") + error.what());
      topology_.complete = false;
    }
    topology_.side_offsets.push_back(topology_.sides.size());
    topology_.position_offsets.push_back(topology_.cluster_positions.size());
  }

  Topology finish() {
    topology_.positions = positions_.take();
    topology_.edges = edges_.take();
    find_allowed_edges();
    return std::move(topology_);
  }

  const Mesh& source() const { return source_; }

 private:
  void complain(uint32_t cluster, const std::string& what) {
    findings_.limit([&] { return "Cluster " + number(cluster) + " " + what; });
  }

  bool check(uint32_t c, const ClusterGeometry& g) {
    const Cluster& cluster = tables_.clusters[c];
    const size_t vertices = g.positions.size(), triangles = g.triangles.size() / 3;
    if (triangles != cluster.triangle_count || g.triangles.size() % 3 != 0)
      complain(c, "has " + number(triangles) + " triangles, but its entry says " +
                      number(cluster.triangle_count));
    if (vertices != cluster.vertex_count)
      complain(c, "has " + number(vertices) + " vertices, but its entry says " +
                      number(cluster.vertex_count));
    if (triangles == 0) complain(c, "has no triangles");
    if (triangles > config_.max_triangles)
      complain(c, "has " + number(triangles) + " triangles, more than the limit of " +
                      number(config_.max_triangles));
    if (vertices > config_.max_vertices)
      complain(c, "has " + number(vertices) + " vertices, more than the limit of " +
                      number(config_.max_vertices));
    check_stream(c, "normals", g.normals.size(), vertices);
    check_stream(c, "tangents", g.tangents.size(), vertices);
    check_stream(c, "texture coordinates", g.uvs.size(), vertices);
    check_stream(c, "colors", g.colors.size(), vertices);
    const uint32_t width = extra_width(g.extras);
    check_stream(c, "values of further attributes", width == 0 ? 0 : g.extra_values.size() / width,
                 vertices);
    const bool usable = check_indices(c, g) && check_positions(c, g);
    topology_.complete &= usable;
    return usable;
  }

  void check_stream(uint32_t c, const char* name, size_t size, size_t vertices) {
    if (size != 0 && size != vertices)
      complain(c, "has " + number(size) + " " + name + " for " + number(vertices) + " vertices");
  }

  bool check_indices(uint32_t c, const ClusterGeometry& g) {
    for (size_t i = 0; i < g.triangles.size(); ++i)
      if (g.triangles[i] >= g.positions.size()) {
        complain(c, "has the vertex index " + number(g.triangles[i]) + " in its triangle " +
                        number(i / 3) + ", but only " + number(g.positions.size()) + " vertices");
        return false;
      }
    return true;
  }

  /// Boxes and spheres may be rounded; one complaint a cluster is enough.
  bool check_positions(uint32_t c, const ClusterGeometry& g) {
    const Cluster& cluster = tables_.clusters[c];
    const Group& group = tables_.groups[cluster.group];
    bool in_box = true, in_sphere = true;
    for (const Vec3& p : g.positions) {
      if (!is_finite(p)) {
        complain(c, "has a vertex at the impossible position " + text(p));
        return false;
      }
      Aabb box = cluster.box;
      extend(box, p);
      if (in_box && !(box == cluster.box))
        complain(c, "has a vertex at " + text(p) + " outside its box from " +
                        text(cluster.box.min) + " to " + text(cluster.box.max));
      in_box &= box == cluster.box;
      if (in_sphere && !contains_point(group.sphere, p)) {
        in_sphere = false;
        findings_.not_monotone([&] {
          return "Group " + number(cluster.group) + " has the " + text(group.sphere) +
                 ", which does not contain the vertex at " + text(p) + " of its cluster " +
                 number(c);
        });
      }
    }
    return true;
  }

  static bool contains_point(const Sphere& sphere, const Vec3& p) {
    const double x = double{p.x} - sphere.center.x;
    const double y = double{p.y} - sphere.center.y;
    const double z = double{p.z} - sphere.center.z;
    const double radius = double{sphere.radius} * (1 + 1e-6);
    return x * x + y * y + z * z <= radius * radius;
  }

  void add(uint32_t c, const ClusterGeometry& g) {
    ids_.clear();
    for (const Vec3& p : g.positions)
      ids_.push_back(positions_.insert(without_negative_zero(p)).first);
    topology_.cluster_positions.insert(topology_.cluster_positions.end(), ids_.begin(), ids_.end());
    for (size_t t = 0; t + 2 < g.triangles.size(); t += 3)
      add_triangle(ids_[g.triangles[t]], ids_[g.triangles[t + 1]], ids_[g.triangles[t + 2]]);
    if (tables_.clusters[c].generating_group == kNone) add_to_source(g);
  }

  void add_triangle(uint32_t a, uint32_t b, uint32_t c) {
    if (a == b || b == c || c == a) return;
    for (const auto& [from, to] : {std::pair{a, b}, std::pair{b, c}, std::pair{c, a}}) {
      const uint64_t key = uint64_t{std::min(from, to)} << 32 | std::max(from, to);
      const uint32_t edge = edges_.insert(key).first;
      if (edge >> 31)
        throw Error(ErrorCode::kUnsupported, "verify: more than 2147483648 different edges");
      topology_.sides.push_back({edge, from > to});
    }
  }

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
    std::vector<uint64_t> uses;
    for (size_t i = 0; i < sloppy.size(); ++i) {
      const uint32_t level = level_of(sloppy[i]);
      for (const Side& side : topology_.sides_of(sloppy[i]))
        if (first_level[topology_.edges[side.edge] >> 32] == level &&
            first_level[static_cast<uint32_t>(topology_.edges[side.edge])] == level)
          uses.push_back(uint64_t{side.edge} << 1 | side.backward);
      if (i + 1 < sloppy.size() && from(sloppy[i + 1]) == from(sloppy[i])) continue;
      std::sort(uses.begin(), uses.end());
      for (auto at = uses.begin(); at != uses.end();) {
        const auto end = std::upper_bound(at, uses.end(), *at | 1);
        if (end - at != 2 || *at == *(at + 1)) found.push_back(static_cast<uint32_t>(*at >> 1));
        at = end;
      }
      uses.clear();
    }
    return found;
  }

  const Tables& tables_;
  const VerifyConfig& config_;
  Findings& findings_;
  Topology topology_;
  Interner<Vec3, ValueHash> positions_;
  Interner<uint64_t, EdgeHash> edges_;
  std::vector<uint32_t> ids_;
  Mesh source_;
};

void verify_source(const Mesh& source, const VerifyConfig& config, Findings& findings) {
  if (source.triangles.size() != config.source_triangles) {
    findings.limit([&] {
      return "Level 0 has " + number(source.triangles.size()) + " triangles, but the source has " +
             number(config.source_triangles);
    });
    return;
  }
  if (triangle_set_digest(source.view()) != config.source_digest)
    findings.limit([&] {
      return std::string(
          "Level 0 has as many triangles as the source, but not the same ones: "
          "their digests differ");
    });
}

}  // namespace

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
  if (topology.complete) verify_source(reader.source(), config, findings);
  return topology;
}

}  // namespace umbel::lod
