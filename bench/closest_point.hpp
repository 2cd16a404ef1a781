// How far a surface is from another: points sampled uniformly by area on the one, the closest
// point of the other found by a bounding volume hierarchy.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <span>
#include <vector>

#include "base/math.hpp"
#include "base/parallel.hpp"
#include "umbel/mesh.hpp"

namespace bench {

using umbel::Aabb;
using umbel::Mesh;
using umbel::Vec3;

/// In double precision, so that distances far below an edge's length are still right.
struct Point {
  double x, y, z;
  Point operator+(const Point& o) const { return {x + o.x, y + o.y, z + o.z}; }
  Point operator-(const Point& o) const { return {x - o.x, y - o.y, z - o.z}; }
  Point operator*(double s) const { return {x * s, y * s, z * s}; }
};
inline double dot(const Point& a, const Point& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Point cross(const Point& a, const Point& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Point point(const Vec3& v) { return {v.x, v.y, v.z}; }

/// Squared distance to the segment from a to b.
inline double segment_distance2(const Point& p, const Point& a, const Point& b) {
  const Point ab = b - a;
  const double length2 = dot(ab, ab);
  const double t = length2 > 0 ? std::clamp(dot(p - a, ab) / length2, 0.0, 1.0) : 0.0;
  const Point d = p - (a + ab * t);
  return dot(d, d);
}

/// Squared distance to the triangle: to its plane where the foot is inside, else to its sides.
inline double triangle_distance2(const Point& p, const Point& a, const Point& b, const Point& c) {
  const Point n = cross(b - a, c - a);
  const double n2 = dot(n, n);
  if (n2 > 0 && dot(cross(b - a, p - a), n) >= 0 && dot(cross(c - b, p - b), n) >= 0 &&
      dot(cross(a - c, p - c), n) >= 0) {
    const double d = dot(p - a, n);
    return d * d / n2;
  }
  return std::min(
      {segment_distance2(p, a, b), segment_distance2(p, b, c), segment_distance2(p, c, a)});
}

inline double box_distance2(const Point& p, const Aabb& box) {
  const double x = std::max({box.min.x - p.x, p.x - box.max.x, 0.0});
  const double y = std::max({box.min.y - p.y, p.y - box.max.y, 0.0});
  const double z = std::max({box.min.z - p.z, p.z - box.max.z, 0.0});
  return x * x + y * y + z * z;
}

/// A median-split tree over triangles.
class ClosestPoint {
 public:
  explicit ClosestPoint(const Mesh& mesh) : mesh_(mesh), order_(mesh.triangles.size()) {
    for (uint32_t i = 0; i < order_.size(); ++i) order_[i] = i;
    nodes_.reserve(2 * order_.size());
    if (!order_.empty()) build(0, static_cast<uint32_t>(order_.size()));
  }

  double distance(const Vec3& from) const {
    const Point p = point(from);
    double best = std::numeric_limits<double>::infinity();
    if (!nodes_.empty()) search(0, p, best);
    return std::sqrt(best);
  }

 private:
  struct Node {
    Aabb box;
    uint32_t begin, count;  // triangles of a leaf; an inner node has none
    uint32_t right;         // the left child follows its parent
  };

  Aabb box_of(uint32_t triangle) const {
    Aabb box;
    for (const uint32_t v : mesh_.triangles[triangle]) umbel::extend(box, mesh_.positions[v]);
    return box;
  }

  uint32_t build(uint32_t begin, uint32_t end) {
    const uint32_t n = static_cast<uint32_t>(nodes_.size());
    Aabb box, centers;
    for (uint32_t i = begin; i < end; ++i) {
      const Aabb own = box_of(order_[i]);
      umbel::extend(box, own);
      umbel::extend(centers, umbel::center(own));
    }
    nodes_.push_back({box, begin, end - begin, 0});
    if (end - begin <= 4) return n;
    const Vec3 size = centers.max - centers.min;
    float Vec3::* axis = size.x >= size.y && size.x >= size.z ? &Vec3::x
                         : size.y >= size.z                   ? &Vec3::y
                                                              : &Vec3::z;
    const uint32_t middle = begin + (end - begin) / 2;
    std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                     [&](uint32_t a, uint32_t b) {
                       return umbel::center(box_of(a)).*axis < umbel::center(box_of(b)).*axis;
                     });
    nodes_[n].count = 0;
    build(begin, middle);
    nodes_[n].right = build(middle, end);
    return n;
  }

  void search(uint32_t n, const Point& p, double& best) const {
    const Node& node = nodes_[n];
    for (uint32_t i = node.begin; i < node.begin + node.count; ++i) {
      const umbel::Triangle& t = mesh_.triangles[order_[i]];
      best = std::min(
          best, triangle_distance2(p, point(mesh_.positions[t[0]]), point(mesh_.positions[t[1]]),
                                   point(mesh_.positions[t[2]])));
    }
    if (node.count > 0) return;
    uint32_t near = n + 1, far = node.right;
    double near2 = box_distance2(p, nodes_[near].box), far2 = box_distance2(p, nodes_[far].box);
    if (far2 < near2) std::swap(near, far), std::swap(near2, far2);
    if (near2 < best) search(near, p, best);
    if (far2 < best) search(far, p, best);
  }

  const Mesh& mesh_;
  std::vector<uint32_t> order_;
  std::vector<Node> nodes_;
};

/// Points uniform by area, one in each of `count` equal shares of it.
inline std::vector<Vec3> sample_surface(const Mesh& mesh, size_t count, uint32_t seed) {
  std::vector<double> areas;
  double total = 0;
  for (const umbel::Triangle& t : mesh.triangles) {
    const Point a = point(mesh.positions[t[0]]);
    const Point n = cross(point(mesh.positions[t[1]]) - a, point(mesh.positions[t[2]]) - a);
    areas.push_back(total += 0.5 * std::sqrt(dot(n, n)));
  }
  std::vector<Vec3> samples;
  if (!(total > 0)) return samples;
  std::mt19937_64 random(seed);
  const auto uniform = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
  for (size_t i = 0; i < count; ++i) {
    const double at = total * (static_cast<double>(i) + uniform()) / static_cast<double>(count);
    const size_t k = std::min<size_t>(
        std::upper_bound(areas.begin(), areas.end(), at) - areas.begin(), areas.size() - 1);
    const umbel::Triangle& t = mesh.triangles[k];
    const double root = std::sqrt(uniform()), v = uniform();
    const Point p = point(mesh.positions[t[0]]) * (1 - root) +
                    point(mesh.positions[t[1]]) * (root * (1 - v)) +
                    point(mesh.positions[t[2]]) * (root * v);
    samples.push_back({static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)});
  }
  return samples;
}

/// Of distances, in the meshes' unit.
struct Deviation {
  double mean = 0, rms = 0, max = 0;
};

/// From samples of one mesh to another.
inline Deviation deviation(const Mesh& from, const ClosestPoint& to, size_t samples,
                           uint32_t seed) {
  const std::vector<Vec3> points = sample_surface(from, samples, seed);
  std::vector<double> distances(points.size());
  umbel::parallel_for(points.size(), 256, [&](size_t i) { distances[i] = to.distance(points[i]); });
  Deviation d;
  for (const double x : distances) {
    d.mean += x / static_cast<double>(points.size());
    d.rms += x * x / static_cast<double>(points.size());
    d.max = std::max(d.max, x);
  }
  d.rms = std::sqrt(d.rms);
  return d;
}

/// Both directions together, half of the samples each.
inline Deviation two_sided_deviation(const Mesh& a, const ClosestPoint& to_a, const Mesh& b,
                                     size_t samples) {
  const ClosestPoint to_b(b);
  const Deviation ab = deviation(a, to_b, samples / 2, 1), ba = deviation(b, to_a, samples / 2, 2);
  return {0.5 * (ab.mean + ba.mean), std::sqrt(0.5 * (ab.rms * ab.rms + ba.rms * ba.rms)),
          std::max(ab.max, ba.max)};
}

}  // namespace bench
