// What attributes cost: one way to a number and another.
#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "lod/simplify/collapse/attribute_quadrics.hpp"

namespace umbel::lod {
namespace {

// Triangles of random vertices, with five attributes of which the third is the same everywhere.
struct Specimen {
  static constexpr uint32_t kVertices = 40, kWidth = 5;
  std::vector<Triangle> triangles;
  std::vector<uint32_t> position_of;
  std::vector<Vec3> positions;
  std::vector<float> attributes, weights{0.5f, 1.0f, 1.0f, 0.25f, 2.0f};
  std::mt19937 random{7};
  std::uniform_real_distribution<float> number{-1.0f, 1.0f};

  Specimen() {
    std::uniform_int_distribution<uint32_t> vertex(0, kVertices - 1);
    for (uint32_t v = 0; v < kVertices; ++v) {
      position_of.push_back(v);
      positions.push_back({number(random), number(random), number(random)});
      for (uint32_t k = 0; k < kWidth; ++k) attributes.push_back(k == 2 ? 0.5f : number(random));
    }
    while (triangles.size() < 80) {
      const Triangle t{vertex(random), vertex(random), vertex(random)};
      if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) triangles.push_back(t);
    }
  }
  AttributeQuadrics quadrics() const {
    CollapseInput input;
    input.triangles = triangles;
    input.position_of = position_of;
    input.positions = positions;
    input.attributes = attributes;
    input.attribute_weights = weights;
    AttributeQuadrics result;
    result.build(input);
    return result;
  }
};

TEST(AttributeQuadrics, costs_of_one_way_are_those_of_single_moves) {
  Specimen specimen;
  const AttributeQuadrics quadrics = specimen.quadrics();
  float largest = 0;
  for (uint32_t from = 0; from < Specimen::kVertices; ++from) {
    const Vec3 d{specimen.number(specimen.random), specimen.number(specimen.random), 0.5f};
    const AttributeQuadrics::MoveCosts costs(quadrics, from, d);
    for (uint32_t to = 0; to < Specimen::kVertices; ++to) {
      EXPECT_EQ(costs(to), quadrics.cost(from, to, d));
      largest = std::max(largest, costs(to));
    }
  }
  EXPECT_GT(largest, 0.0f);
}

// The quadric of a vertex is the sum over its triangles of an integral, here by hand: with one
// attribute whose value is x, moving by d along x and taking the value there costs nothing, and
// keeping the own value costs d^2 times the area.
TEST(AttributeQuadrics, a_linear_attribute_costs_only_what_differs_from_it) {
  Specimen specimen;
  specimen.triangles = {{0, 1, 2}};
  specimen.positions[0] = {0, 0, 0}, specimen.positions[1] = {1, 0, 0};
  specimen.positions[2] = {0, 2, 0}, specimen.positions[3] = {0.5f, 0, 0};
  specimen.weights = {1.0f};
  specimen.attributes.clear();
  for (const Vec3& p : specimen.positions) specimen.attributes.push_back(p.x);
  specimen.attributes[4] = 0.0f;
  const AttributeQuadrics quadrics = specimen.quadrics();
  EXPECT_NEAR(quadrics.cost(0, 3, {0.5f, 0, 0}), 0.0f, 1e-6f);
  EXPECT_NEAR(quadrics.cost(0, 4, {0.5f, 0, 0}), 0.25f, 1e-6f);
}

TEST(AttributeQuadrics, what_is_the_same_everywhere_or_has_no_weight_is_left_out) {
  Specimen specimen;
  EXPECT_FALSE(specimen.quadrics().is_empty());
  specimen.weights = {0, 0, 1.0f, 0, 0};
  EXPECT_TRUE(specimen.quadrics().is_empty());
  specimen.attributes.back() = 0.25f;
  specimen.attributes[Specimen::kWidth * 39 + 2] = 0.25f;
  EXPECT_FALSE(specimen.quadrics().is_empty());
}

}  // namespace
}  // namespace umbel::lod
