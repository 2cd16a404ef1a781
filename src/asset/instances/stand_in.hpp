// One instance in place of several: Cook, Halstead, Planck and Ryu, "Stochastic Simplification of
// Aggregate Detail", 2007. It is one of them, stretched so that it has the mean and the covariance
// of all of them together, as when Gaussian mixtures are reduced.
#pragma once

#include <cstdint>
#include <span>

#include "asset/instances/matrix3.hpp"
#include "asset/instances/placed_box.hpp"

namespace umbel::asset {

/// An instance, or one that stands for several, and what it stands for.
struct Member {
  Instance instance;
  PlacedBox box;
  Vec3d mean;
  Matrix3 covariance;
  double weight;     ///< surface
  double gap;        ///< how far the boxes that it stands for may be from its own
  double thickness;  ///< of the thickest box that it stands for, across
};

Member member_of(const Instance& instance, const Aabb& mesh);

/// `choice` in [0, 1) says which of the members is shown, by their surfaces. A member with most of
/// all surface stays as it is.
Member stand_in(std::span<const Member> members, std::span<const Aabb> meshes, double choice);

}  // namespace umbel::asset
