// What k-means clustering computes with (Meister & Bittner, "Parallel BVH Construction using
// k-means Clustering", 2016): boxes as points of six dimensions, their distances, sums that do not
// depend on the order of addition, and random numbers that depend on nothing but the cluster.
#pragma once

#include <cmath>
#include <cstdint>
#include <type_traits>

#include "base/exec.hpp"
#include "base/hash.hpp"
#include "base/math.hpp"
#include "umbel/bvh.hpp"

namespace umbel::bvh {

/// A box as a point of six dimensions.
struct KmeansPoint {
  float v[6];
};

/// Boxes with one column a component, and the primitives that they belong to.
struct KmeansPoints {
  float* column[6];
  uint32_t* primitives;

  UMBEL_HOST_DEVICE KmeansPoint at(size_t i) const {
    KmeansPoint p;
    for (int c = 0; c < 6; ++c) p.v[c] = column[c][i];
    return p;
  }
  UMBEL_HOST_DEVICE Aabb box(size_t i) const {
    return {{column[0][i], column[1][i], column[2][i]}, {column[3][i], column[4][i], column[5][i]}};
  }
  UMBEL_HOST_DEVICE void put(size_t i, const Aabb& box, uint32_t primitive) const {
    column[0][i] = box.min.x, column[1][i] = box.min.y, column[2][i] = box.min.z;
    column[3][i] = box.max.x, column[4][i] = box.max.y, column[5][i] = box.max.z;
    primitives[i] = primitive;
  }
};

template <KmeansDistance kDistance>
UMBEL_HOST_DEVICE inline float distance_along(float a, float b) {
  const float d = a - b;
  if constexpr (kDistance == KmeansDistance::kEuclidean) return d * d;
  return d < 0 ? -d : d;
}

/// Summed in the order of the components, here as everywhere.
template <KmeansDistance kDistance>
UMBEL_HOST_DEVICE inline float kmeans_distance(const KmeansPoint& a, const KmeansPoint& b) {
  float sum = distance_along<kDistance>(a.v[0], b.v[0]);
  for (int c = 1; c < 6; ++c) sum += distance_along<kDistance>(a.v[c], b.v[c]);
  return sum;
}

/// Coordinates as integers, so that sums of them are exact.
struct KmeansGrid {
  float origin[3];
  float scale;  ///< a power of two: 2^30 or less for the longest side of the scene
  double cell;  ///< 1 / scale

  static KmeansGrid around(const Aabb& scene) {
    const Vec3 extent = scene.max - scene.min;
    const float longest = std::max({extent.x, extent.y, extent.z});
    // The floor of the logarithm is at most one too small, so cells stay below 2^31.
    const int exponent = longest > 0 ? std::clamp(29 - std::ilogb(longest), -100, 120) : 0;
    return {{scene.min.x, scene.min.y, scene.min.z},
            std::ldexp(1.0f, exponent),
            std::ldexp(1.0, -exponent)};
  }
  UMBEL_HOST_DEVICE int32_t cell_of(float value, uint32_t component) const {
    // Halved, so that the largest floats have a difference.
    return static_cast<int32_t>((value * 0.5f - origin[component % 3] * 0.5f) * (2 * scale));
  }
  UMBEL_HOST_DEVICE float mean(int64_t sum, uint32_t count, uint32_t component) const {
    const double size = cell / static_cast<double>(count);
    return static_cast<float>(static_cast<double>(origin[component % 3]) +
                              static_cast<double>(sum) * size);
  }
};

/// The sum of the cells of one representative's items.
struct KmeansSum {
  int64_t v[6];
};

/// Random numbers that depend on nothing but the cluster's range.
struct KmeansDice {
  uint64_t key;

  UMBEL_HOST_DEVICE static KmeansDice of_cluster(uint32_t offset, uint32_t count) {
    return {mix64(uint64_t(offset) << 32 | count)};
  }
  /// Uniform in [0, count).
  UMBEL_HOST_DEVICE uint32_t draw(uint32_t number, uint32_t count) const {
    return static_cast<uint32_t>(((mix64(key + number) >> 32) * count) >> 32);
  }
};

/// A cluster, and the smaller ones that it was divided into.
struct KmeansCluster {
  uint32_t offset, count;  ///< of its items
  uint32_t first = 0, parts = 0;
};

/// k, at most, on a device, whose teams share little memory, and in k-ary trees.
constexpr uint32_t kMostKmeansClusters = 64;
/// k, at most, on a processor.
constexpr uint32_t kMostKmeansClustersOnCpu = 1024;

/// The number of a representative, of at most kMost.
template <uint32_t kMost>
using KmeansLabel = std::conditional_t<kMost <= 256, uint8_t, uint16_t>;

}  // namespace umbel::bvh
