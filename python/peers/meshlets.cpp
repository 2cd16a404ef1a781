// Meshlets by meshoptimizer (meshopt_buildMeshletsSpatial and meshopt_buildMeshletsFlex), for
// `umbel bench clusters`. Seconds are of the build alone, without a copy to or from Python.
#include <meshoptimizer.h>

#include <algorithm>

#include "bind.hpp"
#include "peers.hpp"
#include "timed.hpp"

namespace umbel::python {
namespace {

/// Limits of meshoptimizer's meshlets, with what weighs in the choice of them: `fill_weight` of
/// Spatial, `split_factor` of Flex.
struct MeshletLimits {
  uint32_t max_vertices, min_triangles, max_triangles;
  float weight;

  void check() const {
    if (max_vertices < 3 || max_vertices > 256) {
      throw Error(ErrorCode::kInvalidArgument, "max_vertices: meshoptimizer takes 3 to 256, not " +
                                                   std::to_string(max_vertices));
    }
    if (max_triangles < 1 || max_triangles > 512) {
      throw Error(ErrorCode::kInvalidArgument, "max_triangles: meshoptimizer takes 1 to 512, not " +
                                                   std::to_string(max_triangles));
    }
    if (min_triangles < 1 || min_triangles > max_triangles) {
      throw Error(ErrorCode::kInvalidArgument, "min_triangles: must be 1 to max_triangles, not " +
                                                   std::to_string(min_triangles));
    }
    if (!(weight >= 0)) {
      throw Error(ErrorCode::kInvalidArgument, "weight: must not be negative");
    }
  }
};

struct Meshlets {
  std::vector<meshopt_Meshlet> list;
  std::vector<uint32_t> vertices;
  std::vector<uint8_t> corners;

  Meshlets(size_t triangles, const MeshletLimits& limits)
      : list(meshopt_buildMeshletsBound(triangles * 3, limits.max_vertices, limits.min_triangles)),
        vertices(triangles * 3),
        corners(triangles * 3) {}
};

/// A triangle by its vertices, whichever comes first, and where it stands.
using PlacedTriangle = std::pair<Triangle, uint32_t>;

PlacedTriangle placed(Triangle triangle, size_t place) {
  std::rotate(triangle.begin(), std::min_element(triangle.begin(), triangle.end()), triangle.end());
  return {triangle, static_cast<uint32_t>(place)};
}

/// The triangles of meshlets in their order.
std::vector<PlacedTriangle> triangles_of(const Meshlets& meshlets) {
  std::vector<PlacedTriangle> triangles;
  for (const meshopt_Meshlet& meshlet : meshlets.list) {
    const uint32_t* vertices = &meshlets.vertices[meshlet.vertex_offset];
    for (size_t i = 0; i < meshlet.triangle_count; ++i) {
      const uint8_t* corners = &meshlets.corners[meshlet.triangle_offset + i * 3];
      triangles.push_back(placed({vertices[corners[0]], vertices[corners[1]], vertices[corners[2]]},
                                 triangles.size()));
    }
  }
  return triangles;
}

/// Which triangle of the mesh each triangle of the meshlets is; equal ones in any order.
std::vector<uint32_t> items_of(const Meshlets& meshlets, std::span<const Triangle> triangles) {
  std::vector<PlacedTriangle> found = triangles_of(meshlets);
  std::vector<PlacedTriangle> given;
  given.reserve(triangles.size());
  for (const Triangle& triangle : triangles) given.push_back(placed(triangle, given.size()));
  std::sort(found.begin(), found.end());
  std::sort(given.begin(), given.end());
  const auto same = [](const auto& a, const auto& b) { return a.first == b.first; };
  if (!std::equal(found.begin(), found.end(), given.begin(), given.end(), same)) {
    throw Error(ErrorCode::kUnsupported,
                "meshoptimizer left triangles out: " + std::to_string(found.size()) + " came of " +
                    std::to_string(given.size()));
  }
  std::vector<uint32_t> items(found.size());
  for (size_t i = 0; i < found.size(); ++i) items[found[i].second] = given[i].second;
  return items;
}

std::vector<Range> ranges_of(const Meshlets& meshlets) {
  std::vector<Range> ranges;
  uint32_t offset = 0;
  for (const meshopt_Meshlet& meshlet : meshlets.list) {
    ranges.push_back({offset, meshlet.triangle_count});
    offset += meshlet.triangle_count;
  }
  return ranges;
}

enum class Peer { kSpatial, kFlex };

size_t build_meshlets(Peer peer, const MeshView& mesh, const MeshletLimits& limits, Meshlets& out) {
  const uint32_t* indices = reinterpret_cast<const uint32_t*>(mesh.triangles.data());
  const float* positions = reinterpret_cast<const float*>(mesh.positions.data());
  const size_t index_count = mesh.triangles.size() * 3;
  if (peer == Peer::kSpatial) {
    return meshopt_buildMeshletsSpatial(out.list.data(), out.vertices.data(), out.corners.data(),
                                        indices, index_count, positions, mesh.positions.size(),
                                        sizeof(Vec3), limits.max_vertices, limits.min_triangles,
                                        limits.max_triangles, limits.weight);
  }
  constexpr float kNoCones = 0.0f;
  return meshopt_buildMeshletsFlex(out.list.data(), out.vertices.data(), out.corners.data(),
                                   indices, index_count, positions, mesh.positions.size(),
                                   sizeof(Vec3), limits.max_vertices, limits.min_triangles,
                                   limits.max_triangles, kNoCones, limits.weight);
}

TimedClusters meshlets(Peer peer, const MeshArrays& mesh, const MeshletLimits& limits) {
  limits.check();
  double seconds = 0;
  auto [items, ranges] = run(nb::none(), 1, [&](const BuildOptions& options) {
    const MeshView view = mesh.view();
    validate(view, options);
    Meshlets out(view.triangles.size(), limits);
    size_t count = 0;
    seconds = seconds_of(true, [&] { count = build_meshlets(peer, view, limits, out); });
    out.list.resize(count);
    return std::pair{items_of(out, view.triangles), ranges_of(out)};
  });
  return nb::make_tuple(take<uint32_t>(std::move(items)), take<uint32_t>(std::move(ranges)),
                        seconds);
}

template <Peer peer>
TimedClusters meshlets_of(const MeshArrays& mesh, uint32_t max_vertices, uint32_t min_triangles,
                          uint32_t max_triangles, float weight) {
  return meshlets(peer, mesh, {max_vertices, min_triangles, max_triangles, weight});
}

}  // namespace

void bind_meshlets(nb::module_& module) {
  module.def("meshlets_spatial", &meshlets_of<Peer::kSpatial>, "mesh"_a, "max_vertices"_a = 128,
             "min_triangles"_a = 32, "max_triangles"_a = 128, "fill_weight"_a = 0.5f,
             "(items, ranges (k, 2), seconds of processor time)");
  module.def("meshlets_flex", &meshlets_of<Peer::kFlex>, "mesh"_a, "max_vertices"_a = 128,
             "min_triangles"_a = 32, "max_triangles"_a = 128, "split_factor"_a = 2.0f,
             "(items, ranges (k, 2), seconds of processor time)");
}

}  // namespace umbel::python
