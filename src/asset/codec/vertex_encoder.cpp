#include <algorithm>

#include "asset/codec/attribute_code.hpp"
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

struct Parameter {
  uint32_t k;
  uint64_t bits;  ///< of all remainders
};

/// The parameter with the shortest code.
Parameter best_parameter(std::span<const uint32_t> remainders) {
  uint64_t sum = 0;
  for (const uint32_t r : remainders) sum += r;
  if (sum == 0) return {kAllZero, 0};
  // The best is near the mean's logarithm, or below where outliers have raised the mean.
  const auto near = static_cast<uint32_t>(std::bit_width(sum / remainders.size()));
  Parameter best{0, ~uint64_t{0}};
  for (uint32_t k = near - std::min(near, 4u); k <= std::min(near + 1, kAllZero - 1); ++k) {
    uint64_t bits = 0;
    for (const uint32_t r : remainders) bits += rice_bits(r, k);
    if (bits < best.bits) best = {k, bits};
  }
  return best;
}

/// An attribute of a cluster's vertices: what is left of them once they are predicted.
class AttributeEncoder {
 public:
  AttributeEncoder(const ClusterVertices& in, const AttributeFormat& format, uint32_t at,
                   std::span<const ComponentRange> ranges)
      : in_(in), format_(format), at_(at), count_(format.components), ranges_(ranges) {
    remainders_.resize(size() * count_);
    for (size_t v = 0; v < size(); ++v)
      if (in_.is_own(v)) predict(v);
    choose(remainders_, false);
    if (may_be_geometric(format) && predict_by_triangles()) choose(geometric_, true);
  }

  void write(BitWriter& out) const {
    const AttributeCode& code = best_;
    if (at_ > 0 && in_.has_twins) {
      out.write(code.twins != TwinRule::kNothing, 1);
      if (code.twins != TwinRule::kNothing) out.write(code.twins == TwinRule::kAll, 1);
    }
    if (may_be_geometric(format_)) out.write(code.is_geometric, 1);
    if (code.is_geometric)
      out.write(code.shift, kNormalShiftBits);
    else
      out.write(code.has_starts, 1);
    for (uint32_t c = 0; c < count_; ++c) {
      if (!is_coded(code, ranges_[c])) continue;
      out.write(code.parameters[0][c], kParameterBits);
      if (code.has_starts) out.write(code.parameters[1][c], kParameterBits);
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

  bool is_as_twin(size_t v) const {
    return in_.has_twin(v) &&
           std::equal(values(v), values(v) + count_,
                      in_.group.data() + size_t{in_.known.twin[v]} * in_.stride + at_);
  }

  /// Takes the best rule of twins for these remainders, if it beats what was chosen before.
  void choose(std::span<const uint32_t> remainders, bool geometric) {
    size_t twins = 0, same = 0;
    for (size_t v = 0; v < size(); ++v)
      if (in_.is_own(v) && in_.has_twin(v)) ++twins, same += is_as_twin(v);
    if (twins > 0 && same == twins) return consider(TwinRule::kAll, remainders, geometric);
    consider(TwinRule::kNothing, remainders, geometric);
    if (same > 0) consider(TwinRule::kFlags, remainders, geometric);
  }

  void consider(TwinRule rule, std::span<const uint32_t> remainders, bool geometric) {
    AttributeCode code;
    code.twins = rule;
    code.is_geometric = geometric;
    code.shift = shift_;
    code.has_starts = false;
    uint64_t joint = 0, apart = 0, fixed = 0;
    std::vector<uint32_t>& list = list_;
    std::array<uint8_t, kMaxComponents> of_all{};
    for (uint32_t c = 0; c < count_; ++c) {
      list.clear();
      size_t starts = 0;
      for (const bool start : {false, true}) {
        starts = list.size();
        for (size_t v = 0; v < size(); ++v)
          if (is_predicted(v, rule, geometric) &&
              (!geometric && starts_region(in_.cluster.predictors[v])) == start)
            list.push_back(remainders[v * count_ + c]);
      }
      const Parameter all = best_parameter(list);
      const Parameter usual = best_parameter(std::span(list).first(starts));
      const Parameter start = best_parameter(std::span(list).subspan(starts));
      of_all[c] = static_cast<uint8_t>(all.k);
      code.parameters[0][c] = static_cast<uint8_t>(usual.k);
      code.parameters[1][c] = static_cast<uint8_t>(start.k);
      joint += all.bits;
      apart += usual.bits + start.bits;
      if (is_coded(code, ranges_[c])) apart += kParameterBits;
      if (!geometric && in_.is_own(0)) fixed += ranges_[c].bits;
    }
    if (geometric) fixed += kNormalShiftBits;
    if (rule == TwinRule::kFlags)
      for (size_t v = 0; v < size(); ++v) fixed += in_.is_own(v) && in_.has_twin(v);
    code.has_starts = !geometric && apart < joint;
    if (!code.has_starts) code.parameters[0] = of_all;
    const uint64_t bits = fixed + std::min(apart, joint);
    if (bits < least_) least_ = bits, best_ = code;
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
    const std::vector<uint32_t>& remainders = code.is_geometric ? geometric_ : remainders_;
    const bool start = code.has_starts && starts_region(in_.cluster.predictors[v]);
    for (uint32_t c = 0; c < count_; ++c) {
      if (v == 0 && !code.is_geometric)
        out.write(static_cast<uint32_t>(values(0)[c]) - static_cast<uint32_t>(ranges_[c].lowest),
                  ranges_[c].bits);
      else if (is_coded(code, ranges_[c]) && code.parameters[start][c] != kAllZero)
        out.rice(remainders[v * count_ + c], code.parameters[start][c]);
    }
  }

  const ClusterVertices& in_;
  const AttributeFormat& format_;
  uint32_t at_, count_;
  std::span<const ComponentRange> ranges_;
  uint32_t shift_ = 0;
  std::vector<uint32_t> remainders_, geometric_, list_;
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
