#include <algorithm>

#include "asset/codec/attribute_code.hpp"
#include "asset/codec/choose_code.hpp"
#include "asset/codec/uv_prediction.hpp"
#include "asset/codec/vertex_decoding.hpp"

namespace umbel::asset {
namespace {

/// What is the same for all attributes of a cluster.
struct ClusterVertices {
  std::span<const int32_t> group;
  uint32_t first, stride;
  ClusterTriangles cluster;
  KnownVertices known;
  bool has_twins;
  int damping;

  const int32_t* row(size_t v) const { return group.data() + (first + v) * stride; }
  bool is_own(size_t v) const { return known.equal[v] == kNone; }
  bool has_twin(size_t v) const { return known.twin[v] != kNone; }
};

/// The damping with the least sum of remainders of the positions.
int best_damping(const ClusterVertices& in) {
  std::array<uint64_t, 1 << kDampingBits> sums{};
  for (size_t v = 1; v < in.cluster.predictors.size(); ++v) {
    if (!in.is_own(v) || in.has_twin(v)) continue;
    const Predictors& p = in.cluster.predictors[v];
    for (uint32_t c = 0; c < kPositionComponents; ++c) {
      const auto at = [&](size_t vertex) { return int64_t{in.row(vertex)[c]}; };
      const int64_t sum = at(p.a()) + at(p.b()), across = at(p.across());
      const int64_t undamped = at(v) - (sum - across), bend = sum - 2 * across;
      for (int damping = 0; damping < 1 << kDampingBits; ++damping)
        sums[damping] += zigzag(static_cast<int32_t>(undamped + ((damping * bend) >> 4)));
    }
  }
  return static_cast<int>(std::min_element(sums.begin(), sums.end()) - sums.begin());
}

/// What predicts an attribute's values.
enum class PredictedBy { kVertices, kTriangles, kPositions };

/// An attribute of a cluster's vertices: what is left of them once they are predicted.
class AttributeEncoder {
 public:
  AttributeEncoder(const ClusterVertices& in, const AttributeFormat& format, uint32_t at,
                   std::span<const ComponentRange> ranges)
      : in_(in), format_(format), at_(at), count_(format.components), ranges_(ranges) {
    remainders_.resize(size() * count_);
    for (size_t v = 0; v < size(); ++v)
      if (in_.is_own(v)) predict(v);
    choose(remainders_, PredictedBy::kVertices);
    if (may_be_geometric(format) && predict_by_triangles())
      choose(geometric_, PredictedBy::kTriangles);
    if (may_be_mapped(format, ranges)) predict_by_positions();
  }

  void write(BitWriter& out) const {
    const AttributeCode& code = best_;
    if (at_ > 0 && in_.has_twins) {
      out.write(code.twins != TwinRule::kNothing, 1);
      if (code.twins != TwinRule::kNothing) out.write(code.twins == TwinRule::kAll, 1);
    }
    if (may_be_geometric(format_)) out.write(code.is_geometric, 1);
    if (may_be_mapped(format_, ranges_)) {
      out.write(code.is_mapped, 1);
      if (code.is_mapped) out.write(code.is_mirrored, 1);
    }
    if (code.is_geometric)
      out.write(code.shift, kNormalShiftBits);
    else
      out.write(code.has_starts, 1);
    out.write(code.has_kinds, 1);
    const auto write_code = [&](const RemainderCode& of) {
      out.write(of.parameter, kParameterBits);
      if (code.has_kinds && !of.is_all_zero()) out.write(of.kind, kKindBits);
    };
    for (uint32_t c = 0; c < count_; ++c) {
      if (!is_coded(code, ranges_[c])) continue;
      write_code(code.codes[0][c]);
      if (code.has_starts) write_code(code.codes[1][c]);
    }
    for (size_t v = 0; v < size(); ++v) write_vertex(v, out);
  }

 private:
  size_t size() const { return in_.cluster.predictors.size(); }
  const int32_t* values(size_t v) const { return in_.row(v) + at_; }

  void predict(size_t v) {
    if (v == 0) return;
    for (uint32_t c = 0; c < count_; ++c) {
      const uint32_t expected = predicted(format_.is_smooth, in_.row(0) + at_ + c, in_.stride,
                                          in_.cluster.predictors[v], in_.damping);
      remainders_[v * count_ + c] =
          zigzag(static_cast<int32_t>(static_cast<uint32_t>(values(v)[c]) - expected));
    }
  }

