// The functions of umbel/cuda_bvh.hpp: the algorithms of bvh/compressed on an executor.

#include "base/fields.hpp"
#include "base/printed.hpp"
#include "bvh/compressed/build_compact.hpp"
#include "bvh/tree/config.hpp"
#include "cuda/device_mesh.hpp"
#include "cuda/run.hpp"
#include "umbel/cuda_bvh.hpp"
#include "umbel/cuda_cluster_bvh.hpp"

namespace umbel::cuda {
namespace {

constexpr uint32_t kMostReferences = (1u << 28) - 8;

void check_bvh_config(const DeviceBvhConfig& c) {
  if (static_cast<uint32_t>(c.builder) > static_cast<uint32_t>(DeviceBuilder::kSweep))
    throw Error(ErrorCode::kInvalidArgument,
                "builder " + std::to_string(static_cast<uint32_t>(c.builder)) + " does not exist");
  if (c.max_leaf_size < 1 || c.max_leaf_size > 8)
    throw Error(ErrorCode::kInvalidArgument, "max_leaf_size is " + std::to_string(c.max_leaf_size) +
                                                 ", but must be from 1 to 8");
  if (!(c.presplit >= 0 && c.presplit <= 1))
    throw Error(ErrorCode::kInvalidArgument,
                "presplit is " + printed(c.presplit) + ", but must be from 0 to 1");
  bvh::Config same;
  COPY_FIELDS(same, c, cost, hlbvh_bits, ploc_radius, treelet_size, treelet_rounds, kmeans);
  bvh::check_config(same, 0);
  if (c.kmeans.clusters > bvh::kMostKmeansClusters)
    throw Error(ErrorCode::kInvalidArgument, "kmeans.clusters is " +
                                                 std::to_string(c.kmeans.clusters) +
                                                 ", but must be from 2 to 64 on a device");
}

bvh::CompactArrays view(const DeviceBvh& b) { return {b.nodes, b.triangles, b.info}; }

MeshCorners corners_of(const DeviceMesh& mesh) {
  return {positions_of(mesh), reinterpret_cast<const Triangle*>(mesh.indices)};
}

}  // namespace

DeviceBvhConfig device_builder_preset(std::string_view name) {
  constexpr std::string_view kNames[] = {"lbvh",  "hlbvh",  "atrbvh", "ploc",
                                         "hploc", "kmeans", "sweep"};
  const size_t dash = std::min(name.find('-'), name.size());
  DeviceBvhConfig config;
  uint32_t number = 0;
  while (number < std::size(kNames) && kNames[number] != name.substr(0, dash)) ++number;
  config.builder = static_cast<DeviceBuilder>(number);
  if (number == std::size(kNames) ||
      (dash < name.size() && config.builder != DeviceBuilder::kKmeans))
    throw Error(ErrorCode::kInvalidArgument,
                "there is no builder \"" + std::string(name) +
                    "\" on devices; the builders are lbvh, hlbvh, atrbvh, ploc, hploc, kmeans, "
                    "kmeans-q1 to kmeans-q5, sweep");
  if (dash < name.size()) config.kmeans = bvh::kmeans_preset(name.substr(dash + 1));
  return config;
}

uint32_t device_references(uint32_t triangles, const DeviceBvhConfig& config) {
  check_bvh_config(config);
  const auto more = static_cast<uint64_t>(double(triangles) * double(config.presplit));
  if (triangles + more > kMostReferences)
    throw Error(ErrorCode::kInvalidArgument, std::to_string(triangles + more) +
                                                 " triangles and parts of triangles are more "
                                                 "than the " +
                                                 std::to_string(kMostReferences) +
                                                 " that a tree can hold");
  return static_cast<uint32_t>(triangles + more);
}

void build_bvh(void* scratch, size_t& scratch_bytes, const DeviceMesh& mesh,
               const DeviceBvhConfig& config, const DeviceBvh& out, Stream stream) {
  device_references(mesh.triangles, config);
  const MeshCorners corners = corners_of(mesh);
  run(scratch, scratch_bytes, stream, mesh.positions, [&](auto& exec) {
    build_compact(exec, corners, mesh.items, mesh.triangles, config, view(out), NoStages{});
  });
}

void build_cluster_bvh(void* scratch, size_t& scratch_bytes, const DeviceMesh& mesh,
                       const FrameClusterConfig& cluster_config, const DeviceClusters& clusters,
                       const DeviceBvhConfig& config, const DeviceBvh& out, Stream stream) {
  device_references(mesh.triangles, config);
  const bool has_codes = config.builder == DeviceBuilder::kLbvh ||
                         config.builder == DeviceBuilder::kAtrbvh ||
                         config.builder == DeviceBuilder::kHploc;
  if (!has_codes || config.presplit != 0)
    throw Error(ErrorCode::kInvalidArgument,
                "a tree over clusters is built by lbvh, atrbvh or hploc, without presplit");
  const MeshCorners corners{positions_of(mesh),
                            reinterpret_cast<const Triangle*>(clusters.indices)};
  const bvh::ClusterRanges ranges{clusters.offsets, clusters.boxes, clusters.count,
                                  max_frame_clusters(mesh.triangles, cluster_config)};
  run(scratch, scratch_bytes, stream, mesh.positions, [&](auto& exec) {
    build_compact(exec, corners, clusters.items, mesh.triangles, config, view(out), NoStages{},
                  ranges);
  });
}

void refit_bvh(void* scratch, size_t& scratch_bytes, const DeviceMesh& mesh,
               const DeviceBvhConfig& config, const DeviceBvh& bvh, Stream stream) {
  const uint32_t references = device_references(mesh.triangles, config);
  const MeshCorners corners = corners_of(mesh);
  if (references == 0) {
    run(scratch, scratch_bytes, stream, mesh.positions, [](auto&) {});
    return;
  }
  run(scratch, scratch_bytes, stream, mesh.positions,
      [&](auto& exec) { refit_triangles(exec, corners, references, view(bvh)); });
}

}  // namespace umbel::cuda
