#include "asset/codec/vertex_codec.hpp"

#include <algorithm>
#include <cstring>

namespace umbel::asset {
namespace {

constexpr uint32_t kParameterBits = 5, kDampingBits = 2;
constexpr uint32_t kAllZero = 31;  ///< in place of a Rice parameter: every remainder is 0

// Sums of 32-bit integers wrap: any file decodes to something, on every machine to the same.
uint32_t predicted_flat(const int32_t* column, uint32_t stride, const Predictors& p, int damping) {
  const auto at = [&](uint32_t v) { return int64_t{column[v * stride]}; };
  const int64_t sum = at(p.a()) + at(p.b()), across = at(p.across());
  return static_cast<uint32_t>(sum - across - ((damping * (sum - 2 * across)) >> 4));
}

uint32_t predicted_smooth(const int32_t* column, uint32_t stride, const Predictors& p) {
  const int64_t sum = int64_t{column[p.a() * stride]} + column[p.b() * stride];
  return static_cast<uint32_t>(sum >> 1);
}

uint32_t predicted(const VertexFormat& format, uint32_t component, const int32_t* column,
                   uint32_t stride, const Predictors& predictors, int damping) {
  return format.is_smooth[component] ? predicted_smooth(column, stride, predictors)
                                     : predicted_flat(column, stride, predictors, damping);
}

/// The damping with the least sum of remainders of the positions.
int best_damping(std::span<const int32_t> integers, uint32_t stride,
                 std::span<const Predictors> predictors, std::span<const uint32_t> source) {
  std::array<uint64_t, 1 << kDampingBits> sums{};
  for (size_t v = 1; v < predictors.size(); ++v) {
    if (source[v] != kNone) continue;
    for (uint32_t c = 0; c < 3; ++c) {
      const auto at = [&](size_t vertex) { return int64_t{integers[vertex * stride + c]}; };
      const int64_t sum = at(predictors[v].a()) + at(predictors[v].b()),
                    across = at(predictors[v].across());
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
  uint32_t least = ~0u;
  for (uint32_t k = near - std::min(near, 4u); k <= std::min(near + 1, kAllZero - 1); ++k) {
    uint32_t bits = 0;
    for (const uint32_t r : remainders) bits += rice_bits(r, k);
    if (bits < least) best = k, least = bits;
  }
  return best;
}

/// All that predicts a cluster's vertices.
struct Prediction {
  const VertexFormat& format;
  std::span<const Predictors> predictors;
  std::span<const uint32_t> source;
  const std::array<uint32_t, kMaxComponents>& parameters;
  int damping;
};

/// The vertices of a cluster that are its own, but for the first.
struct OwnVertices {
  std::array<uint8_t, kMaxLocal + 1> vertices;
  uint32_t count = 0;
};

/// Copies the vertices that a cluster shares with earlier ones, and lists the others: without a
/// branch, which would be unpredictable.
OwnVertices copy_shared(std::span<const uint32_t> source, uint32_t stride, std::span<int32_t> group,
                        int32_t* integers) {
  OwnVertices own;
  std::array<uint8_t, kMaxLocal + 1> shared;
  uint32_t count = 0, copies = 0;
  const auto size = static_cast<uint32_t>(source.size());
  for (uint32_t v = 0; v < size; ++v) {
    own.vertices[count] = shared[copies] = static_cast<uint8_t>(v);
    count += (source[v] == kNone) & (v > 0);
    copies += source[v] != kNone;
  }
  own.count = count;
  for (uint32_t i = 0; i < copies; ++i) {
    const int32_t* const equal = group.data() + size_t{source[shared[i]]} * stride;
    std::copy_n(equal, stride, integers + size_t{shared[i]} * stride);
  }
  return own;
}

/// Reads a cluster's vertices but for the first, the group's from `first` on.
void decode_any(const Prediction& from, BitReader& in, std::span<int32_t> group, uint32_t first) {
  const uint32_t stride = row_stride(from.format), count = components(from.format);
  int32_t* const integers = group.data() + size_t{first} * stride;
  const OwnVertices own = copy_shared(from.source, stride, group, integers);
  BitReader bits = in;  // its state stays in registers
  for (uint32_t i = 0; i < own.count; ++i) {
    const Predictors predictors = from.predictors[own.vertices[i]];
    int32_t* const vertex = integers + size_t{own.vertices[i]} * stride;
    for (uint32_t c = 0; c < count; ++c) {
      const uint32_t parameter = from.parameters[c];
      const uint32_t remainder = parameter == kAllZero ? 0 : bits.rice(parameter);
      const uint32_t expected =
          predicted(from.format, c, integers + c, stride, predictors, from.damping);
      vertex[c] = static_cast<int32_t>(expected + static_cast<uint32_t>(unzigzag(remainder)));
    }
  }
  in = bits;
}

// ---- positions alone, with small values and remainders: the common case, four lanes at a time

using Lanes = uint32_t __attribute__((vector_size(16)));
using SignedLanes = int32_t __attribute__((vector_size(16)));

Lanes load(const int32_t* from) {
  Lanes lanes;
  std::memcpy(&lanes, from, sizeof(lanes));
  return lanes;
}
void store(Lanes lanes, int32_t* to) { std::memcpy(to, &lanes, sizeof(lanes)); }

/// Whether one refill holds two remainders, or the third; and values are so small that no
/// prediction leaves 32 bits.
bool are_small(std::span<const ComponentRange> ranges,
               const std::array<uint32_t, kMaxComponents>& parameters) {
  constexpr uint32_t kMostParameters = 56 - 2 * kRiceEscape;
  constexpr int64_t kMostValue = 1 << 26;
  bool all = parameters[0] + parameters[1] <= kMostParameters && parameters[2] < kAllZero;
  for (uint32_t c = 0; c < 3; ++c) {
    const int64_t highest = ranges[c].lowest + (int64_t{1} << ranges[c].bits);
    all = all && parameters[c] <= kMostParameters && ranges[c].lowest >= -kMostValue &&
          highest <= kMostValue;
  }
  return all;
}

/// As decode_any. That there is no choice within a vertex makes it twice as fast.
void decode_positions(const Prediction& from, BitReader& in, std::span<int32_t> group,
                      uint32_t first) {
  constexpr uint32_t kStride = 4;
  int32_t* const integers = group.data() + size_t{first} * kStride;
  const OwnVertices own = copy_shared(from.source, kStride, group, integers);
  BitReader bits = in;
  const auto [k0, k1, k2] = std::array{from.parameters[0], from.parameters[1], from.parameters[2]};
  const auto damping = static_cast<uint32_t>(from.damping);
  const Lanes once = Lanes{} - (damping & 1), twice = Lanes{} - (damping >> 1);
  for (uint32_t i = 0; i < own.count; ++i) {
    const uint32_t v = own.vertices[i];
    const Predictors predictors = from.predictors[v];
    bits.refill();
    const uint32_t r0 = bits.take_rice(k0), r1 = bits.take_rice(k1);
    const uint32_t r2 = bits.rice(k2);
    const Lanes zigzag{r0, r1, r2, 0};
    const Lanes across = load(integers + kStride * predictors.across());
    const Lanes sum = load(integers + kStride * predictors.a()) +
                      load(integers + kStride * predictors.b()) - across;
    const Lanes bend = sum - across, bends = (bend & once) + ((bend + bend) & twice);
    const auto damped = reinterpret_cast<Lanes>(reinterpret_cast<SignedLanes>(bends) >> 4);
    store(sum - damped + ((zigzag >> 1) ^ (Lanes{} - (zigzag & 1))), integers + kStride * v);
  }
  in = bits;
}

}  // namespace

void encode_vertices(const VertexFormat& format, std::span<const int32_t> integers,
                     std::span<const Predictors> predictors, std::span<const uint32_t> source,
                     std::span<const ComponentRange> ranges, BitWriter& out) {
  const uint32_t stride = components(format);
  const int damping = best_damping(integers, stride, predictors, source);
  out.write(static_cast<uint32_t>(damping), kDampingBits);
  std::vector<uint32_t> own;
  for (uint32_t v = 1; v < predictors.size(); ++v)
    if (source[v] == kNone) own.push_back(v);
  std::vector<uint32_t> remainders(stride * own.size());
  std::array<uint32_t, kMaxComponents> parameters{};
  for (uint32_t c = 0; c < stride; ++c) {
    const std::span<uint32_t> mine = std::span(remainders).subspan(c * own.size(), own.size());
    for (size_t i = 0; i < own.size(); ++i)
      mine[i] = zigzag(static_cast<int32_t>(
          static_cast<uint32_t>(integers[own[i] * stride + c]) -
          predicted(format, c, integers.data() + c, stride, predictors[own[i]], damping)));
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

void decode_vertices(const VertexFormat& format, std::span<const Predictors> predictors,
                     std::span<const uint32_t> source, std::span<const ComponentRange> ranges,
                     BitReader& in, std::span<int32_t> group, uint32_t first) {
  const uint32_t count = components(format), stride = row_stride(format);
  int32_t* const integers = group.data() + size_t{first} * stride;
  std::array<uint32_t, kMaxComponents> parameters;
  const auto damping = static_cast<int>(in.read(kDampingBits));
  for (uint32_t c = 0; c < count; ++c) {
    parameters[c] = in.read(kParameterBits);
    if (source[0] == kNone)
      integers[c] =
          static_cast<int32_t>(static_cast<uint32_t>(ranges[c].lowest) + in.read(ranges[c].bits));
  }
  const Prediction prediction{format, predictors, source, parameters, damping};
  const std::span<int32_t> values = group.first((size_t{first} + predictors.size()) * stride);
  const bool is_flat = !format.is_smooth[0] && !format.is_smooth[1] && !format.is_smooth[2];
  if (count == 3 && is_flat && are_small(ranges, parameters))
    decode_positions(prediction, in, values, first);
  else
    decode_any(prediction, in, values, first);
}

}  // namespace umbel::asset
