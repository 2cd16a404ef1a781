// Decodes the vertices of version 3 of the file format: vertex by vertex, all of its components.
#include "asset/codec/vertex_decoding.hpp"

namespace umbel::asset {
namespace {

using Parameters = std::array<uint32_t, kMaxComponents>;

/// All that predicts a cluster's vertices.
struct Prediction {
  const VertexFormat& format;
  std::span<const Predictors> predictors;
  std::span<const uint32_t> source;
  int damping;
  const Parameters& parameters;
};

/// Reads a cluster's vertices but for the first, from `integers` on; `own` are those it does not
/// share.
void decode_any(const Prediction& from, BitReader& in, int32_t* integers,
                std::span<const uint8_t> own) {
  const uint32_t count = components(from.format), stride = row_stride(from.format);
  BitReader bits = in;  // its state stays in registers
  for (const uint32_t v : own)
    for (uint32_t c = 0; c < count; ++c) {
      const uint32_t parameter = from.parameters[c];
      const uint32_t remainder = parameter == kAllZero ? 0 : bits.rice(parameter);
      const uint32_t expected = predicted(from.format.is_smooth[c], integers + c, stride,
                                          from.predictors[v], from.damping);
      integers[size_t{v} * stride + c] =
          static_cast<int32_t>(expected + static_cast<uint32_t>(unzigzag(remainder)));
    }
  in = bits;
}

/// The components that have remainders, with their parameters, and room for those of all.
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
    are_short = are_short && parameter <= 28 - kUnaryEscape;
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

/// As decode_any, of small values: four components at a time.
void decode_lanes(const Prediction& from, BitReader& in, int32_t* integers,
                  std::span<const uint8_t> own) {
  const uint32_t count = components(from.format), stride = row_stride(from.format);
  RemainderReader reader;
  alignas(16) std::array<int32_t, kMaxComponents> smooth{};  // masks
  for (uint32_t c = 0; c < count; ++c) {
    smooth[c] = from.format.is_smooth[c] ? -1 : 0;
    reader.add(c, from.parameters[c]);
  }
  const FlatLanes flat(from.damping);
  BitReader bits = in;  // its state stays in registers
  for (const uint32_t v : own) {
    reader.read(bits);
    const Predictors predictors = from.predictors[v];
    const int32_t* const a = integers + size_t{predictors.a()} * stride;
    const int32_t* const b = integers + size_t{predictors.b()} * stride;
    const int32_t* const across = integers + size_t{predictors.across()} * stride;
    int32_t* const vertex = integers + size_t{v} * stride;
    for (uint32_t c = 0; c < stride; c += 4) {
      const Lanes sum = load(a + c) + load(b + c), mask = load(&smooth[c]);
      const auto mean = reinterpret_cast<Lanes>(reinterpret_cast<SignedLanes>(sum) >> 1);
      const Lanes expected = (mean & mask) | (flat(sum, load(across + c)) & ~mask);
      store(expected + unzigzag_lanes(load(&reader.remainders[c])), vertex + c);
    }
  }
  in = bits;
}

}  // namespace

void decode_vertices_3(const VertexFormat& format, std::span<const Predictors> predictors,
                       std::span<const uint32_t> equal, std::span<const ComponentRange> ranges,
                       BitReader& in, std::span<int32_t> group, uint32_t first) {
  const uint32_t stride = row_stride(format);
  int32_t* const integers = group.data() + size_t{first} * stride;
  Parameters parameters;
  const auto damping = static_cast<int>(in.read(kDampingBits));
  for (uint32_t c = 0; c < ranges.size(); ++c) {
    parameters[c] = in.read(kParameterBits);
    if (equal[0] == kNone)
      integers[c] =
          static_cast<int32_t>(static_cast<uint32_t>(ranges[c].lowest) + in.read(ranges[c].bits));
  }
  const OwnVertices all = copy_shared(equal, stride, group, integers);
  const bool has_first = all.count > 0 && all.vertices[0] == 0;
  const auto own = std::span(all.vertices).first(all.count).subspan(has_first);
  const Prediction prediction{format, predictors, equal, damping, parameters};
  if (are_small(ranges))
    decode_lanes(prediction, in, integers, own);
  else
    decode_any(prediction, in, integers, own);
}

}  // namespace umbel::asset
