#include "asset/vertex_codec.hpp"

#include <algorithm>

namespace umbel::asset {
namespace {

constexpr uint32_t kParameterBits = 5, kDampingBits = 2;
constexpr uint32_t kAllZero = 31;  ///< in place of a Rice parameter: every remainder is 0

// Sums of 32-bit integers wrap: any file decodes to something, on every machine to the same.
uint32_t predicted_flat(const int32_t* column, uint32_t stride, const Parents& p, int damping) {
  const auto at = [&](uint32_t v) { return int64_t{column[v * stride]}; };
  const int64_t sum = at(p.a) + at(p.b), across = at(p.across);
  return static_cast<uint32_t>(sum - across - ((damping * (sum - 2 * across)) >> 4));
}

uint32_t predicted_smooth(const int32_t* column, uint32_t stride, const Parents& p) {
  const int64_t sum = int64_t{column[p.a * stride]} + column[p.b * stride];
  return static_cast<uint32_t>(sum >> 1);
}

uint32_t predicted(const VertexFormat& format, uint32_t component, const int32_t* column,
                   uint32_t stride, const Parents& parents, int damping) {
  return format.is_smooth[component] ? predicted_smooth(column, stride, parents)
                                     : predicted_flat(column, stride, parents, damping);
}

/// The damping with the least sum of remainders of the positions.
int best_damping(std::span<const int32_t> integers, uint32_t stride,
                 std::span<const Parents> parents, std::span<const uint32_t> source) {
  std::array<uint64_t, 1 << kDampingBits> sums{};
  for (size_t v = 1; v < parents.size(); ++v) {
    if (source[v] != kNone) continue;
    for (uint32_t c = 0; c < 3; ++c) {
      const auto at = [&](size_t vertex) { return int64_t{integers[vertex * stride + c]}; };
      const int64_t sum = at(parents[v].a) + at(parents[v].b), across = at(parents[v].across);
      const int64_t undamped = at(v) - (sum - across), bend = sum - 2 * across;
      for (int damping = 0; damping < 1 << kDampingBits; ++damping)
        sums[damping] += zigzag(static_cast<int32_t>(undamped + ((damping * bend) >> 4)));
    }
  }
  return static_cast<int>(std::min_element(sums.begin(), sums.end()) - sums.begin());
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

/// From what a cluster's vertices are predicted.
struct Predictors {
  const VertexFormat& format;
  std::span<const Parents> parents;
  std::span<const uint32_t> source;
  const std::array<uint32_t, kMaxComponents>& parameters;
  int damping;
};

/// Reads a cluster's vertices but for the first, the group's from `first` on. `kStride` is that of
/// components that are all predicted flat, or 0 for any.
template <uint32_t kStride>
void decode_values(const Predictors& from, BitReader& in, std::span<int32_t> group, uint32_t first,
                   uint32_t any_stride) {
  const uint32_t stride = kStride != 0 ? kStride : any_stride;
  int32_t* const integers = group.data() + size_t{first} * stride;
  BitReader bits = in;  // its state stays in registers
  for (size_t v = 0; v < from.parents.size(); ++v) {
    int32_t* const vertex = integers + v * stride;
    if (from.source[v] != kNone) {
      const int32_t* const equal = group.data() + size_t{from.source[v]} * stride;
      for (uint32_t c = 0; c < stride; ++c) vertex[c] = equal[c];
      continue;
    }
    for (uint32_t c = 0; c < stride && v > 0; ++c) {
      const uint32_t parameter = from.parameters[c];
      const uint32_t remainder = parameter == kAllZero ? 0 : bits.rice(parameter);
      const uint32_t expected =
          kStride != 0
              ? predicted_flat(integers + c, stride, from.parents[v], from.damping)
              : predicted(from.format, c, integers + c, stride, from.parents[v], from.damping);
      vertex[c] = static_cast<int32_t>(expected + static_cast<uint32_t>(unzigzag(remainder)));
    }
  }
  in = bits;
}

}  // namespace

void encode_vertices(const VertexFormat& format, std::span<const int32_t> integers,
                     std::span<const Parents> parents, std::span<const uint32_t> source,
                     std::span<const ComponentRange> ranges, BitWriter& out) {
  const uint32_t stride = components(format);
  const int damping = best_damping(integers, stride, parents, source);
  out.write(static_cast<uint32_t>(damping), kDampingBits);
  std::vector<uint32_t> own;
  for (uint32_t v = 1; v < parents.size(); ++v)
    if (source[v] == kNone) own.push_back(v);
  std::vector<uint32_t> remainders(stride * own.size());
  std::array<uint32_t, kMaxComponents> parameters{};
  for (uint32_t c = 0; c < stride; ++c) {
    const std::span<uint32_t> mine = std::span(remainders).subspan(c * own.size(), own.size());
    for (size_t i = 0; i < own.size(); ++i)
      mine[i] = zigzag(static_cast<int32_t>(
          static_cast<uint32_t>(integers[own[i] * stride + c]) -
          predicted(format, c, integers.data() + c, stride, parents[own[i]], damping)));
    parameters[c] = best_parameter(mine);
    out.write(parameters[c], kParameterBits);
    if (source[0] == kNone)
      out.write(static_cast<uint32_t>(integers[c]) - static_cast<uint32_t>(ranges[c].lowest),
                ranges[c].bits);
  }
  for (size_t i = 0; i < own.size(); ++i)
    for (uint32_t c = 0; c < stride; ++c)
      if (parameters[c] != kAllZero) out.rice(remainders[c * own.size() + i], parameters[c]);
}

void decode_vertices(const VertexFormat& format, std::span<const Parents> parents,
                     std::span<const uint32_t> source, std::span<const ComponentRange> ranges,
                     BitReader& in, std::span<int32_t> group, uint32_t first) {
  const uint32_t stride = components(format);
  int32_t* const integers = group.data() + size_t{first} * stride;
  std::array<uint32_t, kMaxComponents> parameters{};
  const auto damping = static_cast<int>(in.read(kDampingBits));
  for (uint32_t c = 0; c < stride; ++c) {
    parameters[c] = in.read(kParameterBits);
    if (source[0] == kNone)
      integers[c] =
          static_cast<int32_t>(static_cast<uint32_t>(ranges[c].lowest) + in.read(ranges[c].bits));
  }
  const Predictors predictors{format, parents, source, parameters, damping};
  const std::span<int32_t> values = group.first((size_t{first} + parents.size()) * stride);
  // Positions alone are the common case, and with a constant stride half as fast again.
  if (stride == 3 && !format.is_smooth[0] && !format.is_smooth[1] && !format.is_smooth[2])
    decode_values<3>(predictors, in, values, first, 3);
  else
    decode_values<0>(predictors, in, values, first, stride);
}

}  // namespace umbel::asset
