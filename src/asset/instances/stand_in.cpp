#include "asset/instances/stand_in.hpp"

#include <algorithm>

namespace umbel::asset {
namespace {

/// Share of the surface from which on one member is most of all.
constexpr double kMost = 0.9;
/// What is flat is as thick as this, so that it can be stretched by what is not.
constexpr double kFlat = 1e-4;
constexpr double kSmallest = 1e-30;

/// The symmetric map that takes one covariance to another: that of optimal transport.
Matrix3 map_between(const Matrix3& from, const Matrix3& to) {
  Matrix3 solid = from, target = to;
  const double least = kFlat * trace(from) + kSmallest;
  for (int k = 0; k < 3; ++k) solid[k][k] += least, target[k][k] += least;
  const Eigen3 e = eigen(solid);
  const Matrix3 half = root(e, false), inverse = root(e, true);
  const Matrix3 middle = root(eigen(product(product(half, target), half)), false);
  return product(product(inverse, middle), inverse);
}

/// The instance, stretched by `map` and moved until its box is about `mean`.
Instance stretched(const Member& member, const Matrix3& map, const Vec3d& mean) {
  Instance result = member.instance;
  const auto& from = member.instance.transform.rows;
  const Vec3d moved{double{from[3]}, double{from[7]}, double{from[11]}};
  const Vec3d at = mean + map * (moved - member.box.center());
  for (int j = 0; j < 3; ++j) {
    const Vec3d column = map * Vec3d{double{from[j]}, double{from[4 + j]}, double{from[8 + j]}};
    result.transform.rows[j] = static_cast<float>(column.x);
    result.transform.rows[4 + j] = static_cast<float>(column.y);
    result.transform.rows[8 + j] = static_cast<float>(column.z);
  }
  result.transform.rows[3] = static_cast<float>(at.x);
  result.transform.rows[7] = static_cast<float>(at.y);
  result.transform.rows[11] = static_cast<float>(at.z);
  return result;
}

/// How thick a box is across where it is thinnest, about.
double thickness_of(const Matrix3& covariance) {
  const auto values = eigen(covariance).values;
  return 2 * std::sqrt(3 * std::max(0.0, std::min({values[0], values[1], values[2]})));
}

/// How far the members' boxes and the one for all of them are from each other: of the corners of
/// the members, and of points throughout the other.
double gap_between(const PlacedBox& one, std::span<const Member> members) {
  double gap = 0;
  for (const Member& member : members) {
    double farthest = 0;
    for (int k = 0; k < 8; ++k)
      farthest = std::max(
          farthest, one.distance(member.box.point(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1)));
    gap = std::max(gap, farthest + member.gap);
  }
  constexpr int kSteps = 4;
  const auto at = [](int k) { return -1.0 + 2.0 * k / (kSteps - 1); };
  for (int i = 0; i < kSteps * kSteps * kSteps; ++i) {
    const Vec3d p = one.point(at(i % kSteps), at(i / kSteps % kSteps), at(i / kSteps / kSteps));
    double nearest = members[0].box.distance(p) + members[0].gap;
    for (const Member& member : members.subspan(1))
      nearest = std::min(nearest, member.box.distance(p) + member.gap);
    gap = std::max(gap, nearest);
  }
  return gap;
}

const Member& chosen(std::span<const Member> members, double weight, double choice) {
  const auto by_weight = [](const Member& a, const Member& b) { return a.weight < b.weight; };
  const Member& largest = *std::max_element(members.begin(), members.end(), by_weight);
  if (largest.weight >= kMost * weight) return largest;
  double sum = 0;
  for (const Member& member : members) {
    sum += member.weight;
    if (sum > choice * weight) return member;
  }
  return largest;
}

}  // namespace

Member member_of(const Instance& instance, const Aabb& mesh) {
  const PlacedBox box(mesh, instance.transform);
  const Matrix3 covariance = box.covariance();
  return {instance, box, box.center(), covariance, box.area(), 0, thickness_of(covariance)};
}

Member stand_in(std::span<const Member> members, std::span<const Aabb> meshes, double choice) {
  if (members.size() == 1) return members.front();
  double weight = 0;
  for (const Member& member : members) weight += member.weight;
  // Of points and lines none has a surface: then all are alike.
  const auto share = [&](const Member& member) {
    return weight > 0 ? member.weight / weight : 1.0 / static_cast<double>(members.size());
  };
  Vec3d mean{};
  for (const Member& member : members) mean = mean + share(member) * member.mean;
  Matrix3 covariance{};
  for (const Member& member : members) {
    add_square(covariance, member.mean - mean, share(member));
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) covariance[i][j] += share(member) * member.covariance[i][j];
  }
  const Member& shown = chosen(members, weight, choice);
  const bool stays = shown.weight >= kMost * weight && weight > 0;
  const Instance instance =
      stays ? shown.instance
            : stretched(shown, map_between(shown.box.covariance(), covariance), mean);
  const PlacedBox box(meshes[instance.mesh], instance.transform);
  Member result{instance, box, mean, covariance, weight, gap_between(box, members), 0};
  result.thickness = thickness_of(box.covariance());
  for (const Member& member : members)
    result.thickness = std::max(result.thickness, member.thickness);
  return result;
}

}  // namespace umbel::asset
