#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <random>

#include "base/math.hpp"
#include "lod/simplify/collapse/collapse.hpp"
#include "umbel/mesh.hpp"

namespace umbel::lod {
namespace {

/// A mesh as one sub-mesh, nothing locked but what a test locks.
struct SubMesh {
  explicit SubMesh(Mesh m) : mesh(std::move(m)) {
    position_of.resize(mesh.positions.size());
    std::iota(position_of.begin(), position_of.end(), 0u);
    locked.assign(mesh.positions.size(), 0);
    component.assign(mesh.positions.size(), kNone);
  }

  CollapseInput input() const {
    return {mesh.triangles, position_of, mesh.positions, attributes,
            weights,        locked,      component,      locked_edges};
  }

  Mesh mesh;
  std::vector<uint32_t> position_of;
  std::vector<float> attributes, weights;
  std::vector<uint8_t> locked;
  std::vector<uint32_t> component;
  bool locked_edges = true;
};

std::map<std::pair<uint32_t, uint32_t>, int> edges(std::span<const Triangle> triangles,
                                                   std::span<const uint32_t> ids) {
  std::map<std::pair<uint32_t, uint32_t>, int> result;
  for (const Triangle& t : triangles)
    for (int i = 0; i < 3; ++i) {
      const uint32_t a = ids[t[i]], b = ids[t[(i + 1) % 3]];
      ++result[{std::min(a, b), std::max(a, b)}];
    }
  return result;
}

TEST(EdgeCollapser, reaches_its_target_on_closed_surfaces_and_keeps_them_closed) {
  EdgeCollapser collapser;
  for (const Mesh& mesh : {shapes::blob(4, 3), shapes::torus(40, 20), shapes::sphere(3)}) {
    const SubMesh sub_mesh(mesh);
    for (size_t part : {2, 8, 30}) {
      collapser.run(sub_mesh.input(), mesh.triangles.size() / part);
      EXPECT_LE(collapser.triangles().size(), mesh.triangles.size() / part);
      EXPECT_GE(collapser.triangles().size() + 2, mesh.triangles.size() / part);
      for (const auto& [edge, count] : edges(collapser.triangles(), sub_mesh.position_of))
        EXPECT_EQ(count, 2);
    }
  }
}

TEST(EdgeCollapser, stops_at_a_tetrahedron) {
  const SubMesh sub_mesh(shapes::sphere(1));
  EdgeCollapser collapser;
  collapser.run(sub_mesh.input(), 0);
  EXPECT_GE(collapser.triangles().size(), 4u);
  for (const auto& [edge, count] : edges(collapser.triangles(), sub_mesh.position_of))
    EXPECT_EQ(count, 2);
}

TEST(EdgeCollapser, closes_a_handle_and_no_edge_gets_more_than_two_triangles) {
  // No torus without touching itself has fewer than 14 triangles.
  const SubMesh sub_mesh(shapes::torus(40, 20));
  EdgeCollapser collapser;
  collapser.run(sub_mesh.input(), 8);
  EXPECT_LE(collapser.triangles().size(), 8u);
  EXPECT_GE(collapser.triangles().size(), 2u);
  for (const auto& [edge, count] : edges(collapser.triangles(), sub_mesh.position_of))
    EXPECT_EQ(count, 2);
  EXPECT_GT(collapser.error(), 0.0f);
}

TEST(EdgeCollapser, no_loop_through_two_locked_positions_is_collapsed) {
  SubMesh sub_mesh(shapes::torus(40, 20));
  for (uint32_t v = 0; v < 20; ++v) sub_mesh.locked[v] = 1;
  EdgeCollapser collapser;
  collapser.run(sub_mesh.input(), 0);
  std::vector<uint8_t> left(sub_mesh.locked.size(), 0);
  for (const Triangle& t : collapser.triangles())
    for (uint32_t v : t) left[v] = 1;
  for (uint32_t v = 0; v < 20; ++v) EXPECT_TRUE(left[v]);
  for (const auto& [edge, count] : edges(collapser.triangles(), sub_mesh.position_of))
    EXPECT_EQ(count, 2);
}

double area_of(const EdgeCollapser& collapser, const Mesh& mesh) {
  double area = 0;
  for (const Triangle& t : collapser.triangles()) {
    const auto& p = mesh.positions;
    area += 0.5 * length(cross(p[t[1]] - p[t[0]], p[t[2]] - p[t[0]]));
  }
  return area;
}

TEST(EdgeCollapser, a_flat_surface_shrinks_to_few_triangles_without_error) {
  const SubMesh sub_mesh(shapes::grid(20, 20));
  EdgeCollapser collapser;
  collapser.run(sub_mesh.input(), 20);
  EXPECT_LE(collapser.triangles().size(), 20u);
  EXPECT_LT(collapser.error(), 1e-6f);
  EXPECT_NEAR(area_of(collapser, sub_mesh.mesh), 1.0, 1e-5);
}

TEST(EdgeCollapser, locked_positions_and_their_edges_stay) {
  SubMesh sub_mesh(shapes::blob(4, 5));
  for (uint32_t v = 0; v < sub_mesh.locked.size(); ++v)
    sub_mesh.locked[v] = std::fabs(sub_mesh.mesh.positions[v].z) < 0.1f;
  EdgeCollapser collapser;
  for (bool allowed : {false, true}) {
    sub_mesh.locked_edges = allowed;
    collapser.run(sub_mesh.input(), sub_mesh.mesh.triangles.size() / 3);
    const auto before = edges(sub_mesh.mesh.triangles, sub_mesh.position_of);
    const auto after = edges(collapser.triangles(), sub_mesh.position_of);
    const auto is_locked = [&](const auto& e) {
      return sub_mesh.locked[e.first] && sub_mesh.locked[e.second];
    };
    size_t gone = 0;
    std::vector<PositionPair> made;
    for (const auto& [edge, count] : before) gone += is_locked(edge) && !after.contains(edge);
    for (const auto& [edge, count] : after)
      if (is_locked(edge) && !before.contains(edge)) made.push_back(edge);
    EXPECT_EQ(gone, 0u);
    auto said = collapser.locked_edges();
    std::sort(said.begin(), said.end());
    EXPECT_EQ(said, made);
    if (!allowed) {
      EXPECT_TRUE(made.empty());
    }
  }
}

TEST(EdgeCollapser, the_stated_error_is_of_the_size_of_the_deviation) {
  // All vertices stay on the unit sphere, so the surface is at most its sagitta inside.
  const SubMesh sub_mesh(shapes::sphere(4));
  EdgeCollapser collapser;
  collapser.run(sub_mesh.input(), sub_mesh.mesh.triangles.size() / 8);
  double deepest = 0;
  for (const Triangle& t : collapser.triangles()) {
    const auto& p = sub_mesh.mesh.positions;
    deepest = std::max(deepest, 1.0 - length((p[t[0]] + p[t[1]] + p[t[2]]) * (1.0f / 3.0f)));
  }
  EXPECT_GT(collapser.error(), 0.2 * deepest);
  EXPECT_LT(collapser.error(), 5.0 * deepest);
}

TEST(EdgeCollapser, a_seam_keeps_its_two_sides) {
  // Two halves of a grid with vertices and an attribute of their own along the middle.
  Mesh mesh = shapes::grid(16, 16);
  SubMesh sub_mesh(mesh);
  std::map<uint32_t, uint32_t> twin;
  auto& m = sub_mesh.mesh;
  const auto is_right = [&](const Triangle& t) {
    return m.positions[t[0]].x + m.positions[t[1]].x + m.positions[t[2]].x > 1.5f;
  };
  for (uint32_t v = 0; v < mesh.positions.size(); ++v) sub_mesh.attributes.push_back(0.0f);
  for (Triangle& t : m.triangles)
    for (uint32_t& v : t)
      if (is_right(t) && std::fabs(m.positions[v].x - 0.5f) < 1e-6f && !twin.contains(v)) {
        twin[v] = static_cast<uint32_t>(m.positions.size());
        m.positions.push_back(m.positions[v]);
        sub_mesh.position_of.push_back(v);
        sub_mesh.attributes.push_back(1.0f);
      }
  for (Triangle& t : m.triangles) {
    if (!is_right(t)) continue;
    for (uint32_t& v : t) {
      if (twin.contains(v)) v = twin[v];
      sub_mesh.attributes[v] = 1.0f;
    }
  }
  sub_mesh.weights = {1.0f};
  EdgeCollapser collapser;
  collapser.run(sub_mesh.input(), 60);
  EXPECT_LE(collapser.triangles().size(), 60u);
  for (const Triangle& t : collapser.triangles()) {
    EXPECT_EQ(sub_mesh.attributes[t[0]], sub_mesh.attributes[t[1]]);
    EXPECT_EQ(sub_mesh.attributes[t[1]], sub_mesh.attributes[t[2]]);
  }
}

TEST(EdgeCollapser, ends_where_triangles_around_a_vertex_run_into_a_circle) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 3, 2}};
  const SubMesh sub_mesh(mesh);
  EdgeCollapser collapser;
  CollapseInput input = sub_mesh.input();
  collapser.run(input, 0);
  EXPECT_LE(collapser.triangles().size(), 3u);
  input.move_non_manifold = false;
  collapser.run(input, 0);
  EXPECT_GE(collapser.triangles().size(), 1u);
}

