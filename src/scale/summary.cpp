#include "scale/summary.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "base/hash.hpp"

namespace umbel::scale {
namespace {

uint64_t hash_of(const Vec3d& p) {
  uint64_t hash = mix64(std::bit_cast<uint64_t>(p.x));
  hash = mix64(hash ^ std::bit_cast<uint64_t>(p.y));
  return mix64(hash ^ std::bit_cast<uint64_t>(p.z));
}

bool is_exact(double value) { return double{static_cast<float>(value)} == value; }

uint64_t hash_of(const io::TriangleBlock& block, uint32_t v) {
  uint64_t hash = 0;
  const auto add = [&](const auto& stream) {
    if (stream.empty()) return;
    for (uint32_t bits : std::bit_cast<std::array<uint32_t, sizeof(stream[0]) / 4>>(stream[v]))
      hash = mix64(hash ^ bits);
  };
  add(block.normals);
  add(block.tangents);
  add(block.uvs);
  add(block.colors);
  const size_t width = block.extra_values.size() / block.positions.size();
  for (size_t k = v * width; k < (v + 1) * width; ++k)
    hash = mix64(hash ^ std::bit_cast<uint32_t>(block.extra_values[k]));
  return hash ^ hash_of(block.positions[v]);
}

}  // namespace

void SourceSummary::merge(const SourceSummary& other) {
  triangles += other.triangles;
  fingerprint += other.fingerprint;
  exact &= other.exact;
  low = {std::min(low.x, other.low.x), std::min(low.y, other.low.y), std::min(low.z, other.low.z)};
  high = {std::max(high.x, other.high.x), std::max(high.y, other.high.y),
          std::max(high.z, other.high.z)};
  largest_material = std::max(largest_material, other.largest_material);
  least_uv = {std::min(least_uv.x, other.least_uv.x), std::min(least_uv.y, other.least_uv.y)};
  largest_uv = {std::max(largest_uv.x, other.largest_uv.x),
                std::max(largest_uv.y, other.largest_uv.y)};
}

SourceSummary summarise(const io::TriangleSource& source, uint64_t begin, uint64_t end) {
  SourceSummary summary;
  io::for_each_block(source, begin, end, io::kBlockTriangles, [&](const io::TriangleBlock& block) {
    SourceSummary part;
    part.triangles = block.triangles.size();
    std::vector<uint64_t> hashes(block.positions.size());
    for (uint32_t v = 0; v < block.positions.size(); ++v) {
      const Vec3d& p = block.positions[v];
      part.low = {std::min(part.low.x, p.x), std::min(part.low.y, p.y), std::min(part.low.z, p.z)};
      part.high = {std::max(part.high.x, p.x), std::max(part.high.y, p.y),
                   std::max(part.high.z, p.z)};
      part.exact = part.exact && is_exact(p.x) && is_exact(p.y) && is_exact(p.z);
      hashes[v] = hash_of(block, v);
    }
    for (size_t i = 0; i < block.triangles.size(); ++i) {
      uint64_t hash = mix64(block.first + i);
      for (uint32_t v : block.triangles[i]) hash = mix64(hash ^ hashes[v]);
      if (!block.materials.empty()) hash = mix64(hash ^ block.materials[i]);
      part.fingerprint += hash;
    }
    for (uint32_t m : block.materials) part.largest_material = std::max(part.largest_material, m);
    for (const Vec2& uv : block.uvs) {
      part.least_uv = {std::min(part.least_uv.x, uv.x), std::min(part.least_uv.y, uv.y)};
      part.largest_uv = {std::max(part.largest_uv.x, uv.x), std::max(part.largest_uv.y, uv.y)};
    }
    summary.merge(part);
  });
  return summary;
}

Vec3d choose_origin(const SourceSummary& s) {
  constexpr double kFar = 16.0;
  if (s.triangles == 0 || s.exact) return {0, 0, 0};
  const double extent = std::max({s.high.x - s.low.x, s.high.y - s.low.y, s.high.z - s.low.z});
  double farthest = 0;
  for (double c : {s.low.x, s.low.y, s.low.z, s.high.x, s.high.y, s.high.z})
    farthest = std::max(farthest, std::fabs(c));
  if (!std::isfinite(extent) || !(farthest > kFar * (extent / 2))) return {0, 0, 0};
  if (extent == 0.0) return {s.low.x + 0.0, s.low.y + 0.0, s.low.z + 0.0};
  const double step = std::exp2(std::floor(std::log2(extent)));
  const auto middle = [&](double low, double high) {
    return std::nearbyint((low / 2 + high / 2) / step) * step + 0.0;
  };
  return {middle(s.low.x, s.high.x), middle(s.low.y, s.high.y), middle(s.low.z, s.high.z)};
}

Aabb box_of(const SourceSummary& summary, const PointRule& rule) {
  if (summary.triangles == 0) return {};
  // Rounding keeps the order, so the corners of the box become those of the rounded points.
  return {point_of(summary.low, rule), point_of(summary.high, rule)};
}

}  // namespace umbel::scale
