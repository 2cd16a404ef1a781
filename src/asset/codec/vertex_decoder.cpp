// Decodes what vertex_encoder.cpp writes: attribute after attribute, each of all vertices.
#include "asset/codec/attribute_code.hpp"
#include "asset/codec/uv_prediction.hpp"
#include "asset/codec/vertex_decoding.hpp"

namespace umbel::asset {
namespace {

/// An attribute of the format, and its first component.
struct Column {
  const AttributeFormat& format;
  uint32_t at;
  std::span<const ComponentRange> ranges;
};

/// Which codes the remainders of a vertex have.
enum Kind : uint32_t { kUsual = 0, kStart = 1 };

/// What predicts a vertex: three rows of the group, as offsets.
struct Source {
  size_t a, b, across;
  Kind kind;
};

/// Where the values of vertices come from.
struct VertexSources {
  const Predictors* predictors;
  size_t first, stride;

  UMBEL_READ_INLINE Source operator()(uint32_t v) const {
    const Predictors p = predictors[v];
    return {first + p.a() * stride, first + p.b() * stride, first + p.across() * stride,
            starts_region(p) ? kStart : kUsual};
  }
};

/// Of vertices whose twins tell nothing.
struct OwnSources : VertexSources {
  UMBEL_READ_INLINE bool is_copy(uint32_t, BitReader&) const { return false; }
  size_t twin_row(uint32_t) const { return 0; }
};

/// Of vertices that have the values of their twins: with kFlags if a bit says so.
template <bool kFlags>
struct TwinSources : VertexSources {
  const uint32_t* twin;

  UMBEL_READ_INLINE bool is_copy(uint32_t v, BitReader& bits) const {
    return kFlags ? bits.take(twin[v] != kNone) != 0 : twin[v] != kNone;
  }
  size_t twin_row(uint32_t v) const { return twin[v] * stride; }
};

/// The codes of a component by kind of vertex.
struct Codes {
  std::array<const UnaryClass*, 2> classes;

  Codes(const AttributeCode& code, uint32_t component)
      : classes{unary_classes(code.codes[0][component]).data(),
                unary_classes(code.codes[1][component]).data()} {}
  UMBEL_READ_INLINE uint32_t take(Kind kind, BitReader& bits) const {
    return bits.in_class(classes[kind]);
  }
};

/// Reads the vertices of a cluster.
class ClusterReader {
 public:
  ClusterReader(uint32_t version, const VertexFormat& format, const ClusterTriangles& cluster,
                const KnownVertices& known, BitReader& in, std::span<int32_t> group, uint32_t first)
      : version_(version),
        cluster_(cluster),
        known_(known),
        in_(in),
        stride_(row_stride(format)),
        group_(group.data()),
        first_(size_t{first} * stride_),
        damping_(static_cast<int>(in.read(kDampingBits))),
        own_(copy_shared(known.equal, row_stride(format), group, group_ + first_)) {}

  void read(const Column& column) {
    if (!is_stored(column.ranges)) {
      fill_lowest(column);
      return;
    }
    const AttributeCode code = read_code(column);
    read_first(column, code);
    const VertexSources from{cluster_.predictors.data(), first_, stride_};
    const OwnSources sources{from};
    const TwinSources<false> copies{from, known_.twin.data()};
    if (column.at == 0 && are_fast_positions(column)) {
      if (code.twins == TwinRule::kNothing && is_plain(code))
        read_plain_positions(code);
      else if (code.twins == TwinRule::kAll)
        read_positions(code, copies);
      else
        read_positions(code, sources);
    } else if (code.twins == TwinRule::kFlags) {
      read_others(column, code, TwinSources<true>{from, known_.twin.data()});
    } else if (code.twins == TwinRule::kAll) {
      read_others(column, code, copies);
    } else {
      read_others(column, code, sources);
    }
  }

 private:
  std::span<const uint8_t> own() const { return std::span(own_.vertices).first(own_.count); }
  /// Those that predictions are for: vertex 0 has none but its triangles'.
  std::span<const uint8_t> own(const AttributeCode& code) const {
    const bool without_first = !code.is_geometric && own_.count > 0 && own_.vertices[0] == 0;
    return own().subspan(without_first);
  }
  bool has_twins() const { return !known_.twin.empty(); }
  int32_t* row(uint32_t v) const { return group_ + first_ + v * stride_; }