TEST(EdgeCollapser, thin_triangles_at_a_border_do_not_inflate_the_error) {
  // A band that is much narrower than its border is rough.
  constexpr float kRough = 1e-3f, kNarrow = 1e-4f;
  constexpr uint32_t kSteps = 32;
  Mesh mesh;
  std::mt19937 random(3);
  std::uniform_real_distribution<float> rough(0.0f, kRough);
  for (uint32_t i = 0; i <= kSteps; ++i) {
    const float x = static_cast<float>(i) / kSteps, y = rough(random);
    mesh.positions.push_back({x, y, 0});
    mesh.positions.push_back({x, y + kNarrow, 0});
  }
  for (uint32_t i = 0; i < kSteps; ++i) {
    mesh.triangles.push_back({2 * i, 2 * i + 2, 2 * i + 3});
    mesh.triangles.push_back({2 * i, 2 * i + 3, 2 * i + 1});
  }
  const SubMesh sub_mesh(mesh);
  EdgeCollapser collapser;
  collapser.run(sub_mesh.input(), mesh.triangles.size() / 4);
  EXPECT_LE(collapser.triangles().size(), mesh.triangles.size() / 4);
  EXPECT_LT(collapser.error(), 2.0f * kRough);
}

TEST(EdgeCollapser, pages_that_meet_in_a_spine_shrink_without_error) {
  // Three flat pages: every vertex of the spine is non-manifold, and may move along it.
  constexpr uint32_t kSide = 8;
  Mesh mesh;
  std::vector<uint32_t> spine;
  for (int page = 0; page < 3; ++page) {
    const float angle = 2.0f * static_cast<float>(page);
    std::vector<uint32_t> ids;
    for (uint32_t y = 0; y <= kSide; ++y)
      for (uint32_t x = 0; x <= kSide; ++x) {
        if (x == 0 && page > 0) {
          ids.push_back(spine[y]);
          continue;
        }
        ids.push_back(static_cast<uint32_t>(mesh.positions.size()));
        if (x == 0) spine.push_back(ids.back());
        const float r = static_cast<float>(x) / kSide;
        mesh.positions.push_back(
            {r * std::cos(angle), r * std::sin(angle), static_cast<float>(y) / kSide});
      }
    for (uint32_t y = 0; y < kSide; ++y)
      for (uint32_t x = 0; x < kSide; ++x) {
        const uint32_t a = ids[y * (kSide + 1) + x], b = ids[y * (kSide + 1) + x + 1];
        const uint32_t c = ids[(y + 1) * (kSide + 1) + x], d = ids[(y + 1) * (kSide + 1) + x + 1];
        mesh.triangles.push_back({a, b, d});
        mesh.triangles.push_back({a, d, c});
      }
  }
  SubMesh sub_mesh(mesh);
  for (uint32_t v : spine) sub_mesh.component[v] = 0;
  EdgeCollapser collapser;
  collapser.run(sub_mesh.input(), 12);
  EXPECT_LE(collapser.triangles().size(), 12u);
  EXPECT_LT(collapser.error(), 1e-4f);
  EXPECT_NEAR(area_of(collapser, sub_mesh.mesh), 3.0, 1e-3);
}

