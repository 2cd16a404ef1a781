#include "asset/codec/vertex_codec.hpp"

#include <algorithm>
#include <cstring>

namespace umbel::asset {
namespace {

constexpr uint32_t kParameterBits = 5, kDampingBits = 2;
constexpr uint32_t kAllZero = 31;  ///< in place of a Rice parameter: every remainder is 0
constexpr uint32_t kPositionComponents = 3;

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

/// The earlier vertex at the position of vertex `v` of the cluster, or kNone.
uint32_t twin_of(const KnownVertices& known, size_t v) {
  return known.twin.empty() ? kNone : known.twin[v];
}

bool any_twin(const KnownVertices& known) {
  return std::ranges::any_of(known.twin, [](uint32_t twin) { return twin != kNone; });
}

/// Whether a component's parameters are stored: where its values differ at all. Version 3 stores
/// all.
bool is_stored(const KnownVertices& known, const ComponentRange& range) {
  return known.twin.empty() || range.bits > 0;
}

/// The damping with the least sum of remainders of the positions.
int best_damping(std::span<const int32_t> integers, uint32_t stride,
                 std::span<const Predictors> predictors, const KnownVertices& known) {
  std::array<uint64_t, 1 << kDampingBits> sums{};
  for (size_t v = 1; v < predictors.size(); ++v) {
    if (known.equal[v] != kNone || twin_of(known, v) != kNone) continue;
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

/// How the components of a cluster's vertices are coded.
struct Parameters {
  int damping;
  std::array<uint32_t, kMaxComponents> usual;
  /// Of vertices that have a twin, whose value predicts theirs; kNoTwins: they are as all others.
  std::array<uint32_t, kMaxComponents> of_twins;
};
constexpr uint32_t kNoTwins = 32;

/// All that predicts a cluster's vertices.
struct Prediction {
  const VertexFormat& format;
  std::span<const Predictors> predictors;
  std::span<const uint32_t> source;
  std::span<const uint32_t> twin;  // empty: none has one
  const Parameters& parameters;
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

void decode_usual(const Prediction& from, BitReader& bits, uint32_t stride, const int32_t* integers,
                  const Predictors& predictors, int32_t* vertex) {
  const uint32_t count = components(from.format);
  for (uint32_t c = 0; c < count; ++c) {
    const uint32_t parameter = from.parameters.usual[c];
    const uint32_t remainder = parameter == kAllZero ? 0 : bits.rice(parameter);
    const uint32_t expected =
        predicted(from.format, c, integers + c, stride, predictors, from.parameters.damping);
    vertex[c] = static_cast<int32_t>(expected + static_cast<uint32_t>(unzigzag(remainder)));
  }
}

/// Reads a vertex that has the position of `twin`.
void decode_twin(const Prediction& from, BitReader& bits, uint32_t stride, const int32_t* integers,
                 const Predictors& predictors, const int32_t* twin, int32_t* vertex) {
  const uint32_t count = components(from.format);
  std::copy_n(twin, kPositionComponents, vertex);
  for (uint32_t c = kPositionComponents; c < count; ++c) {
    const bool is_beside = from.parameters.of_twins[c] != kNoTwins;
    const uint32_t parameter = is_beside ? from.parameters.of_twins[c] : from.parameters.usual[c];
    const uint32_t remainder = parameter == kAllZero ? 0 : bits.rice(parameter);
    const uint32_t expected = is_beside ? static_cast<uint32_t>(twin[c])
                                        : predicted(from.format, c, integers + c, stride,
                                                    predictors, from.parameters.damping);
    vertex[c] = static_cast<int32_t>(expected + static_cast<uint32_t>(unzigzag(remainder)));
  }
}

/// Reads a cluster's vertices but for the first, the group's from `first` on.
void decode_any(const Prediction& from, BitReader& in, std::span<int32_t> group, uint32_t first) {
  const uint32_t stride = row_stride(from.format);
  int32_t* const integers = group.data() + size_t{first} * stride;
  const OwnVertices own = copy_shared(from.source, stride, group, integers);
  BitReader bits = in;  // its state stays in registers
  for (uint32_t i = 0; i < own.count; ++i) {
    const uint32_t v = own.vertices[i];
    int32_t* const vertex = integers + size_t{v} * stride;
    const uint32_t twin = from.twin.empty() ? kNone : from.twin[v];
    if (twin == kNone)
      decode_usual(from, bits, stride, integers, from.predictors[v], vertex);
    else
      decode_twin(from, bits, stride, integers, from.predictors[v],
                  group.data() + size_t{twin} * stride, vertex);
  }
  in = bits;
}

// ---- small values, the common case: four lanes at a time

using Lanes = uint32_t __attribute__((vector_size(16)));
using SignedLanes = int32_t __attribute__((vector_size(16)));

Lanes load(const int32_t* from) {
  Lanes lanes;
  std::memcpy(&lanes, from, sizeof(lanes));
  return lanes;
}
void store(Lanes lanes, int32_t* to) { std::memcpy(to, &lanes, sizeof(lanes)); }

/// Whether values are so small that no prediction leaves 32 bits.
bool are_small(std::span<const ComponentRange> ranges) {
  constexpr int64_t kMostValue = 1 << 26;
  return std::ranges::all_of(ranges, [](const ComponentRange& range) {
    return range.lowest >= -kMostValue && range.lowest + (int64_t{1} << range.bits) <= kMostValue;
  });
}

/// Whether one refill holds two remainders of positions, or the third.
bool are_short(const std::array<uint32_t, kMaxComponents>& parameters) {
  constexpr uint32_t kMostParameters = 56 - 2 * kRiceEscape;
  return parameters[0] + parameters[1] <= kMostParameters && parameters[2] <= kMostParameters;
}

/// The flat prediction of four components.
struct FlatLanes {
  Lanes once, twice;  // masks of the damping's bits

  explicit FlatLanes(int damping)
      : once(Lanes{} - (static_cast<uint32_t>(damping) & 1)),
        twice(Lanes{} - (static_cast<uint32_t>(damping) >> 1)) {}
  /// `sum` is of a and b.
  Lanes operator()(Lanes sum, Lanes across) const {
    const Lanes flat = sum - across, bend = flat - across;
    const Lanes bends = (bend & once) + ((bend + bend) & twice);
    return flat - reinterpret_cast<Lanes>(reinterpret_cast<SignedLanes>(bends) >> 4);
  }
};
Lanes unzigzag(Lanes remainders) { return (remainders >> 1) ^ (Lanes{} - (remainders & 1)); }

/// The remainders of one kind of vertices: the components that have any, with their parameters, and
/// room for the remainders of all.
struct RemainderReader {
  struct Code {
    uint8_t component, parameter;
  };
  std::array<Code, kMaxComponents> codes;
  uint32_t count = 0;
  bool are_short = true;  // one refill holds two remainders
  alignas(16) std::array<int32_t, kMaxComponents> remainders{};

  void add(uint32_t component, uint32_t parameter) {
    if (parameter == kAllZero) return;
    codes[count++] = {static_cast<uint8_t>(component), static_cast<uint8_t>(parameter)};
    are_short = are_short && parameter <= 28 - kRiceEscape;
  }
  void read(BitReader& bits) {
    uint32_t i = 0;
    for (; are_short && i + 2 <= count; i += 2) {
      bits.refill();
      remainders[codes[i].component] = static_cast<int32_t>(bits.take_rice(codes[i].parameter));
      remainders[codes[i + 1].component] =
          static_cast<int32_t>(bits.take_rice(codes[i + 1].parameter));
    }
    for (; i < count; ++i)
      remainders[codes[i].component] = static_cast<int32_t>(bits.rice(codes[i].parameter));
  }
};

/// As decode_any.
void decode_lanes(const Prediction& from, BitReader& in, std::span<int32_t> group, uint32_t first) {
  const uint32_t count = components(from.format), stride = row_stride(from.format);
  RemainderReader usual, beside;
  alignas(16) std::array<int32_t, kMaxComponents> smooth{}, is_twins{};  // masks
  for (uint32_t c = 0; c < count; ++c) {
    const uint32_t of_twins = from.parameters.of_twins[c];
    smooth[c] = from.format.is_smooth[c] ? -1 : 0;
    is_twins[c] = c < kPositionComponents || of_twins != kNoTwins ? -1 : 0;
    usual.add(c, from.parameters.usual[c]);
    if (c >= kPositionComponents)
      beside.add(c, of_twins == kNoTwins ? from.parameters.usual[c] : of_twins);
  }
  int32_t* const integers = group.data() + size_t{first} * stride;
  const OwnVertices own = copy_shared(from.source, stride, group, integers);
  const FlatLanes flat(from.parameters.damping);
  BitReader bits = in;  // its state stays in registers
  for (uint32_t i = 0; i < own.count; ++i) {
    const uint32_t v = own.vertices[i];
    const uint32_t twin = from.twin.empty() ? kNone : from.twin[v];
    RemainderReader& reader = twin == kNone ? usual : beside;
    reader.read(bits);
    const Predictors predictors = from.predictors[v];
    const int32_t* const a = integers + size_t{predictors.a()} * stride;
    const int32_t* const b = integers + size_t{predictors.b()} * stride;
    const int32_t* const across = integers + size_t{predictors.across()} * stride;
    int32_t* const vertex = integers + size_t{v} * stride;
    for (uint32_t c = 0; c < stride; c += 4) {
      const Lanes sum = load(a + c) + load(b + c), mask = load(&smooth[c]);
      const auto mean = reinterpret_cast<Lanes>(reinterpret_cast<SignedLanes>(sum) >> 1);
      Lanes expected = (mean & mask) | (flat(sum, load(across + c)) & ~mask);
      if (twin != kNone) {
        const Lanes beside_mask = load(&is_twins[c]);
        const Lanes value = load(group.data() + size_t{twin} * stride + c);
        expected = (value & beside_mask) | (expected & ~beside_mask);
      }
      store(expected + unzigzag(load(&reader.remainders[c])), vertex + c);
    }
  }
  in = bits;
}

/// The same of positions alone, twice as fast.
void decode_positions(const Prediction& from, BitReader& in, std::span<int32_t> group,
                      uint32_t first) {
  constexpr uint32_t kStride = 4;
  int32_t* const integers = group.data() + size_t{first} * kStride;
  const OwnVertices own = copy_shared(from.source, kStride, group, integers);
  BitReader bits = in;
  const auto& usual = from.parameters.usual;
  const auto [k0, k1, k2] = std::array{usual[0], usual[1], usual[2]};
  const FlatLanes flat(from.parameters.damping);
  for (uint32_t i = 0; i < own.count; ++i) {
    const uint32_t v = own.vertices[i];
    const Predictors predictors = from.predictors[v];
    bits.refill();
    const uint32_t r0 = bits.take_rice(k0), r1 = bits.take_rice(k1);
    const uint32_t r2 = bits.rice(k2);
    const Lanes sum =
        load(integers + kStride * predictors.a()) + load(integers + kStride * predictors.b());
    store(
        flat(sum, load(integers + kStride * predictors.across())) + unzigzag(Lanes{r0, r1, r2, 0}),
        integers + kStride * v);
  }
  in = bits;
}

/// A component of a cluster's vertices: what is left of them once they are predicted.
class ComponentEncoder {
 public:
  ComponentEncoder(uint32_t component, const VertexFormat& format, std::span<const int32_t> group,
                   uint32_t first, std::span<const Predictors> predictors,
                   const KnownVertices& known, int damping) {
    const uint32_t stride = components(format);
    const int32_t* const column = group.data() + size_t{first} * stride + component;
    std::vector<uint32_t> all, beside;
    remainders_.reserve(predictors.size());
    all.reserve(predictors.size());
    for (size_t v = 1; v < predictors.size(); ++v) {
      const uint32_t twin = twin_of(known, v);
      if (known.equal[v] != kNone || (twin != kNone && component < kPositionComponents)) {
        remainders_.push_back(0);
        continue;
      }
      const auto value = static_cast<uint32_t>(column[v * stride]);
      remainders_.push_back(zigzag(static_cast<int32_t>(
          value - predicted(format, component, column, stride, predictors[v], damping))));
      all.push_back(remainders_.back());
      if (twin == kNone) continue;
      beside.push_back(zigzag(static_cast<int32_t>(
          value - static_cast<uint32_t>(group[size_t{twin} * stride + component]))));
    }
    usual_ = best_parameter(all);
    if (beside.empty()) return;
    std::vector<uint32_t> others;
    for (size_t v = 1; v < predictors.size(); ++v)
      if (known.equal[v] == kNone && twin_of(known, v) == kNone)
        others.push_back(remainders_[v - 1]);
    const uint32_t usual = best_parameter(others), of_twins = best_parameter(beside);
    if (bits(others, usual) + bits(beside, of_twins) + kParameterBits >= bits(all, usual_)) return;
    usual_ = usual;
    of_twins_ = of_twins;
    for (size_t v = 1, i = 0; v < predictors.size(); ++v)
      if (known.equal[v] == kNone && twin_of(known, v) != kNone) remainders_[v - 1] = beside[i++];
  }

  uint32_t usual() const { return usual_; }
  uint32_t of_twins() const { return of_twins_; }
  void write(size_t vertex, bool has_twin, BitWriter& out) const {
    const uint32_t parameter = has_twin && of_twins_ != kNoTwins ? of_twins_ : usual_;
    if (parameter != kAllZero) out.rice(remainders_[vertex - 1], parameter);
  }

 private:
  static uint64_t bits(std::span<const uint32_t> remainders, uint32_t parameter) {
    uint64_t sum = 0;
    if (parameter != kAllZero)
      for (const uint32_t r : remainders) sum += rice_bits(r, parameter);
    return sum;
  }

  std::vector<uint32_t> remainders_;  // of vertices from 1 on
  uint32_t usual_ = kAllZero, of_twins_ = kNoTwins;
};

/// Reads the parameters of a cluster, and its first vertex into `group`.
Parameters read_parameters(const KnownVertices& known, std::span<const ComponentRange> ranges,
                           bool has_twins, BitReader& in, std::span<int32_t> group,
                           size_t first_value, uint32_t stride) {
  Parameters read;
  read.damping = static_cast<int>(in.read(kDampingBits));
  const uint32_t twin = twin_of(known, 0);
  for (uint32_t c = 0; c < ranges.size(); ++c) {
    const bool stored = is_stored(known, ranges[c]);
    read.usual[c] = stored ? in.read(kParameterBits) : kAllZero;
    read.of_twins[c] = kNoTwins;
    if (has_twins && c >= kPositionComponents && stored && in.read(1))
      read.of_twins[c] = in.read(kParameterBits);
    if (known.equal[0] != kNone) continue;
    group[first_value + c] = twin != kNone && c < kPositionComponents
                                 ? group[size_t{twin} * stride + c]
                                 : static_cast<int32_t>(static_cast<uint32_t>(ranges[c].lowest) +
                                                        in.read(ranges[c].bits));
  }
  return read;
}

}  // namespace

void encode_vertices(const VertexFormat& format, std::span<const int32_t> group, uint32_t first,
                     std::span<const Predictors> predictors, const KnownVertices& known,
                     std::span<const ComponentRange> ranges, BitWriter& out) {
  const uint32_t stride = components(format);
  const std::span<const int32_t> integers = group.subspan(size_t{first} * stride);
  const int damping = best_damping(integers, stride, predictors, known);
  const bool has_twins = any_twin(known);
  out.write(static_cast<uint32_t>(damping), kDampingBits);
  std::vector<ComponentEncoder> encoders;
  for (uint32_t c = 0; c < stride; ++c) {
    const ComponentEncoder& encoder =
        encoders.emplace_back(c, format, group, first, predictors, known, damping);
    if (is_stored(known, ranges[c])) {
      out.write(encoder.usual(), kParameterBits);
      if (has_twins && c >= kPositionComponents) {
        out.write(encoder.of_twins() != kNoTwins, 1);
        if (encoder.of_twins() != kNoTwins) out.write(encoder.of_twins(), kParameterBits);
      }
    }
    if (known.equal[0] == kNone && (c >= kPositionComponents || twin_of(known, 0) == kNone))
      out.write(static_cast<uint32_t>(integers[c]) - static_cast<uint32_t>(ranges[c].lowest),
                ranges[c].bits);
  }
  for (size_t v = 1; v < predictors.size(); ++v) {
    if (known.equal[v] != kNone) continue;
    const bool has_twin = twin_of(known, v) != kNone;
    for (uint32_t c = has_twin ? kPositionComponents : 0; c < stride; ++c)
      encoders[c].write(v, has_twin, out);
  }
}

void decode_vertices(const VertexFormat& format, std::span<const Predictors> predictors,
                     const KnownVertices& known, std::span<const ComponentRange> ranges,
                     BitReader& in, std::span<int32_t> group, uint32_t first) {
  const uint32_t stride = row_stride(format);
  const bool has_twins = any_twin(known);
  const Parameters parameters =
      read_parameters(known, ranges, has_twins, in, group, size_t{first} * stride, stride);
  const Prediction prediction{format, predictors, known.equal,
                              has_twins ? known.twin : std::span<const uint32_t>{}, parameters};
  const std::span<int32_t> values = group.first((size_t{first} + predictors.size()) * stride);
  const bool is_flat = !format.is_smooth[0] && !format.is_smooth[1] && !format.is_smooth[2];
  if (!are_small(ranges))
    decode_any(prediction, in, values, first);
  else if (ranges.size() == 3 && is_flat && !has_twins && are_short(parameters.usual))
    decode_positions(prediction, in, values, first);
  else
    decode_lanes(prediction, in, values, first);
}

}  // namespace umbel::asset
