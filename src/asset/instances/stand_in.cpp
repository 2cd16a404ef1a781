#include "asset/instances/stand_in.hpp"

#include <algorithm>
#include <array>

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

void set_column(Transform& transform, int column, const Vec3d& value) {
  transform.rows[column] = static_cast<float>(value.x);
  transform.rows[4 + column] = static_cast<float>(value.y);
  transform.rows[8 + column] = static_cast<float>(value.z);
}

/// The instance, stretched by `map` and moved until its box is about `mean`.
Instance stretched(const Member& member, const Aabb& mesh, const Matrix3& map, const Vec3d& mean) {
  const auto& from = member.instance.transform.rows;
  std::array<Vec3d, 3> given, columns;
  double longest = 0, longest_given = 0;
  for (int j = 0; j < 3; ++j) {
    given[j] = {double{from[j]}, double{from[4 + j]}, double{from[8 + j]}};
    columns[j] = map * given[j];
    longest_given = std::max(longest_given, length(given[j]));
    if (!member.box.is_flat(j)) longest = std::max(longest, length(columns[j]));
  }
  if (longest == 0) longest = longest_given;  // a point
  Instance result = member.instance;
  for (int j = 0; j < 3; ++j) {
    // What has no extent would be stretched without end, level by level, and errors with it.
    const double size = length(columns[j]);
    const bool is_too_long = member.box.is_flat(j) && size > longest;
    set_column(result.transform, j, is_too_long ? (longest / size) * columns[j] : columns[j]);
  }
  set_column(result.transform, 3, {});
  set_column(result.transform, 3, mean - PlacedBox(mesh, result.transform).center());
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
  const Instance instance = stays
                                ? shown.instance
                                : stretched(shown, meshes[shown.instance.mesh],
                                            map_between(shown.box.covariance(), covariance), mean);
  const PlacedBox box(meshes[instance.mesh], instance.transform);
  Member result{instance, box, mean, covariance, weight, gap_between(box, members), 0};
  result.thickness = thickness_of(box.covariance());
  for (const Member& member : members)
    result.thickness = std::max(result.thickness, member.thickness);
  return result;
}

}  // namespace umbel::asset
