// Trees over boxes beside each other: a kd-tree (umbel/kdtree_traverse.hpp) and a binary BVH
// (umbel/bvh_traverse.hpp) over the boxes of a mesh's triangles, which the caller intersects. For
// both: the time of a build, entries of leaves, and rays a second.
//
//   box_trees_bench [--runs N] [--size PIXELS] MESH...
//
// One thread, processor time, medians of runs in which the trees take turns. Rays are those of
// three views, and one diffuse ray from each of their hits; all trees must give the same distances.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

#include "arguments.hpp"
#include "base/math.hpp"
#include "clocks.hpp"
#include "mesh_reader.hpp"
#include "umbel/bvh_presets.hpp"
#include "umbel/bvh_traverse.hpp"
#include "umbel/kdtree_traverse.hpp"
#include "umbel/mesh.hpp"
#include "umbel/triangle_bvh.hpp"
#include "view_rays.hpp"

namespace {

using namespace umbel;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
const BuildOptions kOneThread{.progress = {}, .threads = 1};

struct Rays {
  std::vector<Ray> primary, bounces;
};

/// Moeller & Trumbore, "Fast, minimum storage ray-triangle intersection", 1997.
float distance(const Mesh& mesh, uint32_t triangle, const Ray& ray) {
  const Triangle& t = mesh.triangles[triangle];
  const Vec3 p0 = mesh.positions[t[0]], a = mesh.positions[t[1]] - p0,
             b = mesh.positions[t[2]] - p0;
  const Vec3 p = cross(ray.direction, b);
  const float inverse = 1 / dot(a, p);
  const Vec3 from = ray.origin - p0;
  const float u = dot(from, p) * inverse;
  const Vec3 q = cross(from, a);
  const float v = dot(ray.direction, q) * inverse, at = dot(b, q) * inverse;
  return u >= 0 && v >= 0 && u + v <= 1 && at >= ray.t_min ? at : kInfinity;
}

float nearest_of(const Mesh& mesh, const Ray& ray, std::span<const uint32_t> primitives,
                 float nearest) {
  for (const uint32_t i : primitives) nearest = std::min(nearest, distance(mesh, i, ray));
  return nearest;
}

/// Where a ray enters a box, by slabs (Kay & Kajiya 1986), up to rounding; NaN is outside.
struct Slabs {
  explicit Slabs(const Ray& r)
      : ray(r), inverse{1 / r.direction.x, 1 / r.direction.y, 1 / r.direction.z} {}
  float operator()(const bvh::Node& node) const {
    const Vec3 a = node.min - ray.origin, b = node.max - ray.origin;
    const float x0 = a.x * inverse.x, x1 = b.x * inverse.x, y0 = a.y * inverse.y,
                y1 = b.y * inverse.y, z0 = a.z * inverse.z, z1 = b.z * inverse.z;
    const float from = std::max({std::min(x0, x1), std::min(y0, y1), std::min(z0, z1), ray.t_min});
    const float to = std::min({std::max(x0, x1), std::max(y0, y1), std::max(z0, z1)});
    return from <= to * (1 + 0x1p-20f) ? from * (1 - 0x1p-20f) : kInfinity;
  }
  const Ray& ray;
  Vec3 inverse;
};

float trace(const bvh::Bvh2& tree, const Mesh& mesh, const Ray& ray) {
  float nearest = kInfinity;
  bvh::traverse_ordered(tree, Slabs(ray), [&](std::span<const uint32_t> primitives) {
    return nearest = nearest_of(mesh, ray, primitives, nearest);
  });
  return nearest;
}

float trace(const kdtree::Tree& tree, const Mesh& mesh, const Ray& ray) {
  float nearest = kInfinity;
  kdtree::traverse(tree, ray, [&](std::span<const uint32_t> primitives) {
    return nearest = nearest_of(mesh, ray, primitives, nearest);
  });
  return nearest;
}

/// A tree and what was measured of it.
template <typename Tree>
class Measured {
 public:
  Measured(std::string name, Tree (*build)(std::span<const Aabb>))
      : name_(std::move(name)), build_(build) {}

  void run(const Mesh& mesh, std::span<const Aabb> boxes, const Rays& rays) {
    seconds_[0].push_back(timed([&] { tree_ = build_(boxes); }));
    trace_all(1, mesh, rays.primary);
    trace_all(2, mesh, rays.bounces);
  }
  /// The distances along the last rays.
  const std::vector<float>& found() const { return found_; }