  /// False if a normal would not come back.
  bool predict_by_triangles() {
    shift_ = normal_shift(in_.row(0), in_.stride, in_.cluster.triangles);
    const int32_t steps = octahedral_steps(format_.bits);
    UnfoldedNormals normals;
    predict_normals(in_.row(0), in_.stride, in_.cluster.triangles, static_cast<uint32_t>(size()),
                    shift_, steps, normals);
    geometric_.resize(size() * count_);
    for (size_t v = 0; v < size(); ++v) {
      if (!in_.is_own(v)) continue;
      std::array<int32_t, 2> mine{values(v)[0], values(v)[1]};
      if (normals.is_lower[v]) {
        fold(mine[0], mine[1], steps);
        auto back = mine;
        fold(back[0], back[1], steps);
        if (!std::equal(back.begin(), back.end(), values(v))) return false;
      }
      const auto rest = [](int32_t value, int32_t expected) {
        return zigzag(
            static_cast<int32_t>(static_cast<uint32_t>(value) - static_cast<uint32_t>(expected)));
      };
      geometric_[2 * v] = rest(mine[0], normals.u[v]);
      geometric_[2 * v + 1] = rest(mine[1], normals.v[v]);
    }
    return true;
  }

  /// Of both kinds of maps, that which leaves less.
  void predict_by_positions() {
    std::vector<uint8_t> own;
    for (size_t v = 0; v < size(); ++v)
      if (in_.is_own(v)) own.push_back(static_cast<uint8_t>(v));
    UvMap map;
    map_positions(in_.row(0), in_.stride, in_.cluster.predictors, own, map);
    uint64_t least = ~uint64_t{0};
    for (const bool is_mirrored : {false, true}) {
      const MappedUvs mapped(map, is_mirrored);
      std::vector<uint32_t> remainders(size() * count_);
      uint64_t sum = 0;
      for (const uint32_t v : own) {
        if (v == 0) continue;
        const Lanes expected = mapped(v, in_.row(0) + at_, in_.stride);
        for (uint32_t c = 0; c < 2; ++c) {
          remainders[2 * v + c] =
              zigzag(static_cast<int32_t>(static_cast<uint32_t>(values(v)[c]) - expected[c]));
          sum += remainders[2 * v + c];
        }
      }
      if (sum < least) {
        least = sum;
        mapped_ = std::move(remainders);
        is_mirrored_ = is_mirrored;
      }
    }
    choose(mapped_, PredictedBy::kPositions);
  }

  bool is_as_twin(size_t v) const {
    return in_.has_twin(v) &&
           std::equal(values(v), values(v) + count_,
                      in_.group.data() + size_t{in_.known.twin[v]} * in_.stride + at_);
  }

  /// Takes the best rule of twins for these remainders, if it beats what was chosen before.
  void choose(std::span<const uint32_t> remainders, PredictedBy by) {
    size_t twins = 0, same = 0;
    for (size_t v = 0; v < size(); ++v)
      if (in_.is_own(v) && in_.has_twin(v)) ++twins, same += is_as_twin(v);
    if (twins > 0 && same == twins) return consider(TwinRule::kAll, remainders, by);
    consider(TwinRule::kNothing, remainders, by);
    if (same > 0) consider(TwinRule::kFlags, remainders, by);
  }

  void consider(TwinRule rule, std::span<const uint32_t> remainders, PredictedBy by) {
    const bool geometric = by == PredictedBy::kTriangles;
    AttributeCode code;
    code.twins = rule;
    code.is_geometric = geometric;
    code.shift = shift_;
    code.is_mapped = by == PredictedBy::kPositions;
    code.is_mirrored = is_mirrored_;
    std::vector<ComponentChoices>& choices = choices_;
    choices.clear();
    for (uint32_t c = 0; c < count_; ++c)
      choices.push_back(choices_of(c, rule, remainders, geometric));
    for (const bool has_kinds : {false, true})
      for (const bool has_starts : {false, true}) {
        if (geometric && has_starts) continue;
        code.has_kinds = has_kinds;
        code.has_starts = has_starts;
        uint64_t bits = bits_of_rest(rule, geometric);
        for (uint32_t c = 0; c < count_; ++c) bits += take_codes(choices[c], c, code);
        // They take a little longer to decode.
        if (has_kinds) bits += bits / kLeastGain;
        if (code.is_mapped) bits += bits / kLeastGainOfMaps;
        if (bits < least_) least_ = bits, best_ = code;
      }
  }

  /// The best codes of one component's remainders.
  struct ComponentChoices {
    CodeChoices all, usual, starts;
  };
  ComponentChoices choices_of(uint32_t c, TwinRule rule, std::span<const uint32_t> remainders,
                              bool geometric) {
    list_.clear();
    size_t starts = 0;
    for (const bool start : {false, true}) {
      starts = list_.size();
      for (size_t v = 0; v < size(); ++v)
        if (is_predicted(v, rule, geometric) &&
            (!geometric && starts_region(in_.cluster.predictors[v])) == start)
          list_.push_back(remainders[v * count_ + c]);
    }
    const std::span all(list_);
    ComponentChoices choices{chooser_.choose(all), {}, {}};
    if (geometric) return choices;
    choices.usual = chooser_.choose(all.first(starts));
    choices.starts = chooser_.choose(all.subspan(starts));
    return choices;
  }

