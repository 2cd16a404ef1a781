// Verifies all cuts at once, group by group. A cut follows from another by replacing a group's own
// triangles with those that it generated, so if the two have the same boundary, all cuts have that
// of the source. The boundary is that of homology: the sum of all triangles' sides, in which an
// edge that two triangles run along in opposite directions cancels. Where the source is not
// consistently oriented, it is taken modulo 2. Edges that the source allows are left out.
#include "lod/verify/verify_borders.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/parallel.hpp"
#include "lod/dag/generated_clusters.hpp"

namespace umbel::lod {
namespace {

constexpr size_t kKeptExamples = 3;

void collect(const Topology& topology, uint32_t cluster, bool simplified,
             std::vector<uint64_t>& uses) {
  for (const Side& side : topology.sides_of(cluster))
    uses.push_back(uint64_t{side.edge} << 2 | side.backward << 1 | uint32_t{simplified});
}

void judge(const Topology& topology, const EdgeUse& use, bool is_root, BorderResult& result) {
  if (topology.allowed[use.edge]) return;
  if (use.own > 2 || use.simplified > 2) {
    ++result.overlaps;
    if (result.first_overlaps.size() < kKeptExamples) result.first_overlaps.push_back(use);
  }
  const bool differs = topology.oriented ? use.net != 0 : (use.own + use.simplified) % 2 != 0;
  if (differs && !is_root) {
    ++result.cracks;
    if (result.first_cracks.size() < kKeptExamples) result.first_cracks.push_back(use);
  }
}

bool is_within(const Sphere& sphere, const Vec3& p) {
  const double x = double{p.x} - sphere.center.x, y = double{p.y} - sphere.center.y,
               z = double{p.z} - sphere.center.z;
  return std::sqrt(x * x + y * y + z * z) <= sphere.radius * (1 + 1e-6);
}

/// The clusters of a group.
std::vector<uint32_t> own_clusters(const Group& group) {
  std::vector<uint32_t> own(group.clusters.count);
  std::iota(own.begin(), own.end(), group.clusters.offset);
  return own;
}

}  // namespace

BorderResult compare_forms(const Topology& topology, const GroupForms& forms, bool is_root) {
  std::vector<uint64_t> uses;
  for (const uint32_t c : forms.own) collect(topology, c, false, uses);
  for (const uint32_t c : forms.simplified) collect(topology, c, true, uses);
  std::sort(uses.begin(), uses.end());
  BorderResult result;
  for (size_t i = 0; i < uses.size();) {
    EdgeUse use{static_cast<uint32_t>(uses[i] >> 2)};
    for (; i < uses.size() && uses[i] >> 2 == use.edge; ++i) {
      const bool simplified = uses[i] & 1, backward = uses[i] & 2;
      ++(simplified ? use.simplified : use.own);
      use.net += backward == simplified ? 1 : -1;
    }
    judge(topology, use, is_root, result);
  }
  return result;
}

void name_border(const Topology& topology, uint32_t g, const Group& group_entry,
                 const BorderResult& result, Findings& findings) {
  const auto use_text = [&](const EdgeUse& use) {
    return topology.edge_text(use.edge) + ", which " + number(use.own) +
           " of its own triangles have and " + number(use.simplified) +
           " of those that it was simplified to";
  };
  const std::string group = "Group " + number(g) + " of level " + number(group_entry.level);
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

void verify_new_positions(const Topology& topology, uint32_t g, const Sphere& sphere,
                          const GroupForms& forms, std::span<const uint32_t> numbers,
                          PositionMarks& marks, Findings& findings) {
  for (const uint32_t c : forms.own)
    for (const uint32_t p : topology.positions_of(c)) marks.set(p, g);
  for (size_t i = 0; i < forms.simplified.size(); ++i)
    for (const uint32_t p : topology.positions_of(forms.simplified[i]))
      if (!marks.is(p, g) && !is_within(sphere, topology.positions[p]))
        findings.limit([&] {
          return "Cluster " + number(numbers[i]) + " has a vertex at " +
                 text(topology.positions[p]) + ", where group " + number(g) +
                 " that it was made from has none, outside that group's sphere";
        });
}

void verify_borders(const Tables& tables, const Topology& topology, Findings& findings) {
  findings.begin_stage();
  const GeneratedClusters generated(tables);
  std::vector<BorderResult> results(tables.groups.size());
  parallel_for(results.size(), 1, [&](size_t g) {
    const Group& group = tables.groups[g];
    const std::vector<uint32_t> own = own_clusters(group);
    results[g] = compare_forms(topology, {own, generated.of(static_cast<uint32_t>(g))},
                               group.method == SimplifyMethod::kRoot);
  });
  for (uint32_t g = 0; g < results.size(); ++g)
    name_border(topology, g, tables.groups[g], results[g], findings);
  PositionMarks marks(topology.positions.size());
  for (uint32_t g = 0; g < results.size(); ++g) {
    const std::vector<uint32_t> own = own_clusters(tables.groups[g]);
    verify_new_positions(topology, g, tables.groups[g].sphere, {own, generated.of(g)},
                         generated.of(g), marks, findings);
  }
}

}  // namespace umbel::lod