TEST(EdgeCollapser, charts_are_held_by_the_rule_of_their_seams) {
  // A flat grid of four charts, each with vertices of its own: four at the middle.
  const Mesh mesh = shapes::grid(8, 8);
  SubMesh sub_mesh(mesh);
  sub_mesh.mesh.positions.clear();
  sub_mesh.position_of.clear();
  std::map<std::pair<uint32_t, int>, uint32_t> vertex_of;
  for (Triangle& t : sub_mesh.mesh.triangles) {
    const Vec3 middle =
        (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) * (1.0f / 3.0f);
    const int chart = (middle.x > 0.5f ? 1 : 0) + (middle.y > 0.5f ? 2 : 0);
    for (uint32_t& v : t) {
      const auto [at, is_new] =
          vertex_of.insert({{v, chart}, static_cast<uint32_t>(sub_mesh.mesh.positions.size())});
      if (is_new) {
        sub_mesh.mesh.positions.push_back(mesh.positions[v]);
        sub_mesh.position_of.push_back(v);
        sub_mesh.attributes.push_back(static_cast<float>(chart));
      }
      v = at->second;
    }
  }
  sub_mesh.weights = {1.0f};
  const auto chart = [&](uint32_t v) { return sub_mesh.attributes[v]; };
  EdgeCollapser collapser;
  for (SeamRule rule : {SeamRule::kProtect, SeamRule::kIgnore}) {
    const std::vector<SeamRule> rules(sub_mesh.locked.size(), rule);
    CollapseInput input = sub_mesh.input();
    input.rules = rules;
    collapser.run(input, 2);
    if (rule == SeamRule::kIgnore) {
      EXPECT_LT(collapser.triangles().size(), 4u);
      continue;
    }
    EXPECT_EQ(collapser.triangles().size(), 4u);
    for (const Triangle& t : collapser.triangles())
      EXPECT_TRUE(chart(t[0]) == chart(t[1]) && chart(t[1]) == chart(t[2]));
  }
}

