// Quantises attributes to integers and back.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>

#include "asset/codec/octahedral.hpp"
#include "asset/codec/vertex_codec.hpp"
#include "base/bytes.hpp"
#include "base/math.hpp"
#include "base/srgb.hpp"

namespace umbel::asset {
namespace {

constexpr uint32_t kMaxBits = 16;
constexpr uint32_t kMostSets = 255;

/// An integer in the order of the floats, which keeps every bit.
int32_t ordered(float f) {
  const auto bits = std::bit_cast<int32_t>(f);
  return bits < 0 ? bits ^ 0x7fffffff : bits;
}
float unordered(int32_t i) { return std::bit_cast<float>(i < 0 ? i ^ 0x7fffffff : i); }

int32_t on_grid(float f, float step) {
  // Division by a power of two is exact. Adding this rounds a double to a whole number.
  constexpr double kWhole = 0x1.8p52;
  const double i = std::clamp(double{f} / double{step}, -2147483647.0, 2147483647.0);
  return static_cast<int32_t>((i + kWhole) - kWhole);
}

int32_t rounded(float f) { return static_cast<int32_t>(std::lrint(f)); }

// ---- unit vectors (Meyer et al., "On Floating-Point Normal Vectors", 2010)

float sign_of(float f) { return f < 0 ? -1.0f : 1.0f; }

Vec2 to_octahedron(const Vec3& v) {
  const float sum = std::fabs(v.x) + std::fabs(v.y) + std::fabs(v.z);
  if (!(sum > 0) || !std::isfinite(sum)) return {0, 0};
  const float x = v.x / sum, y = v.y / sum;
  if (v.z >= 0) return {x, y};
  return {(1 - std::fabs(y)) * sign_of(x), (1 - std::fabs(x)) * sign_of(y)};
}

/// The edge of the square has each direction twice: the one with positive integers is taken.
void put_octahedral(const Vec3& normal, uint32_t bits, int32_t* out) {
  const Vec2 p = to_octahedron(normal);
  const int32_t steps = octahedral_steps(bits);
  out[0] = rounded(p.x * static_cast<float>(steps));
  out[1] = rounded(p.y * static_cast<float>(steps));
  if (std::abs(out[0]) == steps) out[1] = std::abs(out[1]);
  if (std::abs(out[1]) == steps) out[0] = std::abs(out[0]);
}

// ---- tangents: an angle in the plane of the decoded normal

/// The tangent plane of a normal: two orthonormal vectors (Duff et al., "Building an Orthonormal
/// Basis, Revisited", 2017). The integers of the normal, which is `n` once decoded, decide its
/// hemisphere, since floats may round differently on another machine.
struct TangentPlane {
  Vec3 u, v;
};
TangentPlane plane_of(const int32_t* normal, uint32_t bits, const Vec3& n) {
  const int64_t sum = std::abs(int64_t{normal[0]}) + std::abs(int64_t{normal[1]});
  const float sign = sum > octahedral_steps(bits) ? -1.0f : 1.0f;
  const float a = -1.0f / (sign + n.z), b = n.x * n.y * a;
  return {{1 + sign * n.x * n.x * a, sign * b, -sign * n.x}, {b, sign + n.y * n.y * a, -n.y}};
}

constexpr float kTwoPi = 6.28318530717958648f;

int32_t angle_of(const Vec4& tangent, const TangentPlane& plane, uint32_t bits) {
  const Vec3 t{tangent.x, tangent.y, tangent.z};
  const float angle = std::atan2(dot(t, plane.v), dot(t, plane.u));
  if (!std::isfinite(angle)) return 0;
  const auto steps = static_cast<float>(1u << bits);
  return rounded(angle / kTwoPi * steps) & static_cast<int32_t>((1u << bits) - 1);
}

Vec4 decoded_tangent(const int32_t* in, const TangentPlane& plane, uint32_t bits) {
  const float angle = static_cast<float>(in[0]) * (kTwoPi / static_cast<float>(1u << bits));
  const Vec3 t = plane.u * std::cos(angle) + plane.v * std::sin(angle);
  return {t.x, t.y, t.z, in[1] != 0 ? -1.0f : 1.0f};
}

// ---- colours (IEC 61966-2-1)

/// Values of colours' integers. Those of 8 bits come from a table: powers take most of the time.
class LinearColors {
 public:
  explicit LinearColors(uint32_t bits)
      : scale_(1.0f / static_cast<float>((1u << bits) - 1)),
        table_(bits == 8 ? of_bytes() : nullptr) {}

