// Fuzzes with sizes: ordinary shapes, scaled from the smallest float to the largest on each axis
// alone, moved away from the origin, and with a part that is smaller still. Everything that takes
// meshes must refuse one with a sentence, or give what its header promises; no size of anything
// becomes an integer that it does not fit.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "c_interface.hpp"
#include "umbel/cluster.hpp"
#include "umbel/frame_clusters.hpp"
#include "umbel/lod.hpp"
#include "umbel/umbel.hpp"
#include "umbel/uniform.hpp"

namespace {

using umbel::Mesh;
using umbel::Vec3;
using umbel::fuzz::expect;
using umbel::fuzz::Input;

constexpr float kMost = std::numeric_limits<float>::max();

umbel::BuildOptions one_thread() {
  umbel::BuildOptions options;
  options.threads = 1;
  return options;
}

/// What `work` gives, or nothing where it refuses the input.
template <typename Work>
auto unless_refused(const Work& work) -> std::optional<decltype(work())> {
  try {
    return work();
  } catch (const umbel::Error& error) {
    const auto code = error.code();
    expect(code == umbel::ErrorCode::kInvalidArgument || code == umbel::ErrorCode::kInvalidMesh ||
               code == umbel::ErrorCode::kUnsupported,
           "a failure that is not the input's fault");
    expect(error.what()[0] != '\0', "a failure without a sentence");
    return {};
  }
}

Mesh shape(Input& in) {
  switch (in.below(8)) {
    case 0:
      return umbel::shapes::grid(1 + in.below(12), 1 + in.below(12));
    case 1:
      return umbel::shapes::sphere(in.below(4));
    case 2:
      return umbel::shapes::torus(3 + in.below(16), 3 + in.below(12));
    case 3:
      return umbel::shapes::soup(in.below(255), in.below(255));
    case 4:
      return umbel::shapes::tetrahedra(in.below(40));
    case 5:
      return umbel::shapes::fan(3 + in.below(60));
    case 6:
      return umbel::shapes::terrain(2 + in.below(14), 2 + in.below(14), in.below(255));
    default:
      return umbel::shapes::blob(in.below(4), in.below(255));
  }
}

/// A power of two, or none at all.
float scale(Input& in) {
  const uint32_t choice = in.below(256);
  if (choice == 0) return 0;
  if (choice < 64) return 1;
  return std::ldexp(1.0f, static_cast<int>(choice % 190) * 277 / 190 - 149);
}

/// Within what floats can be: what overflows is the largest.
float moved(float x, float by, float to) {
  const float at = x * by + to;
  return std::isfinite(at) ? at : std::copysign(kMost, at);
}

Mesh scaled_shape(Input& in) {
  Mesh mesh = shape(in);
  const Vec3 by{scale(in), in.likes(1) ? scale(in) : 1, in.likes(2) ? scale(in) : 1};
  const float all = in.likes(3) ? scale(in) : 1, knot = in.likes(4) ? scale(in) : 1;
  const float to = in.likes(5) ? scale(in) : 0;
  // Some first vertices in a knot of their own.
  const size_t knotted = in.likes(4) ? mesh.positions.size() * in.below(8) / 8 : 0;
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    Vec3& p = mesh.positions[i];
    const float own = i < knotted ? knot : 1;
    p = {moved(p.x * own, by.x * all, to), moved(p.y * own, by.y * all, to),
         moved(p.z * own, by.z * all, to)};
    if (in.likes(6) && in.seldom(16)) {
      const umbel_vec3 any = in.point();
      p = {any.x, any.y, any.z};
    }
  }
  // What is not finite is refused at once, which needs no more trying.
  for (Vec3& p : mesh.positions)
    for (float* x : {&p.x, &p.y, &p.z})
      if (!std::isfinite(*x)) *x = kMost;
  return mesh;
}

void check_partition(const umbel::Clusters& clusters, size_t triangles) {
  std::vector<uint8_t> seen(triangles, 0);
  for (const uint32_t item : clusters.items)
    expect(item < triangles && !seen[item]++, "a triangle is in two clusters, or is none");
  expect(clusters.items.size() == triangles, "a triangle is lost");
}

void cluster(Input& in, const Mesh& mesh) {
  umbel::ClusterConfig config;
  config.max_items = 4 + in.below(60);
  config.min_items = 1 + in.below(config.max_items / 2);
  if (in.below(3) == 0) config.max_vertices = 16 + in.below(60);
  const auto kind = in.below(3);
  const auto made = unless_refused([&] {
    return kind == 0   ? umbel::cluster_mesh(mesh.view(), config, 0, one_thread())
           : kind == 1 ? umbel::cluster_mesh_morton(mesh.view(), config, one_thread())
                       : umbel::cluster_mesh_hybrid(mesh.view(), config, one_thread());
  });
  if (!made) return;
  check_partition(*made, mesh.triangles.size());
  unless_refused([&] { return umbel::cluster_bounds(mesh.view(), *made, one_thread()); });
  unless_refused([&] {
    return umbel::order_clusters(mesh.view(), *made, static_cast<int>(in.below(4)), one_thread());
  });
}