TEST(EdgeCollapser, materials_never_mix_whatever_the_rule) {
  SubMesh sub_mesh(shapes::grid(8, 8));
  const Mesh mesh = sub_mesh.mesh;
  std::vector<uint32_t> materials(mesh.positions.size(), 0);
  std::map<uint32_t, uint32_t> other;
  for (Triangle& t : sub_mesh.mesh.triangles) {
    const float x = mesh.positions[t[0]].x + mesh.positions[t[1]].x + mesh.positions[t[2]].x;
    if (x < 1.5f) continue;
    for (uint32_t& v : t) {
      const auto [at, is_new] =
          other.insert({v, static_cast<uint32_t>(sub_mesh.mesh.positions.size())});
      if (is_new) {
        sub_mesh.mesh.positions.push_back(mesh.positions[v]);
        sub_mesh.position_of.push_back(v);
        materials.push_back(1);
      }
      v = at->second;
    }
  }
  const std::vector<SeamRule> rules(sub_mesh.locked.size(), SeamRule::kIgnore);
  EdgeCollapser collapser;
  for (bool non_manifold_moves : {false, true}) {
    CollapseInput input = sub_mesh.input();
    input.rules = rules;
    input.materials = materials;
    input.non_manifold_moves = non_manifold_moves;
    collapser.run(input, 4);
    double area[2] = {};
    for (const Triangle& t : collapser.triangles()) {
      EXPECT_TRUE(materials[t[0]] == materials[t[1]] && materials[t[1]] == materials[t[2]]);
      const auto& p = sub_mesh.mesh.positions;
      area[materials[t[0]]] += 0.5 * length(cross(p[t[1]] - p[t[0]], p[t[2]] - p[t[0]]));
    }
    EXPECT_NEAR(area[0], 0.5, 1e-4);
    EXPECT_NEAR(area[1], 0.5, 1e-4);
  }
}

