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
}

void RegionSeeds::find_costs(uint8_t last, std::span<const bool> known, uint32_t known_bits) {
  const Int4* const from = rows_.data() + last * blocks_;
  for (size_t v = 0; v < vertices_; ++v) {
    Unsigned4 sums{};
    for (size_t i = 0; i < blocks_; ++i) sums += bits_of(from[i], rows_[v * blocks_ + i]);
    // A remainder has about one bit for each of its size, and one for its class.
    const uint32_t bits = (sums[0] + sums[1]) + (sums[2] + sums[3]);
    costs_[v] = known[v] ? known_bits : 2 * (bits - kNoBits * 4 * static_cast<uint32_t>(blocks_));
  }
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
      const uint32_t cost = costs_[triangles_[3 * t + k]];
      if (cost < least) least = cost, best = {t, k};
    }
  return best;
}

}  // namespace umbel::asset
