#include "asset/codec/region_seeds.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <numeric>

namespace umbel::asset {
namespace {

using Unsigned4 = uint32_t __attribute__((vector_size(16)));

// By lanes, about how many bits a difference takes, plus a constant: the exponent of its size.
Unsigned4 bits_of(Int4 from, Int4 to) {
  const Int4 difference =
      std::bit_cast<Int4>(std::bit_cast<Unsigned4>(to) - std::bit_cast<Unsigned4>(from));
  const Float4 value = __builtin_convertvector(difference, Float4);
  const Float4 size = max4(value, -value) + splat(1.0f);
  return std::bit_cast<Unsigned4>(size) >> 23;
}

constexpr uint32_t kNoBits = 127;  // what a lane gives that is the same

}  // namespace

RegionSeeds::RegionSeeds(std::span<const uint8_t> triangles, std::span<const int32_t> values,
                         uint32_t vertices)
    : triangles_(triangles), values_(values), vertices_(vertices) {}

// Most clusters are one region and need none of this.
void RegionSeeds::load_values() {
  rest_.resize(triangles_.size() / 3);
  std::iota(rest_.begin(), rest_.end(), 0u);
  costs_.assign(vertices_, 0);
  const size_t stride = values_.size() / vertices_;
  blocks_ = (stride + 3) / 4;
  rows_.assign(vertices_ * blocks_, Int4{});
  for (size_t v = 0; v < vertices_; ++v)
    if (stride > 0)
      std::memcpy(&rows_[v * blocks_], &values_[v * stride], stride * sizeof(int32_t));
  edge_costs_.resize(triangles_.size());
  for (size_t at = 0; at < triangles_.size(); ++at) {
    const size_t next = at % 3 == 2 ? at - 2 : at + 1;
    edge_costs_[at] = cost_of(triangles_[at], triangles_[next]);
  }
}

uint32_t RegionSeeds::cost_of(size_t from, size_t to) const {
  Unsigned4 sums{};
  for (size_t i = 0; i < blocks_; ++i)
    sums += bits_of(rows_[from * blocks_ + i], rows_[to * blocks_ + i]);
  // A remainder has about one bit for each of its size, and one for its class.
  const uint32_t bits = (sums[0] + sums[1]) + (sums[2] + sums[3]);
  return 2 * (bits - kNoBits * 4 * static_cast<uint32_t>(blocks_));
}

void RegionSeeds::find_costs(uint8_t last, std::span<const bool> known, uint32_t known_bits) {
  for (size_t v = 0; v < vertices_; ++v) costs_[v] = known[v] ? known_bits : cost_of(last, v);
}

RegionSeeds::Seed RegionSeeds::next(uint8_t last, std::span<const bool> visited,
                                    std::span<const bool> known, uint32_t known_bits) {
  if (rest_.empty()) load_values();
  std::erase_if(rest_, [&](uint32_t t) { return visited[t]; });
  find_costs(last, known, known_bits);
  Seed best{rest_[0], 0};
  uint32_t least = ~0u;
  for (const uint32_t t : rest_)
    for (uint32_t k = 0; k < 3; ++k) {
      const uint32_t n = (k + 1) % 3;
      const auto along = [&](uint32_t edge, uint32_t to) {
        return known[triangles_[3 * t + to]] ? known_bits : edge_costs_[3 * t + edge];
      };
      // The other two would come later anyway, so they count half.
      const uint32_t others = along(k, n) + along(n, (n + 1) % 3);
      const uint32_t cost = 2 * costs_[triangles_[3 * t + k]] + others;
      if (cost < least) least = cost, best = {t, k};
    }
  return best;
}

}  // namespace umbel::asset