// Each side has vertices and a normal of its own, so that thousands lie at the apex. Were all
// looked at for every move of the apex, this would take minutes.
TEST(EdgeCollapser, a_cone_of_flat_sides_loses_half_of_them) {
  constexpr uint32_t kSides = 8000;
  Mesh mesh;
  std::vector<uint32_t> position_of;
  std::vector<float> normals;
  for (uint32_t i = 0; i < kSides; ++i) {
    const auto rim = [](double side) {
      const double angle = side * 2 * 3.141592653589793 / kSides;
      return Vec3{static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle)), 0};
    };
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    for (const Vec3& p : {Vec3{0, 0, 1}, rim(i), rim((i + 1) % kSides)})
      mesh.positions.push_back(p);
    for (const uint32_t p : {0u, 1 + i, 1 + (i + 1) % kSides}) position_of.push_back(p);
    const Vec3 outward = rim(i + 0.5);
    for (int corner = 0; corner < 3; ++corner)
      normals.insert(normals.end(), {outward.x, outward.y, 1});
  }
  SubMesh sub_mesh(std::move(mesh));
  sub_mesh.position_of = std::move(position_of);
  sub_mesh.locked.resize(1 + kSides);
  sub_mesh.component.resize(1 + kSides);
  sub_mesh.attributes = std::move(normals);
  sub_mesh.weights = {0.1f, 0.1f, 0.1f};
  const std::vector<SeamRule> rules(sub_mesh.locked.size(), SeamRule::kAllow);
  CollapseInput input = sub_mesh.input();
  input.rules = rules;
  EdgeCollapser collapser;
  collapser.run(input, kSides / 2);
  EXPECT_LE(collapser.triangles().size(), kSides / 2);
  EXPECT_GE(collapser.triangles().size(), kSides / 2 - 2);
  EXPECT_LT(collapser.error(), 0.01f);
}

// All of the polygon is cut into triangles from one of its corners.
TEST(EdgeCollapser, polygons_of_many_corners_keep_their_outline) {
  for (const uint32_t corners : {8u, 40u, 20000u}) {
    Mesh mesh;
    for (uint32_t i = 0; i < corners; ++i) {
      const double angle = i * 2 * 3.141592653589793 / corners;
      mesh.positions.push_back(
          {static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle)), 0});
      if (i > 1) mesh.triangles.push_back({0, i - 1, i});
    }
    const SubMesh sub_mesh(std::move(mesh));
    EdgeCollapser collapser;
    collapser.run(sub_mesh.input(), corners / 2);
    double area = 0;
    for (const Triangle& t : collapser.triangles()) {
      const auto& p = sub_mesh.mesh.positions;
      area += 0.5 * cross(p[t[1]] - p[t[0]], p[t[2]] - p[t[0]]).z;
    }
    EXPECT_LE(collapser.triangles().size(), corners / 2);
    EXPECT_NEAR(area, 3.14159, 40.0 / (corners / 2.0 * corners / 2.0) + 1e-3);
    for (const auto& [edge, count] : edges(collapser.triangles(), sub_mesh.position_of))
      EXPECT_LE(count, 2);
  }
}