void cluster_frames(Input& in, const Mesh& mesh) {
  umbel::FrameClusterConfig config;
  config.method = in.below(2) ? umbel::FrameMethod::kHybrid : umbel::FrameMethod::kMorton;
  config.max_triangles = 4 + in.below(60);
  unless_refused([&] {
    umbel::FrameClusterer frames(mesh.triangles, mesh.positions.size(), config);
    frames.build(mesh.positions, one_thread());
    Mesh next = mesh;
    const float by = scale(in);
    for (Vec3& p : next.positions) p = {moved(p.x, by, 0), moved(p.y, 1, 0), moved(p.z, by, 1)};
    const double growth = frames.refit(next.positions, one_thread()).area_ratio;
    expect(growth >= 0 && growth <= double(frames.count()), "clusters larger than the whole");
    frames.rebuild_worst(next.positions, 1 + in.below(20), one_thread());
    frames.update(next.positions, one_thread());
    return frames.count();
  });
}

void levels(Input& in, const Mesh& mesh) {
  umbel::lod::Config config;
  config.max_triangles = 4 + in.below(28);
  config.max_vertices = 6 + in.below(28);
  config.min_group = 2 + in.below(2);
  config.max_group = config.min_group + in.below(4);
  config.measured_error = in.below(2) != 0;
  config.keep_area = in.below(2) != 0;
  if (in.below(4) == 0)
    config.position_step = std::ldexp(1.0f, static_cast<int>(in.below(160)) - 120);
  const auto dag =
      unless_refused([&] { return umbel::lod::build(mesh.view(), config, one_thread()); });
  if (!dag) return;
  for (const umbel::lod::Group& group : dag->tables.groups)
    expect(group.error >= 0, "an error that is no distance");
}

void check_rays(Input& in, const Mesh& mesh, const umbel::TriangleQueries& tree) {
  const umbel::Aabb box = tree.bounds();
  for (uint32_t i = 0; i < 8; ++i) {
    const float share = static_cast<float>(in.below(9)) / 8;
    const Vec3 to = mesh.positions.empty() ? Vec3{0, 0, 0}
                                           : mesh.positions[in.below(255) % mesh.positions.size()];
    const Vec3 from{box.min.x * share + box.max.x * (1 - share), box.max.y, box.min.z};
    const umbel::Ray ray{from, 0, {to.x - from.x, to.y - from.y, to.z - from.z}};
    const umbel::Hit hit = tree.intersect(ray);
    expect(!hit.hit() || hit.primitive < mesh.triangles.size(), "a hit of no triangle");
    expect(tree.occluded(ray) == hit.hit(), "closest and any hit disagree");
    const auto closest = tree.closest_point(to);
    expect(closest.primitive == umbel::kNone || closest.primitive < mesh.triangles.size(),
           "a closest point on no triangle");
    tree.contains(from);
    tree.overlaps(umbel::Sphere{to, std::fabs(share * box.max.x)});
  }
}

template <typename Structure, typename Config>
void build_and_check_rays(Input& in, const Mesh& mesh, const Config& config) {
  const auto structure =
      unless_refused([&] { return Structure::build(mesh.view(), config, {}, one_thread()); });
  if (structure) check_rays(in, mesh, *structure);
}

void hierarchies(Input& in, const Mesh& mesh) {
  umbel::BvhConfig config;
  config.width = 2u << in.below(3);
  config.compact = in.below(2) != 0;
  config.tree = umbel::bvh::preset(in.below(2) ? "fast" : "quality");
  const auto builders = umbel::bvh::builders();
  if (in.below(4)) config.tree.builder = builders[in.below(255) % builders.size()];
  build_and_check_rays<umbel::Bvh>(in, mesh, config);
}

void other_structures(Input& in, const Mesh& mesh) {
  const bool compact = in.below(2) != 0;
  switch (in.below(4)) {
    case 0: {
      umbel::uniform::GridConfig config;
      config.compact = compact;
      build_and_check_rays<umbel::uniform::TwoLevelGrid>(in, mesh, config);
      break;
    }
    case 1: {
      umbel::uniform::IntervalConfig config;
      config.compact = compact;
      build_and_check_rays<umbel::uniform::IntervalHierarchy>(in, mesh, config);
      break;
    }
    case 2: {
      umbel::uniform::OctreeConfig config;
      config.compact = compact;
      build_and_check_rays<umbel::uniform::Octree>(in, mesh, config);
      break;
    }
    default: {
      umbel::kdtree::KdTreeConfig config;
      config.compact = compact;
      if (in.below(2)) config.tree.builder = umbel::kdtree::Builder::kBinned;
      build_and_check_rays<umbel::kdtree::KdTree>(in, mesh, config);
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Input in(data, size);
  constexpr std::array kSubjects{cluster, cluster_frames, levels, hierarchies, other_structures};
  const auto subject = kSubjects[in.below(kSubjects.size())];
  subject(in, scaled_shape(in));
  return 0;
}
