// Calls of the C interface's levels of detail, on small meshes.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <vector>

#include "umbel/lod.hpp"
#include "umbel/umbel.h"

namespace umbel::lod_call {

inline umbel_lod_mesh c_mesh(const Mesh& mesh) {
  umbel_lod_mesh result;
  umbel_lod_mesh_init(&result);
  result.positions = reinterpret_cast<const umbel_vec3*>(mesh.positions.data());
  result.position_count = mesh.positions.size();
  result.triangles = mesh.triangles[0].data();
  result.triangle_count = mesh.triangles.size();
  if (!mesh.uvs.empty()) result.uvs = reinterpret_cast<const umbel_vec2*>(mesh.uvs.data());
  if (!mesh.materials.empty()) result.materials = mesh.materials.data();
  return result;
}

inline umbel_lod_config small_config() {
  umbel_lod_config config;
  umbel_lod_config_init(&config);
  config.max_triangles = 32;
  config.max_vertices = 64;
  config.min_group = 4;
  config.max_group = 8;
  return config;
}

inline lod::Config small_cpp_config() {
  lod::Config config;
  config.max_triangles = 32;
  config.max_vertices = 64;
  config.min_group = 4;
  config.max_group = 8;
  return config;
}

inline Mesh blob() {
  Mesh mesh = shapes::blob(4, 5);
  for (const Vec3& p : mesh.positions) mesh.uvs.push_back({p.x, p.y});
  return mesh;
}

struct Free {
  void operator()(umbel_lod* lod) const { umbel_lod_free(lod); }
  void operator()(umbel_lod_tables* tables) const { umbel_lod_tables_free(tables); }
  void operator()(umbel_mesh* mesh) const { umbel_mesh_free(mesh); }
};

inline std::unique_ptr<umbel_lod, Free> built(const umbel_lod_mesh& given,
                                              const umbel_lod_config& config,
                                              uint32_t threads = 0) {
  umbel_build_options options;
  umbel_build_options_init(&options);
  options.threads = threads;
  umbel_lod* lod = nullptr;
  EXPECT_EQ(umbel_lod_build(&given, &config, &options, &lod), UMBEL_OK) << umbel_last_error();
  return std::unique_ptr<umbel_lod, Free>(lod);
}
inline std::unique_ptr<umbel_lod, Free> built(const Mesh& mesh, const umbel_lod_config& config,
                                              uint32_t threads = 0) {
  return built(c_mesh(mesh), config, threads);
}

inline void expect_groups_of(const lod::Dag& dag, const umbel_lod* lod) {
  umbel_lod_arrays arrays;
  umbel_lod_arrays_init(&arrays);
  ASSERT_EQ(umbel_lod_tables_arrays(umbel_lod_get_tables(lod), &arrays), UMBEL_OK);
  ASSERT_EQ(arrays.group_count, dag.tables.groups.size());
  EXPECT_EQ(std::memcmp(arrays.groups, dag.tables.groups.data(),
                        arrays.group_count * sizeof *arrays.groups),
            0);
}

inline std::vector<uint32_t> selected(const umbel_lod_tables* tables, const umbel_lod_view& view,
                                      const umbel_lod_culling* culling, umbel_lod_method method) {
  size_t count = 0;
  EXPECT_EQ(umbel_lod_select(tables, &view, culling, method, nullptr, 0, &count), UMBEL_OK);
  std::vector<uint32_t> cut(count);
  EXPECT_EQ(umbel_lod_select(tables, &view, culling, method, cut.data(), count, &count), UMBEL_OK);
  return cut;
}

/// A view's cut as a mesh.
struct CutMesh {
  CutMesh(const umbel_lod* lod, const umbel_lod_view& view) {
    const auto cut = selected(umbel_lod_get_tables(lod), view, nullptr, UMBEL_LOD_HIERARCHY);
    umbel_mesh* made = nullptr;
    EXPECT_EQ(umbel_lod_mesh_of_cut(lod, cut.data(), cut.size(), &made), UMBEL_OK);
    owner.reset(made);
    umbel_lod_mesh_init(&arrays);
    EXPECT_EQ(umbel_mesh_arrays(made, &arrays), UMBEL_OK);
  }

  std::unique_ptr<umbel_mesh, Free> owner;
  umbel_lod_mesh arrays;
};

}  // namespace umbel::lod_call
