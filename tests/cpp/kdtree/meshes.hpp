// Meshes that are hard on kd-trees.
#pragma once

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "umbel/kdtree.hpp"
#include "umbel/mesh.hpp"

namespace umbel::testing {

inline constexpr kdtree::Traversal kTraversals[] = {
    kdtree::Traversal::kStack, kdtree::Traversal::kRopes, kdtree::Traversal::kShortStack};

struct NamedMesh {
  std::string name;
  Mesh mesh;
};

inline void add_triangle(Mesh& mesh, const Vec3& a, const Vec3& b, const Vec3& c) {
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {a, b, c});
  mesh.triangles.push_back({first, first + 1, first + 2});
}

/// An axis-aligned box of two triangles a side.
inline void add_box(Mesh& mesh, const Vec3& low, const Vec3& high) {
  const auto corner = [&](int i) {
    return Vec3{i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z};
  };
  constexpr int kSides[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (const auto& s : kSides) {
    add_triangle(mesh, corner(s[0]), corner(s[1]), corner(s[2]));
    add_triangle(mesh, corner(s[0]), corner(s[2]), corner(s[3]));
  }
}

/// A hall of boxes on a lattice: all planes are shared, all triangles are flat.
inline Mesh boxes(uint32_t side) {
  Mesh mesh;
  add_box(mesh, {0, 0, 0}, {float(side), float(side), 1});
  for (uint32_t x = 0; x < side; ++x)
    for (uint32_t y = 0; y < side; ++y)
      add_box(mesh, {float(x) + 0.25f, float(y) + 0.25f, 0},
              {float(x) + 0.75f, float(y) + 0.75f, 0.25f * float(1 + (x + y) % 3)});
  return mesh;
}

inline Mesh concentric(uint32_t count) {
  Mesh mesh;
  for (uint32_t i = 0; i < count; ++i) {
    const float s = 1 + float(i) / float(count), a = float(i) * 0.7f;
    const auto corner = [&](float angle) {
      return Vec3{s * std::cos(a + angle), s * std::sin(a + angle), s * std::sin(2 * a + angle)};
    };
    const Vec3 p = corner(0), q = corner(2.0943951f);
    add_triangle(mesh, p, q, {-p.x - q.x, -p.y - q.y, -p.z - q.z});
  }
  return mesh;
}

inline Mesh identical(uint32_t count) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0.25f, 0}, {0, 1, 0.5f}};
  mesh.triangles.assign(count, {0, 1, 2});
  return mesh;
}

inline Mesh needles(uint32_t count) {
  Mesh mesh;
  std::mt19937 random(7);
  std::uniform_real_distribution<float> unit(-1, 1);
  for (uint32_t i = 0; i < count; ++i) {
    const Vec3 p{unit(random), unit(random), unit(random)},
        q{unit(random), unit(random), unit(random)};
    add_triangle(mesh, p, q, {q.x + 1e-5f, q.y, q.z - 1e-5f});
  }
  return mesh;
}

inline Mesh on_a_line(uint32_t count) {
  Mesh mesh;
  for (uint32_t i = 0; i < count; ++i)
    add_triangle(mesh, {float(i), 0, 0}, {float(i) + 0.5f, 0, 0}, {float(i) + 2, 0, 0});
  return mesh;
}

inline std::vector<NamedMesh> hard_meshes() {
  return {{"sphere", shapes::sphere(3)},   {"torus", shapes::torus(24, 15)},
          {"soup", shapes::soup(300, 1)},  {"flat grid", shapes::grid(9, 7)},
          {"fan", shapes::fan(200)},       {"boxes", boxes(5)},
          {"concentric", concentric(120)}, {"identical", identical(70)},
          {"needles", needles(150)},       {"on a line", on_a_line(40)},
          {"blob", shapes::blob(3, 5)},    {"one triangle", shapes::soup(1, 5)}};
}

/// Triangles that no planes tell apart.
inline std::vector<NamedMesh> inseparable_meshes() {
  return {{"concentric", concentric(4000)},
          {"identical", identical(10000)},
          {"needles", needles(4000)},
          {"fan", shapes::fan(10000)},
          {"on a line", on_a_line(5000)}};
}

/// Runs check(mesh) on each of the hard meshes.
template <typename Check>
void for_hard_meshes(const Check& check) {
  for (const NamedMesh& named : hard_meshes()) {
    SCOPED_TRACE(named.name);
    check(named.mesh.view());
  }
}

/// Files of what structures fail on most easily.
inline constexpr const char* kNastyFiles[] = {
    "nasty_synth_all_degenerate.ply",    "nasty_mpi_180.ply",
    "nasty_office_chair_7k.ply",         "nasty_synth_t_junctions.ply",
    "nasty_synth_dragon_tiny.ply",       "nasty_synth_dragon_scale_1e15.ply",
    "nasty_synth_same_centroid_20k.ply", "nasty_synth_dragon_ecef_f32.ply"};

}  // namespace umbel::testing
