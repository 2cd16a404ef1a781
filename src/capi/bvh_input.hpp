// What umbel_bvh.h's functions are given, as the C++ interface takes it.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "capi/arguments.hpp"
#include "umbel/triangle_bvh.hpp"
#include "umbel/umbel_bvh.h"

/// What a C caller holds.
struct umbel_bvh {
  umbel::Bvh bvh;
};

namespace umbel::capi {

/// The caller's config; the defaults where `config` is NULL.
BvhConfig bvh_config(const umbel_bvh_config* config);
umbel_bvh_config as_c(const BvhConfig& config);

/// The settings of k-means in a config for either processor.
template <typename Given>
bvh::KmeansConfig kmeans_config(const Given& given) {
  bvh::KmeansConfig kmeans;
  kmeans.clusters = given.kmeans_clusters;
  kmeans.candidates = given.kmeans_candidates;
  kmeans.iterations = given.kmeans_iterations;
  kmeans.distance =
      given.kmeans_manhattan ? bvh::KmeansDistance::kManhattan : bvh::KmeansDistance::kEuclidean;
  kmeans.forwarded_clusters = given.kmeans_forwarded_clusters;
  return kmeans;
}

struct BvhMesh {
  MeshView view;
  std::span<const uint32_t> masks;
  std::vector<Vec3> copied_positions;  ///< where the caller's have gaps
};
/// Views of the caller's arrays. What they hold is checked by who reads them.
BvhMesh bvh_mesh(const umbel_bvh_mesh* mesh);

}  // namespace umbel::capi
