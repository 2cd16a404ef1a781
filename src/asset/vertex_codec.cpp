#include "asset/vertex_codec.hpp"

#include <algorithm>

namespace umbel::asset {
namespace {

constexpr uint32_t kParameterBits = 5;
constexpr uint32_t kAllZero = 31;  ///< in place of a Rice parameter: every remainder is 0

// Sums of 32-bit integers wrap: any file decodes to something, on every machine to the same.
uint32_t predicted_flat(const int32_t* column, uint32_t stride, const Parents& p) {
  const auto at = [&](uint32_t v) { return static_cast<uint32_t>(column[v * stride]); };
  return at(p.a) + at(p.b) - at(p.across);
}

uint32_t predicted_smooth(const int32_t* column, uint32_t stride, const Parents& p) {
  const int64_t sum = int64_t{column[p.a * stride]} + column[p.b * stride];
  return static_cast<uint32_t>(sum >> 1);
}

uint32_t predicted(const VertexFormat& format, uint32_t component, const int32_t* column,
                   uint32_t stride, const Parents& parents) {
  return format.is_smooth[component] ? predicted_smooth(column, stride, parents)
                                     : predicted_flat(column, stride, parents);
}

/// The parameter with the shortest code.
uint32_t best_parameter(std::span<const uint32_t> remainders) {
  if (std::all_of(remainders.begin(), remainders.end(), [](uint32_t r) { return r == 0; }))
    return kAllZero;
  // The best is near the mean's logarithm, or below where outliers have raised the mean.
  uint64_t sum = 0;
  for (const uint32_t r : remainders) sum += r;
  const auto near = static_cast<uint32_t>(std::bit_width(sum / remainders.size()));
  uint32_t best = 0;
  uint64_t least = ~uint64_t{0};
  for (uint32_t k = near - std::min(near, 4u); k <= std::min(near + 1, kAllZero - 1); ++k) {
    uint64_t bits = 0;
    for (const uint32_t r : remainders) bits += rice_bits(r, k);
    if (bits < least) best = k, least = bits;
  }
  return best;
}

}  // namespace

void encode_vertices(const VertexFormat& format, std::span<const int32_t> integers,
                     std::span<const Parents> parents, std::span<const ComponentRange> ranges,
                     BitWriter& out) {
  const uint32_t stride = components(format);
  const size_t count = parents.size();
  std::vector<uint32_t> remainders(stride * (count - 1));
  std::array<uint32_t, kMaxComponents> parameters{};
  for (uint32_t c = 0; c < stride; ++c) {
    const std::span<uint32_t> mine = std::span(remainders).subspan(c * (count - 1), count - 1);
    for (size_t v = 1; v < count; ++v)
      mine[v - 1] = zigzag(
          static_cast<int32_t>(static_cast<uint32_t>(integers[v * stride + c]) -
                               predicted(format, c, integers.data() + c, stride, parents[v])));
    parameters[c] = best_parameter(mine);
    out.write(parameters[c], kParameterBits);
    out.write(static_cast<uint32_t>(integers[c]) - static_cast<uint32_t>(ranges[c].lowest),
              ranges[c].bits);
  }
  for (size_t v = 0; v + 1 < count; ++v)
    for (uint32_t c = 0; c < stride; ++c)
      if (parameters[c] != kAllZero) out.rice(remainders[c * (count - 1) + v], parameters[c]);
}

void decode_vertices(const VertexFormat& format, std::span<const Parents> parents,
                     std::span<const ComponentRange> ranges, BitReader& in,
                     std::span<int32_t> integers) {
  const uint32_t stride = components(format);
  std::array<uint32_t, kMaxComponents> parameters{};
  for (uint32_t c = 0; c < stride; ++c) {
    parameters[c] = in.read(kParameterBits);
    integers[c] =
        static_cast<int32_t>(static_cast<uint32_t>(ranges[c].lowest) + in.read(ranges[c].bits));
  }
  for (size_t v = 1; v < parents.size(); ++v)
    for (uint32_t c = 0; c < stride; ++c) {
      const uint32_t remainder = parameters[c] == kAllZero ? 0 : in.rice(parameters[c]);
      integers[v * stride + c] =
          static_cast<int32_t>(predicted(format, c, integers.data() + c, stride, parents[v]) +
                               static_cast<uint32_t>(unzigzag(remainder)));
    }
}

}  // namespace umbel::asset