  float plain(int32_t i) const { return static_cast<float>(i) * scale_; }
  float from_srgb(int32_t i) const {
    if (table_ != nullptr && static_cast<uint32_t>(i) < 256) return table_[i];
    return umbel::from_srgb(plain(i));
  }

 private:
  static const float* of_bytes() {
    static const std::array<float, 256> table = [] {
      std::array<float, 256> values;
      for (int i = 0; i < 256; ++i)
        values[i] = umbel::from_srgb(static_cast<float>(i) * (1.0f / 255.0f));
      return values;
    }();
    return table.data();
  }

  float scale_;
  const float* table_;
};

uint32_t components_of(const AttributeFormat& format) {
  switch (format.coding) {
    case Coding::kOctahedral:
    case Coding::kAngle:
      return 2;
    default:
      break;
  }
  switch (format.attribute) {
    case kUvs:
      return 2;
    case kTangents:
    case kColors:
    case kJoints:
    case kWeights:
      return 4;
    case kMaterial:
      return 1;
    default:
      return 3;
  }
}

/// Of those in Mesh::extras, but for texture coordinates.
bool is_extra(uint32_t attribute) {
  return attribute == kJoints || attribute == kWeights || attribute == kMaterial;
}
/// Whether it is in Mesh::extras.
bool is_extra(const AttributeFormat& f) {
  return is_extra(f.attribute) || (f.attribute == kUvs && f.set > 0);
}

bool is_allowed(const AttributeFormat& f, bool has_octahedral_normals) {
  const bool bits_are_right = f.bits >= 2 && f.bits <= kMaxBits;
  switch (f.coding) {
    case Coding::kFloats:
      return true;
    case Coding::kGrid:
      return (f.attribute == kPositions || f.attribute == kUvs || is_extra(f.attribute)) &&
             f.step > 0 && std::isfinite(f.step) &&
             std::frexp(f.step, std::array<int, 1>{}.data()) == 0.5f;
    case Coding::kOctahedral:
      return f.attribute == kNormals && bits_are_right;
    case Coding::kAngle:
      return f.attribute == kTangents && bits_are_right && has_octahedral_normals;
    case Coding::kSrgb:
      return f.attribute == kColors && bits_are_right;
  }
  return false;
}

int32_t integer_of(float f, const AttributeFormat& format) {
  return format.coding == Coding::kGrid ? on_grid(f, format.step) : ordered(f);
}

template <typename Vector>
using FloatsOf = std::array<float, sizeof(Vector) / sizeof(float)>;

template <typename Vector>
void put_floats(const Vector& value, const AttributeFormat& format, int32_t* out) {
  for (const float f : std::bit_cast<FloatsOf<Vector>>(value)) *out++ = integer_of(f, format);
}

/// Of vertices `stride` apart, `count` values each, to rows of `row` floats.
template <uint32_t kCount>
void get_floats(const AttributeFormat& format, const int32_t* in, uint32_t stride, size_t vertices,
                float* out, size_t row) {
  const auto each = [&](const auto& decoded) {
    for (size_t v = 0; v < vertices; ++v, in += stride, out += row)
      for (uint32_t k = 0; k < kCount; ++k) out[k] = decoded(in[k]);
  };
  if (format.coding == Coding::kGrid)
    each([step = format.step](int32_t i) { return static_cast<float>(i) * step; });
  else
    each([](int32_t i) { return unordered(i); });
}

void put_stream(const Mesh& streams, uint32_t vertex, const AttributeFormat& format, int32_t* out) {
  switch (format.attribute) {
    case kNormals:
      return put_floats(streams.normals[vertex], format, out);
    case kTangents:
      return put_floats(streams.tangents[vertex], format, out);
    case kUvs:
      return put_floats(streams.uvs[vertex], format, out);
    case kColors:
      return put_floats(streams.colors[vertex], format, out);
    default:
      return put_floats(streams.positions[vertex], format, out);
  }
}

/// One attribute of all the vertices, whose integers are `stride` apart.
void quantize_one(const AttributeFormat& format, const int32_t* normals, uint32_t normal_bits,
                  const Mesh& streams, std::span<const uint32_t> vertices, uint32_t stride,
                  int32_t* out) {
  const auto levels = static_cast<float>((1u << format.bits) - 1);
  for (size_t i = 0; i < vertices.size(); ++i, out += stride) {
    const uint32_t v = vertices[i];
    if (format.coding == Coding::kOctahedral) {
      put_octahedral(streams.normals[v], format.bits, out);
    } else if (format.coding == Coding::kAngle) {
      const Vec4& t = streams.tangents[v];
      const int32_t* const normal = normals + i * stride;
      const Vec3 n = decoded_normal(normal, normal_bits);
      out[0] = angle_of(t, plane_of(normal, normal_bits, n), format.bits);
      out[1] = t.w < 0;
    } else if (format.coding == Coding::kSrgb) {
      const Vec4& c = streams.colors[v];
      const float srgb[4] = {to_srgb(c.x), to_srgb(c.y), to_srgb(c.z), c.w};
      for (int k = 0; k < 4; ++k) out[k] = rounded(std::clamp(srgb[k], 0.0f, 1.0f) * levels);
    } else {
      put_stream(streams, v, format, out);
    }
  }
}

/// One of Mesh::extras, whose values start at index `at` of a vertex's.
void quantize_extra(const AttributeFormat& format, uint32_t at, const Mesh& streams,
                    std::span<const uint32_t> vertices, uint32_t stride, int32_t* out) {
  const size_t width = extra_width(streams.extras);
  for (size_t i = 0; i < vertices.size(); ++i, out += stride)
    for (uint32_t k = 0; k < format.components; ++k)
      out[k] = integer_of(streams.extra_values[vertices[i] * width + at + k], format);
}

/// Mesh::extras: kinds and values.
void dequantize_extras(const VertexFormat& format, std::span<const int32_t> integers,
                       lod::ClusterGeometry& geometry) {
  std::vector<Extra>& extras = geometry.extras;
  extras.clear();
  for (const AttributeFormat& f : format.attributes)
    if (is_known(f) && is_extra(f)) extras.push_back({static_cast<ExtraKind>(f.attribute), f.set});
  const size_t width = extra_width(extras);
  const uint32_t stride = row_stride(format);
  const size_t vertices = integers.size() / stride;
  geometry.extra_values.resize(vertices * width);
  size_t at = 0, to = 0;
  for (const AttributeFormat& f : format.attributes) {
    if (is_known(f) && is_extra(f)) {
      const auto get = f.components == 1   ? get_floats<1>
                       : f.components == 2 ? get_floats<2>
                                           : get_floats<4>;
      get(f, integers.data() + at, stride, vertices, geometry.extra_values.data() + to, width);
      to += f.components;
    }
    at += f.components;
  }
}

}  // namespace

bool is_known(const AttributeFormat& f) {
  if (is_extra(f))
    return f.coding <= Coding::kGrid && f.set <= kMostSets &&
           (f.attribute != kMaterial || f.set == 0);
  const bool attribute = f.attribute == kPositions || f.attribute == kNormals ||
                         f.attribute == kTangents || f.attribute == kUvs || f.attribute == kColors;
  return attribute && f.set == 0 && f.coding <= Coding::kSrgb;
}

VertexFormat make_format(std::vector<AttributeFormat> attributes) {
  VertexFormat format;
  bool has_octahedral_normals = false;
  if (attributes.empty() || attributes[0].attribute != kPositions || !is_known(attributes[0]))
    corrupt("the vertices have no positions that this version can read");
  const AttributeFormat* before = nullptr;
  for (AttributeFormat& f : attributes) {
    const bool rises = before == nullptr || before->attribute < f.attribute ||
                       (before->attribute == f.attribute && before->set < f.set);
    if (is_known(f) && f.components == 0) {
      f.components = static_cast<uint16_t>(components_of(f));
      f.is_smooth = f.attribute != kPositions && f.attribute != kUvs;
    }
    if (!rises || f.components == 0 || f.components > kMaxComponents || f.is_smooth > 1 ||
        (is_known(f) &&
         (f.components != components_of(f) || !is_allowed(f, has_octahedral_normals))))
      corrupt("attribute " + std::to_string(f.attribute) + " has the coding " +
              std::to_string(static_cast<uint32_t>(f.coding)) + " with " + std::to_string(f.bits) +
              " bits and the step " + std::to_string(f.step) + ", which cannot be");
    has_octahedral_normals |= f.coding == Coding::kOctahedral;
    format.is_smooth.insert(format.is_smooth.end(), f.components,
                            static_cast<uint8_t>(f.is_smooth));
    before = &f;
  }
  if (format.is_smooth.size() > kMaxComponents)
    corrupt("the vertices have " + std::to_string(format.is_smooth.size()) + " components");
  format.attributes = std::move(attributes);
  return format;
}

uint32_t components(const VertexFormat& format) {
  return static_cast<uint32_t>(format.is_smooth.size());
}

uint32_t row_stride(const VertexFormat& format) { return (components(format) + 3) & ~3u; }

void quantize(const VertexFormat& format, const Mesh& streams, std::span<const uint32_t> vertices,
              std::span<int32_t> out) {
  int32_t* at = out.data();
  const int32_t* normals = at;
  uint32_t normal_bits = 0, extra_at = 0;
  for (const AttributeFormat& f : format.attributes) {
    if (f.coding == Coding::kOctahedral) normals = at, normal_bits = f.bits;
    if (is_extra(f)) {
      quantize_extra(f, extra_at, streams, vertices, components(format), at);
      extra_at += f.components;
    } else {
      quantize_one(f, normals, normal_bits, streams, vertices, components(format), at);
    }
    at += components_of(f);
  }
}

void dequantize(const VertexFormat& format, std::span<const int32_t> integers,
                lod::ClusterGeometry& geometry) {
  const uint32_t stride = row_stride(format);
  const size_t count = integers.size() / stride;
  uint32_t at = 0, normal_bits = 0, normal_at = 0;
  for (const AttributeFormat& f : format.attributes) {
    const int32_t* in = integers.data() + at;
    at += f.components;
    if (!is_known(f) || is_extra(f)) continue;
    const auto fill = [&](auto& stream, const auto& decoded) {
      stream.resize(count);
      for (size_t v = 0; v < count; ++v) decoded(in + v * stride, stream[v]);
    };
    const auto floats = [&]<typename Vector>(std::vector<Vector>& stream) {
      stream.resize(count);
      constexpr uint32_t kWidth = sizeof(Vector) / sizeof(float);
      get_floats<kWidth>(f, in, stride, count, reinterpret_cast<float*>(stream.data()), kWidth);
    };
    if (f.coding == Coding::kOctahedral) {
      normal_bits = f.bits, normal_at = at - f.components;
      geometry.normals.resize(count);
      decode_normals(in, stride, normal_bits, geometry.normals);
    } else if (f.coding == Coding::kAngle) {
      geometry.tangents.resize(count);
      for (size_t v = 0; v < count; ++v) {
        const int32_t* const normal = integers.data() + v * stride + normal_at;
        const TangentPlane plane = plane_of(normal, normal_bits, geometry.normals[v]);
        geometry.tangents[v] = decoded_tangent(in + v * stride, plane, f.bits);
      }
    } else if (f.coding == Coding::kSrgb) {
      const LinearColors linear(f.bits);
      fill(geometry.colors, [&](const int32_t* i, Vec4& c) {
        c = {linear.from_srgb(i[0]), linear.from_srgb(i[1]), linear.from_srgb(i[2]),
             linear.plain(i[3])};
      });
    } else if (f.attribute == kPositions) {
      floats(geometry.positions);
    } else if (f.attribute == kNormals) {
      floats(geometry.normals);
    } else if (f.attribute == kTangents) {
      floats(geometry.tangents);
    } else if (f.attribute == kUvs) {
      floats(geometry.uvs);
    } else {
      floats(geometry.colors);
    }
  }
  dequantize_extras(format, integers, geometry);
}

}  // namespace umbel::asset
