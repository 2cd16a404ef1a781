// Distance to the surface of a closed mesh, negative inside.
#include <algorithm>
#include <string>
#include <vector>

#include "base/parallel.hpp"
#include "umbel/triangle_queries.hpp"

namespace umbel {

float TriangleQueries::signed_distance(const Vec3& point) const {
  const float distance = closest_point(point).distance;
  // A point of the surface is on neither side.
  return distance > 0 && contains(point) ? -distance : distance;
}

void TriangleQueries::signed_distance(std::span<const Vec3> points, std::span<float> results,
                                      uint32_t threads) const {
  if (points.size() != results.size())
    throw Error(ErrorCode::kInvalidArgument, "there are " + std::to_string(points.size()) +
                                                 " points but room for " +
                                                 std::to_string(results.size()) + " results");
  // In blocks, so that what is kept between the two questions stays small.
  constexpr size_t kBlock = size_t{1} << 18;
  std::vector<ClosestPoint> closest(std::min(points.size(), kBlock));
  std::vector<uint8_t> inside(closest.size());
  for (size_t begin = 0; begin < points.size(); begin += kBlock) {
    const size_t count = std::min(points.size() - begin, kBlock);
    const auto block = points.subspan(begin, count);
    closest_point(block, std::span(closest).first(count), std::numeric_limits<float>::infinity(),
                  threads);
    contains(block, std::span(inside).first(count), threads);
    for (size_t i = 0; i < count; ++i) {
      const float distance = closest[i].distance;
      results[begin + i] = distance > 0 && inside[i] ? -distance : distance;
    }
  }
}

}  // namespace umbel