TEST(EdgeCollapser, after_a_pause_it_goes_on_as_if_there_had_been_none) {
  const SubMesh sub_mesh(shapes::blob(4, 3));
  EdgeCollapser collapser;
  collapser.run(sub_mesh.input(), 100);
  EXPECT_FALSE(collapser.is_paused());
  const std::vector<Triangle> expected = collapser.triangles();
  const float error = collapser.error();
  CollapseInput input = sub_mesh.input();
  input.pause_above = 1e-3f;
  collapser.run(input, 100);
  ASSERT_TRUE(collapser.is_paused());
  EXPECT_LE(collapser.error(), 1e-3f * 4.0f);
  collapser.resume({}, {});
  EXPECT_FALSE(collapser.is_paused());
  EXPECT_EQ(collapser.triangles(), expected);
  EXPECT_EQ(collapser.error(), error);
}

// On a plane, so that positions cost nothing: a step of an attribute along a line.
TEST(EdgeCollapser, attributes_may_stop_it_short_of_its_target) {
  SubMesh sub_mesh(shapes::grid(16, 16));
  for (const size_t corner : {0, 16, 272, 288}) sub_mesh.locked[corner] = 1;
  const auto& positions = sub_mesh.mesh.positions;
  for (const Vec3& p : positions) sub_mesh.attributes.push_back(p.x < 0.47f ? 0.0f : 100.0f);
  sub_mesh.weights = {1.0f};
  // How wide the widest triangle is that has both values.
  const auto widest = [&](const std::vector<Triangle>& triangles) {
    float result = 0.0f;
    for (const Triangle& t : triangles) {
      const auto [low, high] =
          std::minmax({positions[t[0]].x, positions[t[1]].x, positions[t[2]].x});
      if (low < 0.47f && high >= 0.47f) result = std::max(result, high - low);
    }
    return result;
  };
  EdgeCollapser collapser;
  CollapseInput input = sub_mesh.input();
  collapser.run(input, 2);
  EXPECT_LT(collapser.triangles().size(), 6u);
  input.keep_attributes_below = 300;
  input.attribute_loss = 0.01f;
  collapser.run(input, 2);
  EXPECT_GE(collapser.triangles().size(), 6u);
  EXPECT_LT(collapser.triangles().size(), 200u);
  EXPECT_LT(widest(collapser.triangles()), 0.13f);
}

TEST(EdgeCollapser, small_components_go_once_larger_ones_would_pay_for_them) {
  Mesh mesh = shapes::blob(4, 3);
  const uint32_t large = static_cast<uint32_t>(mesh.positions.size());
  const Mesh small = shapes::sphere(2);
  for (const Vec3& p : small.positions)
    mesh.positions.push_back(p * 0.01f + Vec3{3.0f, 0.0f, 0.0f});
  for (const Triangle& t : small.triangles)
    mesh.triangles.push_back({t[0] + large, t[1] + large, t[2] + large});
  const SubMesh sub_mesh(mesh);
  std::vector<uint32_t> component_of(mesh.positions.size(), 0);
  std::fill(component_of.begin() + large, component_of.end(), 1u);
  const std::array radii{std::numeric_limits<float>::infinity(), 0.01f};
  CollapseInput input = sub_mesh.input();
  input.pause_above = 1e-2f;
  EdgeCollapser collapser;
  collapser.run(input, 60);
  ASSERT_TRUE(collapser.is_paused());
  collapser.resume(component_of, radii);
  EXPECT_FLOAT_EQ(collapser.removed_radius(), 0.01f);
  EXPECT_LE(collapser.triangles().size(), 60u);
  for (const Triangle& t : collapser.triangles()) EXPECT_LT(t[0], large);
}

TEST(EdgeCollapser, runs_do_not_depend_on_those_before) {
  const SubMesh large(shapes::blob(4, 1)), small(shapes::torus(12, 9));
  EdgeCollapser used, fresh;
  used.run(large.input(), 100);
  used.run(small.input(), 90);
  fresh.run(small.input(), 90);
  EXPECT_EQ(used.triangles(), fresh.triangles());
  EXPECT_EQ(used.error(), fresh.error());
}

}  // namespace
}  // namespace umbel::lod
