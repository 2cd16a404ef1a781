#include "lod/verify/cluster_check.hpp"

#include <cmath>

#include "base/math.hpp"

namespace umbel::lod {
namespace {

bool contains_point(const Sphere& sphere, const Vec3& p) {
  const double x = double{p.x} - sphere.center.x;
  const double y = double{p.y} - sphere.center.y;
  const double z = double{p.z} - sphere.center.z;
  const double radius = double{sphere.radius} * (1 + 1e-6);
  return x * x + y * y + z * z <= radius * radius;
}

/// One cluster, and where findings go.
class Check {
 public:
  Check(uint32_t c, const Cluster& cluster, const Group& group, const ClusterGeometry& geometry,
        Findings& findings)
      : c_(c), cluster_(cluster), group_(group), g_(geometry), findings_(findings) {}

  void sizes(const VerifyConfig& config) {
    const size_t vertices = g_.positions.size(), triangles = g_.triangles.size() / 3;
    if (triangles != cluster_.triangle_count || g_.triangles.size() % 3 != 0)
      complain("has " + number(triangles) + " triangles, but its entry says " +
               number(cluster_.triangle_count));
    if (vertices != cluster_.vertex_count)
      complain("has " + number(vertices) + " vertices, but its entry says " +
               number(cluster_.vertex_count));
    if (triangles == 0) complain("has no triangles");
    if (triangles > config.max_triangles)
      complain("has " + number(triangles) + " triangles, more than the limit of " +
               number(config.max_triangles));
    if (vertices > config.max_vertices)
      complain("has " + number(vertices) + " vertices, more than the limit of " +
               number(config.max_vertices));
  }

  void streams() {
    stream("normals", g_.normals.size());
    stream("tangents", g_.tangents.size());
    stream("texture coordinates", g_.uvs.size());
    stream("colors", g_.colors.size());
    const uint32_t width = extra_width(g_.extras);
    stream("values of further attributes", width == 0 ? 0 : g_.extra_values.size() / width);
  }

  bool indices() {
    for (size_t i = 0; i < g_.triangles.size(); ++i)
      if (g_.triangles[i] >= g_.positions.size()) {
        complain("has the vertex index " + number(g_.triangles[i]) + " in its triangle " +
                 number(i / 3) + ", but only " + number(g_.positions.size()) + " vertices");
        return false;
      }
    return true;
  }

  /// Boxes and spheres may be rounded; one complaint a cluster is enough.
  bool positions() {
    bool in_box = true, in_sphere = true;
    for (const Vec3& p : g_.positions) {
      if (!is_finite(p)) {
        complain("has a vertex at the impossible position " + text(p));
        return false;
      }
      Aabb box = cluster_.box;
      extend(box, p);
      if (in_box && !(box == cluster_.box))
        complain("has a vertex at " + text(p) + " outside its box from " + text(cluster_.box.min) +
                 " to " + text(cluster_.box.max));
      in_box &= box == cluster_.box;
      if (in_sphere && !contains_point(group_.sphere, p)) {
        in_sphere = false;
        findings_.not_monotone([&] {
          return "Group " + number(cluster_.group) + " has the " + text(group_.sphere) +
                 ", which does not contain the vertex at " + text(p) + " of its cluster " +
                 number(c_);
        });
      }
    }
    return true;
  }

 private:
  void complain(const std::string& what) {
    findings_.limit([&] { return "Cluster " + number(c_) + " " + what; });
  }

  void stream(const char* name, size_t size) {
    if (size != 0 && size != g_.positions.size())
      complain("has " + number(size) + " " + name + " for " + number(g_.positions.size()) +
               " vertices");
  }

  uint32_t c_;
  const Cluster& cluster_;
  const Group& group_;
  const ClusterGeometry& g_;
  Findings& findings_;
};

}  // namespace

bool check_cluster(uint32_t number, const Cluster& cluster, const Group& group,
                   const ClusterGeometry& geometry, const VerifyConfig& config,
                   Findings& findings) {
  Check check(number, cluster, group, geometry, findings);
  check.sizes(config);
  check.streams();
  return check.indices() && check.positions();
}

void name_unreadable(uint32_t cluster, const char* why, Findings& findings) {
  findings.limit(
      [&] { return "Cluster " + number(cluster) + " cannot be read: " + std::string(why); });
}

void verify_source(uint64_t triangles, const std::function<uint64_t()>& digest,
                   const VerifyConfig& config, Findings& findings) {
  if (triangles != config.source_triangles) {
    findings.limit([&] {
      return "Level 0 has " + number(triangles) + " triangles, but the source has " +
             number(config.source_triangles);
    });
    return;
  }
  if (digest() != config.source_digest)
    findings.limit([&] {
      return std::string(
          "Level 0 has as many triangles as the source, but not the same ones: "
          "their digests differ");
    });
}

}  // namespace umbel::lod