  /// Takes the best codes of a component that `code` allows; their bits, and those of what is
  /// coded.
  uint64_t take_codes(const ComponentChoices& choices, uint32_t c, AttributeCode& code) const {
    const auto allowed = [&](const CodeChoices& of) { return code.has_kinds ? of.any : of.rice; };
    const auto bits_with_code = [&](const CodeChoice& choice) {
      if (!is_coded(code, ranges_[c])) return choice.bits;
      const bool has_kind = code.has_kinds && !choice.code.is_all_zero();
      return choice.bits + kParameterBits + (has_kind ? kKindBits : 0);
    };
    const CodeChoice usual = allowed(code.has_starts ? choices.usual : choices.all);
    const CodeChoice start = code.has_starts ? allowed(choices.starts) : usual;
    code.codes[0][c] = usual.code;
    code.codes[1][c] = start.code;
    return bits_with_code(usual) + (code.has_starts ? bits_with_code(start) : 0);
  }

  /// Of what takes the same, whatever the codes.
  uint64_t bits_of_rest(TwinRule rule, bool geometric) const {
    uint64_t bits = geometric ? kNormalShiftBits : 0;
    if (!geometric && in_.is_own(0))
      for (uint32_t c = 0; c < count_; ++c) bits += ranges_[c].bits;
    if (rule == TwinRule::kFlags)
      for (size_t v = 0; v < size(); ++v) bits += in_.is_own(v) && in_.has_twin(v);
    return bits;
  }

  /// Whether a remainder says what the values of a vertex are.
  bool is_predicted(size_t v, TwinRule rule, bool geometric) const {
    if (!in_.is_own(v) || (v == 0 && !geometric)) return false;
    if (rule == TwinRule::kNothing || !in_.has_twin(v)) return true;
    return rule == TwinRule::kFlags && !is_as_twin(v);
  }

  void write_vertex(size_t v, BitWriter& out) const {
    const AttributeCode& code = best_;
    if (!in_.is_own(v)) return;
    if (in_.has_twin(v) && code.twins != TwinRule::kNothing) {
      if (code.twins == TwinRule::kAll) return;
      out.write(is_as_twin(v), 1);
      if (is_as_twin(v)) return;
    }
    const std::vector<uint32_t>& remainders = code.is_geometric ? geometric_
                                              : code.is_mapped  ? mapped_
                                                                : remainders_;
    const bool start = code.has_starts && starts_region(in_.cluster.predictors[v]);
    for (uint32_t c = 0; c < count_; ++c) {
      if (v == 0 && !code.is_geometric)
        out.write(static_cast<uint32_t>(values(0)[c]) - static_cast<uint32_t>(ranges_[c].lowest),
                  ranges_[c].bits);
      else if (is_coded(code, ranges_[c]) && !code.codes[start][c].is_all_zero())
        write_remainder(remainders[v * count_ + c], code.codes[start][c], out);
    }
  }

  // Kinds of codes must save one of so many bits.
  static constexpr uint64_t kLeastGain = 48;
  // And maps of positions to texture coordinates, which take longer.
  static constexpr uint64_t kLeastGainOfMaps = 64;

  const ClusterVertices& in_;
  const AttributeFormat& format_;
  uint32_t at_, count_;
  std::span<const ComponentRange> ranges_;
  uint32_t shift_ = 0;
  bool is_mirrored_ = false;
  std::vector<uint32_t> remainders_, geometric_, mapped_, list_;
  CodeChooser chooser_;
  std::vector<ComponentChoices> choices_;
  uint64_t least_ = ~uint64_t{0};
  AttributeCode best_;
};

}  // namespace

void encode_vertices(const VertexFormat& format, std::span<const int32_t> group, uint32_t first,
                     const ClusterTriangles& cluster, const KnownVertices& known,
                     std::span<const ComponentRange> ranges, BitWriter& out) {
  const bool has_twins =
      std::ranges::any_of(known.twin, [](uint32_t twin) { return twin != kNone; });
  ClusterVertices vertices{group, first, components(format), cluster, known, has_twins, 0};
  vertices.damping = best_damping(vertices);
  out.write(static_cast<uint32_t>(vertices.damping), kDampingBits);
  uint32_t at = 0;
  for (const AttributeFormat& attribute : format.attributes) {
    const auto mine = ranges.subspan(at, attribute.components);
    if (is_stored(mine)) AttributeEncoder(vertices, attribute, at, mine).write(out);
    at += attribute.components;
  }
}

}  // namespace umbel::asset
