// A call of the C interface's hierarchy functions that would succeed, to be broken in one place.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "umbel/triangle_bvh.hpp"
#include "umbel/umbel.h"

namespace umbel::bvh_call {

inline constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
inline constexpr float kInfinity = std::numeric_limits<float>::infinity();

struct Free {
  void operator()(umbel_bvh* bvh) const { umbel_bvh_free(bvh); }
};
using Owned = std::unique_ptr<umbel_bvh, Free>;

inline umbel_vec3 vec(const Vec3& v) { return {v.x, v.y, v.z}; }

/// A soup that a ray meets many triangles of.
inline Mesh large_triangles(uint32_t count) {
  Mesh mesh;
  std::mt19937 random(7);
  std::uniform_real_distribution<float> unit(-1, 1);
  for (uint32_t i = 0; i < count; ++i) {
    for (int corner = 0; corner < 3; ++corner)
      mesh.positions.push_back({unit(random), unit(random), unit(random)});
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return mesh;
}

/// A mesh and the structs that stand for it.
struct Call {
  explicit Call(Mesh given = shapes::blob(3, 1)) : source(std::move(given)) {
    umbel_bvh_mesh_init(&mesh);
    umbel_bvh_config_init(&config);
    umbel_build_options_init(&options);
    point_at_source();
  }

  void point_at_source() {
    mesh.positions = reinterpret_cast<const umbel_vec3*>(source.positions.data());
    mesh.position_count = source.positions.size();
    mesh.triangles = source.triangles.empty() ? nullptr : source.triangles[0].data();
    mesh.triangle_count = source.triangles.size();
  }

  umbel_result build() {
    umbel_bvh* made = nullptr;
    const umbel_result result = umbel_bvh_build(&mesh, &config, &options, &made);
    bvh.reset(made);
    return result;
  }

  Mesh source;
  umbel_bvh_mesh mesh;
  umbel_bvh_config config;
  umbel_build_options options;
  Owned bvh;
};

/// A tree in arrays with room for what umbel_bvh2_requirements asks.
struct Tree {
  explicit Tree(size_t primitive_count, const umbel_bvh_config* config = nullptr) {
    umbel_bvh2_capacity_init(&needed);
    EXPECT_EQ(umbel_bvh2_requirements(primitive_count, config, &needed), UMBEL_OK)
        << umbel_last_error();
    nodes.assign(needed.nodes, {{0, 0, 0}, kNone, {0, 0, 0}, kNone});
    primitives.assign(needed.primitives, kNone);
    umbel_bvh2_init(&tree);
    tree.nodes = nodes.data();
    tree.node_capacity = nodes.size();
    tree.primitives = primitives.data();
    tree.primitive_capacity = primitives.size();
  }
  void expect_untouched() const {
    for (const umbel_bvh2_node& node : nodes) ASSERT_EQ(node.count, kNone);
    for (const uint32_t primitive : primitives) ASSERT_EQ(primitive, kNone);
  }

  umbel_bvh2_capacity needed;
  umbel_bvh2 tree;
  std::vector<umbel_bvh2_node> nodes;
  std::vector<uint32_t> primitives;
};

/// Rays through and beside the unit box.
inline std::vector<Ray> random_rays(size_t count, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(-1, 1);
  std::vector<Ray> rays;
  for (size_t i = 0; i < count; ++i)
    rays.push_back({{2 * unit(random), 2 * unit(random), 2 * unit(random)},
                    0,
                    {unit(random), unit(random), unit(random)}});
  return rays;
}

inline const umbel_ray* as_c(const std::vector<Ray>& rays) {
  return reinterpret_cast<const umbel_ray*>(rays.data());
}

inline bool same(const umbel_hit& a, const Hit& b) {
  return a.t == b.t && a.primitive == b.primitive && a.u == b.u && a.v == b.v;
}

/// A folder for files, gone afterwards.
class Folder {
 public:
  Folder() {
    path_ = std::filesystem::temp_directory_path() /
            ("umbel_capi_" + std::to_string(std::random_device{}()));
    std::filesystem::create_directory(path_);
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  std::string file(const char* name) const { return (path_ / name).string(); }
  bool is_empty() const { return std::filesystem::is_empty(path_); }

 private:
  std::filesystem::path path_;
};

inline void expect_failure(umbel_result result, umbel_result expected, const char* named) {
  EXPECT_EQ(result, expected) << umbel_last_error();
  EXPECT_NE(std::string(umbel_last_error()).find(named), std::string::npos)
      << "`" << umbel_last_error() << "` does not name " << named;
}

}  // namespace umbel::bvh_call
