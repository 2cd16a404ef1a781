// Verifies all cuts at once, group by group. A cut follows from another by replacing a group's own
// triangles with those that it generated, so if the two have the same boundary, all cuts have that
// of the source. The boundary is that of homology: the sum of all triangles' sides, in which an
// edge that two triangles run along in opposite directions cancels. Where the source is not
// consistently oriented, it is taken modulo 2. Edges that the source allows are left out.
#include "lod/verify/verify_borders.hpp"

#include <algorithm>
#include <cmath>

#include "base/parallel.hpp"

namespace umbel::lod {
namespace {

/// Clusters by the group that generated them.
struct Generated {
  std::vector<uint32_t> offsets, clusters;

  explicit Generated(const Tables& tables) : offsets(tables.groups.size() + 1, 0) {
    for (const Cluster& c : tables.clusters)
      if (c.generating_group != kNone) ++offsets[c.generating_group + 1];
    for (size_t g = 1; g < offsets.size(); ++g) offsets[g] += offsets[g - 1];
    clusters.resize(offsets.back());
    std::vector<uint32_t> next(offsets.begin(), offsets.end() - 1);
    for (uint32_t c = 0; c < tables.clusters.size(); ++c)
      if (tables.clusters[c].generating_group != kNone)
        clusters[next[tables.clusters[c].generating_group]++] = c;
  }

  std::span<const uint32_t> of(uint32_t group) const {
    return std::span(clusters).subspan(offsets[group], offsets[group + 1] - offsets[group]);
  }
};

/// How often the two forms of a group run along one edge.
struct EdgeUse {
  uint32_t edge;
  uint32_t own = 0, simplified = 0;
  int64_t net = 0;  ///< forward minus backward, own minus simplified
};

struct GroupResult {
  uint64_t cracks = 0, overlaps = 0;
  std::vector<EdgeUse> first_cracks, first_overlaps;
};

constexpr size_t kKept = 3;

void collect(const Topology& topology, uint32_t cluster, bool simplified,
             std::vector<uint64_t>& uses) {
  for (const Side& side : topology.sides_of(cluster))
    uses.push_back(uint64_t{side.edge} << 2 | side.backward << 1 | uint32_t{simplified});
}

void judge(const Topology& topology, const EdgeUse& use, bool is_root, GroupResult& result) {
  if (topology.allowed[use.edge]) return;
  if (use.own > 2 || use.simplified > 2) {
    ++result.overlaps;
    if (result.first_overlaps.size() < kKept) result.first_overlaps.push_back(use);
  }
  const bool differs = topology.oriented ? use.net != 0 : (use.own + use.simplified) % 2 != 0;
  if (differs && !is_root) {
    ++result.cracks;
    if (result.first_cracks.size() < kKept) result.first_cracks.push_back(use);
  }
}

GroupResult compare(const Tables& tables, const Topology& topology, const Generated& generated,
                    uint32_t g) {
  std::vector<uint64_t> uses;
  const Range& own = tables.groups[g].clusters;
  for (uint32_t c = own.offset; c < own.offset + own.count; ++c) collect(topology, c, false, uses);
  for (const uint32_t c : generated.of(g)) collect(topology, c, true, uses);
  std::sort(uses.begin(), uses.end());
  GroupResult result;
  for (size_t i = 0; i < uses.size();) {
    EdgeUse use{static_cast<uint32_t>(uses[i] >> 2)};
    for (; i < uses.size() && uses[i] >> 2 == use.edge; ++i) {
      const bool simplified = uses[i] & 1, backward = uses[i] & 2;
      ++(simplified ? use.simplified : use.own);
      use.net += backward == simplified ? 1 : -1;
    }
    judge(topology, use, tables.groups[g].method == SimplifyMethod::kRoot, result);
  }
  return result;
}

void name(const Tables& tables, const Topology& topology, uint32_t g, const GroupResult& result,
          Findings& findings) {
  const auto use_text = [&](const EdgeUse& use) {
    return topology.edge_text(use.edge) + ", which " + number(use.own) +
           " of its own triangles have and " + number(use.simplified) +
           " of those that it was simplified to";
  };
  const std::string group = "Group " + number(g) + " of level " + number(tables.groups[g].level);
  for (size_t i = 0; i < result.first_cracks.size(); ++i)
    findings.crack(
        [&] {
          return group + " does not keep its border at " + use_text(result.first_cracks[i]) + " (" +
                 number(result.cracks) + " such edges)";
        },
        i == 0 ? result.cracks : 0);
  for (size_t i = 0; i < result.first_overlaps.size(); ++i)
    findings.overlap(
        [&] {
          return group + " has more than two triangles at " + use_text(result.first_overlaps[i]) +
                 " (" + number(result.overlaps) + " such edges)";
        },
        i == 0 ? result.overlaps : 0);
}

bool is_within(const Sphere& sphere, const Vec3& p) {
  const double x = double{p.x} - sphere.center.x, y = double{p.y} - sphere.center.y,
               z = double{p.z} - sphere.center.z;
  return std::sqrt(x * x + y * y + z * z) <= sphere.radius * (1 + 1e-6);
}

/// Simplification only drops vertices, but for a decimation of somebody's own: its new vertices
/// are within the group's sphere.
void verify_positions(const Tables& tables, const Topology& topology, const Generated& generated,
                      Findings& findings) {
  std::vector<uint32_t> last_group(topology.positions.size(), kNone);
  for (uint32_t g = 0; g < tables.groups.size(); ++g) {
    const Range& own = tables.groups[g].clusters;
    for (uint32_t c = own.offset; c < own.offset + own.count; ++c)
      for (const uint32_t p : topology.positions_of(c)) last_group[p] = g;
    for (const uint32_t c : generated.of(g))
      for (const uint32_t p : topology.positions_of(c))
        if (last_group[p] != g && !is_within(tables.groups[g].sphere, topology.positions[p]))
          findings.limit([&] {
            return "Cluster " + number(c) + " has a vertex at " + text(topology.positions[p]) +
                   ", where group " + number(g) +
                   " that it was made from has none, outside that group's sphere";
          });
  }
}

}  // namespace

void verify_borders(const Tables& tables, const Topology& topology, Findings& findings) {
  findings.begin_stage();
  const Generated generated(tables);
  std::vector<GroupResult> results(tables.groups.size());
  parallel_for(results.size(), 1, [&](size_t g) {
    results[g] = compare(tables, topology, generated, static_cast<uint32_t>(g));
  });
  for (uint32_t g = 0; g < results.size(); ++g) name(tables, topology, g, results[g], findings);
  verify_positions(tables, topology, generated, findings);
}

}  // namespace umbel::lod
