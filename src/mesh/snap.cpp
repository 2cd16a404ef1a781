// Rounds positions to a grid. With a power of two as the step every multiple that results is
// exact in floats, so vertices at one position stay at one position.
#include <cmath>

#include "base/math.hpp"
#include "base/parallel.hpp"
#include "base/printed.hpp"
#include "umbel/mesh.hpp"

namespace umbel {
namespace {

float snapped(float value, double step) {
  if (!std::isfinite(value)) return value;
  const double steps = value / step;
  auto result = static_cast<float>(std::nearbyint(steps) * step);
  if (!std::isfinite(result)) result = static_cast<float>(std::trunc(steps) * step);
  return without_negative_zero(result);
}

}  // namespace

float snap_to_grid(std::span<Vec3> positions, float step) {
  int exponent = 0;
  if (!(step > 0) || !std::isfinite(step) || std::frexp(step, &exponent) != 0.5f)
    throw Error(ErrorCode::kInvalidArgument,
                "step is " + printed(step) + ", but must be a positive power of two");
  constexpr size_t kChunk = size_t{1} << 15;
  std::vector<double> farthest((positions.size() + kChunk - 1) / kChunk, 0.0);
  parallel_chunks(positions.size(), kChunk, [&](size_t begin, size_t end) {
    double& most = farthest[begin / kChunk];
    for (size_t i = begin; i < end; ++i) {
      const Vec3 p = positions[i];
      const Vec3 q{snapped(p.x, step), snapped(p.y, step), snapped(p.z, step)};
      positions[i] = q;
      const double x = double{q.x} - p.x, y = double{q.y} - p.y, z = double{q.z} - p.z;
      most = std::fmax(most, std::fma(x, x, std::fma(y, y, z * z)));
    }
  });
  double most = 0;
  for (double d : farthest) most = std::fmax(most, d);
  return static_cast<float>(std::sqrt(most));
}

}  // namespace umbel
