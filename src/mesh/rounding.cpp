// What a mesh loses when its positions are rounded: how far vertices move, and which triangles lose
// their area.
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/math.hpp"
#include "base/parallel.hpp"
#include "umbel/mesh.hpp"

namespace umbel {
namespace {

// A triangle that was flatter than this, its height over its length, had no area to lose.
constexpr double kFlat = 1e-7;

struct Corners {
  Vec3d a, b, c;
};

Vec3d between(const Vec3d& from, const Vec3d& to) {
  return {to.x - from.x, to.y - from.y, to.z - from.z};
}

double squared(const Vec3d& v) { return v.x * v.x + v.y * v.y + v.z * v.z; }

/// The square of twice the area. Zero exactly where corners are floats and on a line: differences
/// of floats, and their products, have few enough digits to be exact.
double squared_area(const Corners& t) {
  const Vec3d u = between(t.a, t.b), v = between(t.a, t.c);
  const Vec3d cross{u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x};
  return std::max({std::abs(cross.x), std::abs(cross.y), std::abs(cross.z)}) > 0
             ? std::max(squared(cross), std::numeric_limits<double>::min())
             : 0.0;
}

bool has_area(const Corners& t) {
  const double longest = std::max(
      {squared(between(t.a, t.b)), squared(between(t.b, t.c)), squared(between(t.c, t.a))});
  return squared_area(t) > kFlat * kFlat * longest * longest;
}

Corners corners_of(std::span<const Vec3> positions, const Triangle& t) {
  const auto wide = [&](uint32_t i) {
    return Vec3d{positions[i].x, positions[i].y, positions[i].z};
  };
  return {wide(t[0]), wide(t[1]), wide(t[2])};
}

}  // namespace

RoundingLoss rounding_loss(std::span<const Vec3d> world, const Vec3d& origin,
                           std::span<const Vec3> rounded, std::span<const Triangle> triangles) {
  if (world.size() != rounded.size())
    throw Error(ErrorCode::kInvalidArgument,
                "there are " + std::to_string(rounded.size()) + " rounded positions, but " +
                    std::to_string(world.size()) + " that they were rounded from");
  constexpr size_t kChunk = size_t{1} << 14;
  std::vector<RoundingLoss> losses((triangles.size() + kChunk - 1) / kChunk);
  parallel_chunks(triangles.size(), kChunk, [&](size_t begin, size_t end) {
    RoundingLoss& loss = losses[begin / kChunk];
    for (size_t i = begin; i < end; ++i) {
      const Triangle& t = triangles[i];
      if (std::max({t[0], t[1], t[2]}) >= world.size()) continue;
      double moved = 0;
      bool all_finite = true;
      for (const uint32_t v : t) {
        const Vec3 p = rounded[v];
        all_finite = all_finite && is_finite(p) && is_finite(world[v]);
        moved = std::max(
            moved, squared(between(world[v], {origin.x + p.x, origin.y + p.y, origin.z + p.z})));
      }
      if (!all_finite) continue;
      loss.largest_move = std::max(loss.largest_move, moved);
      if (moved > 0 && squared_area(corners_of(rounded, t)) == 0 &&
          has_area({world[t[0]], world[t[1]], world[t[2]]}))
        ++loss.degenerate;
    }
  });
  RoundingLoss all;
  for (const RoundingLoss& loss : losses) {
    all.largest_move = std::max(all.largest_move, loss.largest_move);
    all.degenerate += loss.degenerate;
  }
  all.largest_move = std::sqrt(all.largest_move);
  return all;
}

}  // namespace umbel
