// Hierarchies of triangles built on CUDA devices, in the form of compact_bvh.hpp, with the bytes
// that the same algorithms give on the processor. Part of the library umbel::cuda.
//
// What cuda_types.hpp says of pointers, streams, scratch memory and errors holds here too, but that
// two builders read sizes back while they build, and so wait for the stream and cannot be captured
// in a graph: see DeviceBuilder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "umbel/bvh.hpp"
#include "umbel/compact_bvh.hpp"
#include "umbel/cuda_types.hpp"

namespace umbel::cuda {

enum class DeviceBuilder : uint32_t {
  kLbvh,    ///< linear BVH (Karras 2012, Apetrei 2014): the fastest
  kHlbvh,   ///< hierarchical LBVH (Garanzha et al. 2011): SAH above 15-bit treelets
  kAtrbvh,  ///< an LBVH whose treelets are restructured (Domingues & Pedrini 2015)
  kPloc,    ///< locally-ordered clustering (Meister & Bittner 2018); waits
  kHploc,   ///< the same in one kernel (Benthin et al. 2024): the best for its time
  kKmeans,  ///< k-means (Meister & Bittner 2016); waits
  kSweep,   ///< full-sweep SAH: the reference, slow for large meshes
};

/// What each builder takes beside cost and max_leaf_size:
///
// clang-format off
/// | builder | field                               | range  | default |
/// |---------|-------------------------------------|--------|---------|
/// | hlbvh   | hlbvh_bits                          | 3..30  | 15      |
/// | atrbvh  | treelet_size                        | 3..15  | 9       |
/// | atrbvh  | treelet_rounds                      | 1..16  | 2       |
/// | ploc    | ploc_radius                         | 1..128 | 16      |
/// | hploc   | ploc_radius, of at most 32 clusters | 1..128 | 16      |
/// | kmeans  | kmeans                              |        |         |
// clang-format on
struct DeviceBvhConfig {
  DeviceBuilder builder = DeviceBuilder::kHploc;
  bvh::CostModel cost;
  uint32_t max_leaf_size = 8;  ///< most triangles a leaf, 1..8; how many is chosen by cost
  /// Early splitting (Karras & Aila 2013): as many more references as this part of the triangles,
  /// 0..1; 0: none. For meshes of large, long triangles.
  float presplit = 0;
  uint32_t hlbvh_bits = 15;
  uint32_t treelet_size = 9;
  uint32_t treelet_rounds = 2;
  uint32_t ploc_radius = 16;
  bvh::KmeansConfig kmeans;
};

/// "lbvh", "hlbvh", "atrbvh", "ploc", "hploc", "kmeans", "kmeans-q1" to "kmeans-q5", "sweep".
/// Throws kInvalidArgument for others.
UMBEL_API DeviceBvhConfig device_builder_preset(std::string_view name);

/// A tree in arrays of the caller's, on the device.
struct DeviceBvh {
  bvh::CompactNode* nodes;          ///< room for compact_node_capacity(device_references(...))
  bvh::CompactTriangle* triangles;  ///< room for device_references(...); both aligned to 16
  bvh::CompactInfo* info;           ///< one
};

/// Triangles in leaves of the tree over so many: more only with presplit.
UMBEL_API uint32_t device_references(uint32_t triangles, const DeviceBvhConfig& config);

/// Builds. Triangles are named by mesh.items, if given. Of the nodes, those from info->nodes on are
/// left as they were.
UMBEL_API void build_bvh(void* scratch, size_t& scratch_bytes, const DeviceMesh& mesh,
                         const DeviceBvhConfig& config, const DeviceBvh& out,
                         Stream stream = nullptr);

/// Makes triangles and boxes for new positions of the mesh that a tree was built over, which was
/// built without mesh.items; with presplit, all parts of a triangle get its whole box. The nodes
/// stay, and so does info->sah_cost.
UMBEL_API void refit_bvh(void* scratch, size_t& scratch_bytes, const DeviceMesh& mesh,
                         const DeviceBvhConfig& config, const DeviceBvh& bvh,
                         Stream stream = nullptr);

}  // namespace umbel::cuda