  void fill_lowest(const Column& column) {
    for (uint32_t c = 0; c < column.ranges.size(); ++c) {
      const int32_t lowest = column.ranges[c].lowest;
      for (const uint32_t v : own()) row(v)[column.at + c] = lowest;
    }
  }

  AttributeCode read_code(const Column& column) {
    AttributeCode code;
    if (column.at == 0)
      code.twins = has_twins() ? TwinRule::kAll : TwinRule::kNothing;
    else if (has_twins() && in_.read(1))
      code.twins = in_.read(1) ? TwinRule::kAll : TwinRule::kFlags;
    if (may_be_geometric(column.format) && in_.read(1)) {
      code.is_geometric = true;
      code.shift = in_.read(kNormalShiftBits);
    } else {
      if (version_ > 5 && may_be_mapped(column.format, column.ranges) && in_.read(1)) {
        code.is_mapped = true;
        code.is_mirrored = in_.read(1) != 0;
      }
      code.has_starts = in_.read(1) != 0;
    }
    code.has_kinds = version_ > 4 && in_.read(1) != 0;
    for (uint32_t c = 0; c < column.ranges.size(); ++c) {
      const bool coded = is_coded(code, column.ranges[c]);
      const RemainderCode usual = coded ? read_remainder_code(code) : RemainderCode{kAllZero, 0};
      code.codes[0][c] = usual;
      code.codes[1][c] = coded && code.has_starts ? read_remainder_code(code) : usual;
    }
    return code;
  }

  RemainderCode read_remainder_code(const AttributeCode& of) {
    RemainderCode code{static_cast<uint8_t>(in_.read(kParameterBits)), 0};
    if (of.has_kinds && !code.is_all_zero()) code.kind = static_cast<uint8_t>(in_.read(kKindBits));
    if (!code.is_valid()) corrupt("an exponential code has a parameter above 15");
    return code;
  }

  /// Vertex 0, unless triangles predict it.
  void read_first(const Column& column, const AttributeCode& code) {
    if (code.is_geometric || own_.count == 0 || own_.vertices[0] != 0) return;
    const bool may_copy = code.twins != TwinRule::kNothing && known_.twin[0] != kNone;
    const bool copied = may_copy && (code.twins == TwinRule::kAll || in_.read(1));
    for (uint32_t c = 0; c < column.ranges.size(); ++c) {
      int32_t& value = row(0)[column.at + c];
      if (copied)
        value = group_[known_.twin[0] * stride_ + column.at + c];
      else
        value = static_cast<int32_t>(static_cast<uint32_t>(column.ranges[c].lowest) +
                                     in_.read(column.ranges[c].bits));
    }
  }

  static bool are_fast_positions(const Column& column) {
    return column.ranges.size() == 3 && !column.format.is_smooth && are_small(column.ranges);
  }

  template <typename Sources>
  void read_others(const Column& column, const AttributeCode& code, const Sources sources) {
    const bool small = are_small(column.ranges), smooth = column.format.is_smooth != 0;
    const size_t count = column.ranges.size();
    if (code.is_geometric)
      read_geometric(column, code, sources);
    else if (code.is_mapped)
      read_mapped_pair(column, code, sources);
    else if (small && count == 2)
      smooth ? read_smooth_pair(column, code, sources) : read_flat_pair(column, code, sources);
    else
      read_any(column, code, sources);
  }

  /// The largest parameter at which one refill holds two Rice codes.
  static constexpr uint32_t kMostPlain = (56 - 2 * kUnaryEscape) / 2;
  /// Whether positions have such codes, the same for all vertices.
  static bool is_plain(const AttributeCode& code) {
    const auto& usual = code.codes[0];
    return !code.has_starts && std::all_of(usual.begin(), usual.begin() + 3, [](const auto& of) {
      return of.kind == 0 && of.parameter <= kMostPlain;
    });
  }

