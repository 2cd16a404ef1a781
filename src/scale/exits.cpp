#include "scale/exits.hpp"

#include <utility>

#include "lod/dag/source.hpp"

namespace umbel::scale {
namespace {

// Copies what the clusters of `out` name, by numbers in `from`, and numbers it anew.
void copy_used(const Exits& from, Exits& out) {
  out.vertices.extras = from.vertices.extras;
  std::vector<uint32_t> number(from.flags.size(), kNone);
  for (uint32_t& v : out.clusters.vertices) {
    if (number[v] == kNone) {
      number[v] = static_cast<uint32_t>(out.flags.size());
      lod::append_vertex(out.vertices, from.vertices, v);
      if (!from.materials.empty()) out.materials.push_back(from.materials[v]);
      out.labels.push_back(from.labels[v]);
      out.flags.push_back(from.flags[v]);
    }
    v = number[v];
  }
  std::vector<uint32_t> generator(from.generators.size(), kNone);
  for (uint32_t& g : out.clusters.generating_group) {
    if (g == kNone) continue;
    if (generator[g] == kNone) {
      generator[g] = static_cast<uint32_t>(out.generators.size());
      out.generators.push_back(from.generators[g]);
    }
    g = generator[g];
  }
}

}  // namespace

Exits select_clusters(const Exits& from, const std::vector<uint32_t>& clusters) {
  Exits out;
  std::vector<lod::ClusterRef> refs;
  for (const uint32_t c : clusters) {
    refs.push_back({&from.clusters, c});
    out.spheres.push_back(from.spheres[c]);
  }
  out.clusters = lod::gather_clusters(refs);
  copy_used(from, out);
  return out;
}

Exits with_used_only(Exits&& from) {
  Exits out;
  out.clusters = std::move(from.clusters);
  out.spheres = std::move(from.spheres);
  copy_used(from, out);
  return out;
}

}  // namespace umbel::scale
