// What moving a vertex costs its attributes (Hoppe, "New Quadric Metric for Simplifying Meshes with
// Appearance Attributes", 1999).
//
// Within a triangle an attribute is a linear function of the point; its quadric is the squared
// difference from that, integrated over the triangle. A difference d over an area A so costs d^2 A.
// It counts as a distance of d times the root of A: on a curved surface that is what goes with a
// normal that is off by d, at any scale.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/simd/float4.hpp"
#include "lod/simplify/collapse/collapse_input.hpp"
#include "lod/simplify/collapse/quadric.hpp"

namespace umbel::lod {

class AttributeQuadrics {
 public:
  static constexpr uint32_t kMostAttributes = 32;

  /// `input` lives as long as the quadrics are used.
  void build(const CollapseInput& input);

  bool is_empty() const { return count_ == 0; }  ///< there are no attributes

  /// `cost` of one vertex and way for any vertex there.
  class MoveCosts {
   public:
    MoveCosts(const AttributeQuadrics& all, uint32_t from, const Vec3& d);
    float operator()(uint32_t to) const;

   private:
    const AttributeQuadrics& all_;
    const float* here_;
    Float4 weight_;
    float of_position_;
    std::array<Float4, kMostAttributes / 4> means_;  // what the differences are multiplied by
  };

  /// Of the vertex `from` as it becomes `to`, which is `d` away.
  float cost(uint32_t from, uint32_t to, const Vec3& d) const;
  /// Of the vertex `from` as it becomes each of four, whose differences from it are given.
  Float4 costs(uint32_t from, const std::array<uint32_t, 4>& to, Float4 dx, Float4 dy,
               Float4 dz) const;
  /// Adds the quadric of `from` to that of `to`; `cost` is of that move.
  void merge(uint32_t from, uint32_t to, const Vec3& d, float cost);

  /// Moves `values`, the attributes of a vertex, to those of the least cost. False: they do not
  /// move.
  bool refit(uint32_t vertex, std::span<float> values) const;

 private:
  void find_columns(const CollapseInput& input);
  void add_triangle(const CollapseInput& input, const Triangle& t);
  float* values_of(size_t v) { return &values_[v * stride_]; }
  const float* values_of(size_t v) const { return &values_[v * stride_]; }
  float* gradients_of(size_t v) { return &gradients_[4 * v * stride_]; }
  const float* gradients_of(size_t v) const { return &gradients_[4 * v * stride_]; }

  uint32_t count_ = 0, stride_ = 0;  // attributes that differ anywhere; in whole blocks of 4
  std::vector<uint32_t> columns_;    // of them: their place in the input
  std::vector<float> weights_;       // of them
  std::vector<Quadric> quadrics_;    // of vertices
  std::vector<float> values_;        // of vertices: weighted attributes, stride_ each
  std::vector<float> gradients_;     // of vertices: stride_ each by x, y, z, and for the mean
};

}  // namespace umbel::lod