  void print(const std::string& label, size_t triangles, const Rays& rays) const {
    const auto rate = [&](int which, size_t count) {
      return 1e-6 * double(count) / bench::median(seconds_[which]);
    };
    std::printf("| %s | %s | %.2f | %.2f | %.2f | %.2f |\n", label.c_str(), name_.c_str(),
                1e9 * bench::median(seconds_[0]) / double(triangles),
                double(references(tree_)) / double(triangles), rate(1, rays.primary.size()),
                rate(2, rays.bounces.size()));
  }

 private:
  template <typename Work>
  static double timed(const Work& work) {
    const double start = bench::thread_seconds();
    work();
    return bench::thread_seconds() - start;
  }
  static size_t references(const bvh::Bvh2& tree) { return tree.primitives.size(); }
  static size_t references(const kdtree::Tree& tree) { return kdtree::statistics(tree).references; }

  void trace_all(int which, const Mesh& mesh, const std::vector<Ray>& rays) {
    found_.resize(rays.size());
    seconds_[which].push_back(timed([&] {
      for (size_t i = 0; i < rays.size(); ++i) found_[i] = trace(tree_, mesh, rays[i]);
    }));
  }

  std::string name_;
  Tree (*build_)(std::span<const Aabb>);
  Tree tree_;
  std::array<std::vector<double>, 3> seconds_;  ///< build, primary, bounces
  std::vector<float> found_;
};

bvh::Bvh2 build_bvh(std::span<const Aabb> boxes) { return bvh::build(boxes, {}, kOneThread); }
bvh::Bvh2 build_best_bvh(std::span<const Aabb> boxes) {
  bvh::Config config;
  config.reinsertion_rounds = 2;
  return bvh::build(boxes, config, kOneThread);
}
template <uint32_t leaf_size>
kdtree::Tree build_kdtree(std::span<const Aabb> boxes) {
  kdtree::Config config;
  config.target_leaf_size = leaf_size;
  return kdtree::build(boxes, config, kOneThread);
}

void measure(const std::string& label, const Mesh& mesh, int runs, uint32_t size) {
  const std::vector<Aabb> boxes = triangle_boxes(mesh.view(), kOneThread);
  Rays rays{bench::primary_rays(mesh, size), {}};
  std::vector<Hit> hits(rays.primary.size());
  const Bvh truth = Bvh::build(mesh.view());
  for (size_t i = 0; i < hits.size(); ++i) hits[i] = truth.intersect(rays.primary[i]);
  rays.bounces = bench::bounce_rays(mesh, rays.primary, hits);
  Measured<bvh::Bvh2> plain("BVH", build_bvh), best("BVH, reinsertion", build_best_bvh);
  Measured<kdtree::Tree> kd("kd-tree", build_kdtree<0>),
      leafy("kd-tree, target_leaf_size 8", build_kdtree<8>);
  for (int run = 0; run < runs; ++run) {
    plain.run(mesh, boxes, rays);
    best.run(mesh, boxes, rays);
    kd.run(mesh, boxes, rays);
    leafy.run(mesh, boxes, rays);
    size_t others = 0;
    for (size_t i = 0; i < rays.bounces.size(); ++i)
      others += plain.found()[i] != kd.found()[i] || best.found()[i] != kd.found()[i] ||
                leafy.found()[i] != kd.found()[i];
    if (others > 0) std::printf("%s: %zu rays have another distance\n", label.c_str(), others);
  }
  plain.print(label, boxes.size(), rays);
  best.print(label, boxes.size(), rays);
  kd.print(label, boxes.size(), rays);
  leafy.print(label, boxes.size(), rays);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  int runs = 3;
  uint32_t size = 200;
  const auto files = bench::read_arguments(
      argc, argv,
      {{"--runs", [&](uint64_t n) { runs = static_cast<int>(n); }},
       {"--size", [&](uint64_t n) { size = static_cast<uint32_t>(n + 3) / 4 * 4; }}},
      "[--runs N] [--size PIXELS] MESH...");
  std::printf(
      "| | tree | build, ns/box | entries of leaves/box | primary, M rays/s | bounce, M rays/s "
      "|\n");
  std::printf("|---|---|--:|--:|--:|--:|\n");
  for (const std::string& file : files)
    measure(bench::file_name(file), bench::read_mesh(file), runs, size);
}