  template <typename Sources>
  [[gnu::noinline]] void read_any(const Column& column, const AttributeCode& code,
                                  const Sources sources) {
    BitReader bits = in_;  // its state stays in registers
    const int32_t* const values = group_ + column.at;
    for (const uint32_t v : own(code)) {
      bits.refill();
      if (sources.is_copy(v, bits)) {
        std::copy_n(values + sources.twin_row(v), column.ranges.size(), row(v) + column.at);
        continue;
      }
      const Source source = sources(v);
      for (uint32_t c = 0; c < column.ranges.size(); ++c) {
        const auto at = [&](size_t offset) { return int64_t{values[offset + c]}; };
        const uint32_t remainder = bits.in_class(unary_classes(code.codes[source.kind][c]).data());
        const uint32_t expected =
            column.format.is_smooth
                ? predicted_smooth(at(source.a), at(source.b))
                : predicted_flat(at(source.a), at(source.b), at(source.across), damping_);
        row(v)[column.at + c] =
            static_cast<int32_t>(expected + static_cast<uint32_t>(unzigzag(remainder)));
      }
    }
    in_ = bits;
  }

  /// Three components predicted flat, four lanes at a time: the fourth is another attribute's,
  /// which comes later.
  template <typename Sources>
  [[gnu::noinline]] void read_positions(const AttributeCode& code, const Sources sources) {
    BitReader bits = in_;
    const size_t stride = stride_;
    int32_t *const group = group_, *const mine = group_ + first_;
    const FlatLanes flat(damping_);
    const std::array codes{Codes(code, 0), Codes(code, 1), Codes(code, 2)};
    for (const uint32_t v : own(code)) {
      if (sources.is_copy(v, bits)) {
        store(load(group + sources.twin_row(v)), mine + v * stride);
        continue;
      }
      bits.refill();
      const Source source = sources(v);
      const uint32_t r0 = codes[0].take(source.kind, bits);
      const uint32_t r1 = codes[1].take(source.kind, bits);
      const uint32_t r2 = codes[2].take(source.kind, bits);
      const Lanes sum = load(group + source.a) + load(group + source.b);
      store(flat(sum, load(group + source.across)) + unzigzag_lanes(Lanes{r0, r1, r2, 0}),
            mine + v * stride);
    }
    in_ = bits;
  }

  /// The same without twins and starts, of short codes: what scans consist of.
  void read_plain_positions(const AttributeCode& code) {
    BitReader bits = in_;
    const size_t stride = stride_;
    int32_t* const mine = group_ + first_;
    const FlatLanes flat(damping_);
    const auto parameter = [&](size_t c) { return uint32_t{code.codes[0][c].parameter}; };
    const uint32_t k0 = parameter(0), k1 = parameter(1), k2 = parameter(2);
    for (const uint32_t v : own(code)) {
      const Predictors p = cluster_.predictors[v];
      bits.refill();
      const uint32_t r0 = bits.take_rice(k0), r1 = bits.take_rice(k1);
      const uint32_t r2 = bits.rice(k2);
      const Lanes sum = load(mine + stride * p.a()) + load(mine + stride * p.b());
      store(flat(sum, load(mine + stride * p.across())) + unzigzag_lanes(Lanes{r0, r1, r2, 0}),
            mine + stride * v);
    }
    in_ = bits;
  }

  /// `predict` gives what is expected of a vertex, from its number and its sources.
  template <typename Sources, typename Predict>
  [[gnu::noinline]] void read_pair(const Column& column, const AttributeCode& code,
                                   const Sources sources, const Predict predict) {
    BitReader bits = in_;
    int32_t *const values = group_ + column.at, *const mine = values + first_;
    const size_t stride = stride_;
    const std::array codes{Codes(code, 0), Codes(code, 1)};
    for (const uint32_t v : own(code)) {
      bits.refill();
      if (sources.is_copy(v, bits)) {
        store_two(load_two(values + sources.twin_row(v)), mine + v * stride);
        continue;
      }
      const Source source = sources(v);
      const uint32_t first = codes[0].take(source.kind, bits);
      const uint32_t second = codes[1].take(source.kind, bits);
      const Lanes expected = predict(v, source);
      store_two(expected + unzigzag_lanes(Lanes{first, second, 0, 0}), mine + v * stride);
    }
    in_ = bits;
  }

