// Clusters of meshes that change every frame, from C (umbel_frame_clusters.h).
#include <algorithm>
#include <cstring>

#include "capi/cluster_input.hpp"
#include "capi/frame_input.hpp"
#include "capi/hand_out.hpp"
#include "capi/structs.hpp"

/// What a C caller holds.
struct umbel_frame_clusterer {
  umbel::FrameClusterer clusters;
};

namespace umbel::capi {
namespace {

/// The caller's positions, and copies of them where they are apart.
class FramePositions {
 public:
  FramePositions(const umbel_vec3* positions, size_t count, size_t stride)
      : all_(strided<Vec3>(positions, count, stride, "positions", copies_)) {}
  std::span<const Vec3> all() const { return all_; }

 private:
  std::vector<Vec3> copies_;
  std::span<const Vec3> all_;
};

template <typename Work>
umbel_result each_frame(umbel_frame_clusterer* clusterer, const umbel_vec3* positions, size_t count,
                        size_t stride, const umbel_build_options* options,
                        const Work& work) noexcept {
  return guard([&] {
    FrameClusterer& clusters = required(clusterer, "clusterer").clusters;
    work(clusters, FramePositions(positions, count, stride).all(), build_options(options));
  });
}

}  // namespace

FrameClusterConfig frame_config(const umbel_frame_config* given) {
  const umbel_frame_config c = read_struct(given, "config");
  return {static_cast<FrameMethod>(c.method),
          c.max_triangles,
          c.min_triangles,
          limit(c.max_vertices),
          c.underfill_cost,
          c.code_bits};
}

}  // namespace umbel::capi

using namespace umbel::capi;

void umbel_frame_config_init_sized(umbel_frame_config* config, size_t size) {
  const umbel::FrameClusterConfig defaults;
  const umbel_frame_config all{sizeof all,
                               static_cast<uint32_t>(defaults.method),
                               defaults.max_triangles,
                               defaults.min_triangles,
                               defaults.max_vertices,
                               defaults.underfill_cost,
                               defaults.code_bits};
  init_sized(config, size, all);
}

umbel_result umbel_frame_max_clusters(uint32_t triangles, const umbel_frame_config* config,
                                      uint32_t* clusters) {
  return guard([&] {
    required(clusters, "clusters") = umbel::max_frame_clusters(triangles, frame_config(config));
  });
}

umbel_result umbel_frame_clusterer_create(const uint32_t* indices, size_t triangles,
                                          size_t vertices, const umbel_frame_config* config,
                                          umbel_frame_clusterer** clusterer) {
  return hand_out(clusterer, "clusterer", [&] {
    check_nameable(triangles, "triangles");
    const auto all = elements<const uint32_t>(indices, 3 * triangles, "indices");
    const std::span<const umbel::Triangle> of_mesh{
        reinterpret_cast<const umbel::Triangle*>(all.data()), all.size() / 3};
    return umbel_frame_clusterer{umbel::FrameClusterer(
        of_mesh, vertices, config ? frame_config(config) : umbel::FrameClusterConfig{})};
  });
}

void umbel_frame_clusterer_destroy(umbel_frame_clusterer* clusterer) { delete clusterer; }

umbel_result umbel_frame_clusterer_build(umbel_frame_clusterer* clusterer,
                                         const umbel_vec3* positions, size_t position_count,
                                         size_t position_stride,
                                         const umbel_build_options* options) {
  return each_frame(clusterer, positions, position_count, position_stride, options,
                    [](auto& c, auto all, const auto& o) { c.build(all, o); });
}

umbel_result umbel_frame_clusterer_update(umbel_frame_clusterer* clusterer,
                                          const umbel_vec3* positions, size_t position_count,
                                          size_t position_stride,
                                          const umbel_build_options* options) {
  return each_frame(clusterer, positions, position_count, position_stride, options,
                    [](auto& c, auto all, const auto& o) { c.update(all, o); });
}

umbel_result umbel_frame_clusterer_refit(umbel_frame_clusterer* clusterer,
                                         const umbel_vec3* positions, size_t position_count,
                                         size_t position_stride,
                                         const umbel_build_options* options) {
  return each_frame(clusterer, positions, position_count, position_stride, options,
                    [](auto& c, auto all, const auto& o) { c.refit(all, o); });
}

umbel_result umbel_frame_clusterer_rebuild_worst(umbel_frame_clusterer* clusterer,
                                                 const umbel_vec3* positions, size_t position_count,
                                                 size_t position_stride, uint32_t clusters,
                                                 const umbel_build_options* options) {
  return each_frame(clusterer, positions, position_count, position_stride, options,
                    [&](auto& c, auto all, const auto& o) { c.rebuild_worst(all, clusters, o); });
}

umbel_result umbel_frame_clusterer_get(const umbel_frame_clusterer* clusterer,
                                       umbel_frame_clusters* clusters) {
  return guard([&] {
    const umbel::FrameClusterer& c = required(clusterer, "clusterer").clusters;
    const umbel::AreaGrowth growth = c.area_growth();
    required(clusters, "clusters") = {
        c.count(),          c.items().size(),
        c.items().data(),   reinterpret_cast<const uint32_t*>(c.triangles().data()),
        c.offsets().data(), reinterpret_cast<const umbel_aabb*>(c.boxes().data()),
        growth.area_ratio,  growth.area_ratio_at_build};
  });
}

umbel_result umbel_frame_clusterer_vertices(const umbel_frame_clusterer* clusterer,
                                            uint32_t* offsets, uint32_t* vertices, uint8_t* corners,
                                            size_t capacity, size_t* count,
                                            const umbel_build_options* options) {
  if (count) *count = 0;
  return guard([&] {
    const umbel::FrameVertexLists lists = umbel::list_frame_vertices(
        required(clusterer, "clusterer").clusters, build_options(options));
    hand_out_all(lists.vertices, vertices, "vertices", capacity, count);
    if (offsets) std::ranges::copy(lists.vertex_offsets, offsets);
    if (corners && !lists.corners.empty())
      std::memcpy(corners, lists.corners.data(), 3 * lists.corners.size());
  });
}