  template <typename Sources>
  void read_smooth_pair(const Column& column, const AttributeCode& code, const Sources sources) {
    const int32_t* const values = group_ + column.at;
    read_pair(column, code, sources, [values](uint32_t, const Source& source) {
      const Lanes sum = load_two(values + source.a) + load_two(values + source.b);
      return reinterpret_cast<Lanes>(reinterpret_cast<SignedLanes>(sum) >> 1);
    });
  }

  template <typename Sources>
  void read_flat_pair(const Column& column, const AttributeCode& code, const Sources sources) {
    const int32_t* const values = group_ + column.at;
    const FlatLanes flat(damping_);
    read_pair(column, code, sources, [values, flat](uint32_t, const Source& source) {
      const Lanes sum = load_two(values + source.a) + load_two(values + source.b);
      return flat(sum, load_two(values + source.across));
    });
  }

  template <typename Sources>
  void read_mapped_pair(const Column& column, const AttributeCode& code, const Sources sources) {
    if (!has_map_) {
      map_positions(group_ + first_, static_cast<uint32_t>(stride_), cluster_.predictors, own(),
                    map_);
      has_map_ = true;
    }
    const int32_t* const mine = group_ + column.at + first_;
    const size_t stride = stride_;
    const MappedUvs mapped(map_, code.is_mirrored);
    read_pair(column, code, sources,
              [=](uint32_t v, const Source&) { return mapped(v, mine, stride); });
  }

  template <typename Sources>
  [[gnu::noinline]] void read_geometric(const Column& column, const AttributeCode& code,
                                        const Sources sources) {
    const int32_t steps = octahedral_steps(column.format.bits);
    UnfoldedNormals normals;
    predict_normals(group_ + first_, static_cast<uint32_t>(stride_), cluster_.triangles,
                    static_cast<uint32_t>(cluster_.predictors.size()), code.shift, steps, normals);
    BitReader bits = in_;
    const std::array codes{Codes(code, 0), Codes(code, 1)};
    const size_t stride = stride_;
    int32_t *const values = group_ + column.at, *const mine = values + first_;
    for (const uint32_t v : own()) {
      bits.refill();
      if (sources.is_copy(v, bits)) {
        store_two(load_two(values + sources.twin_row(v)), mine + v * stride);
        continue;
      }
      const uint32_t x_rest = codes[0].take(kUsual, bits);
      const uint32_t y_rest = codes[1].take(kUsual, bits);
      const auto sum = [](int32_t expected, uint32_t rest) {
        return static_cast<int32_t>(static_cast<uint32_t>(expected) +
                                    static_cast<uint32_t>(unzigzag(rest)));
      };
      const int32_t x = sum(normals.u[v], x_rest), y = sum(normals.v[v], y_rest);
      int32_t folded_x = x, folded_y = y;
      fold(folded_x, folded_y, steps);
      const bool is_lower = normals.is_lower[v] != 0;
      mine[v * stride] = is_lower ? folded_x : x;
      mine[v * stride + 1] = is_lower ? folded_y : y;
    }
    in_ = bits;
  }

  uint32_t version_;  // of the file format
  const ClusterTriangles& cluster_;
  const KnownVertices& known_;
  BitReader& in_;
  size_t stride_;
  int32_t* group_;
  size_t first_;  // of its values, in the group's
  int damping_;
  OwnVertices own_;
  bool has_map_ = false;
  UvMap map_;
};

}  // namespace

void decode_vertices(uint32_t version, const VertexFormat& format, const ClusterTriangles& cluster,
                     const KnownVertices& known, std::span<const ComponentRange> ranges,
                     BitReader& in, std::span<int32_t> group, uint32_t first) {
  ClusterReader reader(version, format, cluster, known, in, group, first);
  uint32_t at = 0;
  for (const AttributeFormat& attribute : format.attributes) {
    reader.read({attribute, at, ranges.subspan(at, attribute.components)});
    at += attribute.components;
  }
}

}  // namespace umbel::asset
