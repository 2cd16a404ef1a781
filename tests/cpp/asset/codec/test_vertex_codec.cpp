#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include "asset/codec/remainder_code.hpp"
#include "asset/codec/vertex_codec.hpp"
#include "asset/file/format.hpp"
#include "asset/same_geometry.hpp"
#include "asset/scratch.hpp"
#include "asset/synthetic_dag.hpp"
#include "umbel/asset.hpp"

namespace umbel::asset {
namespace {

using umbel::testing::Scratch;
using umbel::testing::synthetic_dag;

VertexFormat floats_and_grid() {
  return make_format({{kPositions, Coding::kGrid, 0, 0.25f}, {kNormals, Coding::kFloats, 0, 0}});
}
VertexFormat octahedral_and_uvs() {
  return make_format({{kPositions, Coding::kGrid, 0, 0.25f},
                      {kNormals, Coding::kOctahedral, 8, 0},
                      {kUvs, Coding::kGrid, 0, 0.25f}});
}

/// A cluster's integers, coded and decoded, must be the same; `equal` and `twin` name vertices of a
/// group whose first half are the same vertices. The result is the bytes that they take.
size_t expect_same(const VertexFormat& format, std::span<const int32_t> integers,
                   const ClusterTriangles& cluster, const KnownVertices& known,
                   std::span<const ComponentRange> ranges) {
  const uint32_t width = components(format), stride = row_stride(format);
  const auto count = static_cast<uint32_t>(cluster.predictors.size());
  std::vector<int32_t> group(size_t{2} * count * stride);
  std::vector<int32_t> given(integers.begin(), integers.end());
  given.insert(given.end(), integers.begin(), integers.end());
  for (uint32_t v = 0; v < count; ++v)
    std::copy_n(&integers[size_t{v} * width], width, &group[size_t{v} * stride]);
  std::vector<std::byte> bytes;
  BitWriter out(bytes);
  encode_vertices(format, given, count, cluster, known, ranges, out);
  out.finish();
  BitReader in(bytes);
  KnownVertices to_decode = known;
  if (std::ranges::all_of(known.twin, [](uint32_t twin) { return twin == kNone; }))
    to_decode.twin = {};
  decode_vertices(kVersionMajor, format, cluster, to_decode, ranges, in, group, count);
  EXPECT_NO_THROW(in.finish());
  for (uint32_t v = 0; v < count; ++v)
    EXPECT_TRUE(std::equal(&integers[size_t{v} * width], &integers[size_t{v} * width] + width,
                           &group[size_t{count + v} * stride]))
        << v << " of " << count;
  return bytes.size();
}

/// Codes `count` vertices of random integers of `bits` bits, some of which an earlier cluster has,
/// and with twins some whose position an earlier vertex has, and then often its other values.
void expect_same_integers(const VertexFormat& format, uint32_t count, uint32_t bits,
                          bool with_twins, std::mt19937& random) {
  const uint32_t width = components(format);
  std::vector<int32_t> integers(count * width);
  for (int32_t& i : integers) i = bits == 0 ? 7 : static_cast<int32_t>(random()) >> (32 - bits);
  std::vector<Predictors> predictors(count);
  for (uint32_t v = 1; v < count; ++v)
    predictors[v] =
        predictors_of(uint32_t(random() % v), uint32_t(random() % v), uint32_t(random() % v));
  // Some regions begin with a triangle.
  for (uint32_t v = 2; v < count; ++v)
    if (random() % 5 == 0)
      predictors[v].word = predictors_of(v - 1, v - 1, v - 1).word | Predictors::kCloses;
  std::vector<uint8_t> triangles(size_t{3} * count);
  for (uint8_t& corner : triangles) corner = static_cast<uint8_t>(random() % count);
  const auto lowest = static_cast<int32_t>(bits == 0 ? 7 : ~0u << (bits - 1));
  const std::vector<ComponentRange> ranges(width, {lowest, bits});
  std::vector<uint32_t> equal(count, kNone), twin(count, kNone);
  for (uint32_t v = 0; v < count; ++v) {
    if (random() % 4 == 0) {
      equal[v] = v;
    } else if (with_twins && v > 0 && random() % 2 == 0) {
      twin[v] = static_cast<uint32_t>(random() % v + (random() % 2) * count);
      std::copy_n(&integers[size_t{twin[v] % count} * width], random() % 2 ? width : 3,
                  &integers[size_t{v} * width]);
    }
  }
  expect_same(format, integers, {predictors, triangles}, {equal, twin}, ranges);
}

TEST(VertexCodec, gives_back_any_integers) {
  std::mt19937 random(3);
  const VertexFormat alone = make_format({{kPositions, Coding::kGrid, 0, 0.25f}});
  for (const VertexFormat& format : {floats_and_grid(), alone, octahedral_and_uvs()})
    for (uint32_t bits = 0; bits <= 32; ++bits)
      for (uint32_t count = 1; count <= 256; count += 51)
        for (const bool with_twins : {false, true})
          expect_same_integers(format, count, bits, with_twins, random);
}

/// Most of a sphere of 162 vertices, and their normals.
struct Ball {
  std::vector<int32_t> integers;
  std::vector<uint8_t> triangles;
  std::vector<Predictors> predictors;
};
Ball ball(const VertexFormat& format) {
  Ball made;
  Mesh mesh = shapes::sphere(2);
  mesh.normals = mesh.positions;
  std::vector<uint8_t> triangles;
  for (const Triangle& t : std::span(mesh.triangles).first(kMaxLocal))
    for (const uint32_t v : t) triangles.push_back(static_cast<uint8_t>(v));
  std::vector<std::byte> bytes;
  BitWriter out(bytes);
  const auto count = static_cast<uint32_t>(mesh.positions.size());
  const Traversal traversal = encode_triangles(triangles, count, {}, out);
  const std::vector<uint32_t> order(traversal.vertices.begin(), traversal.vertices.end());
  made.integers.resize(size_t{count} * components(format));
  quantize(format, mesh, order, made.integers);
  made.triangles = traversal.triangles;
  made.predictors = traversal.predictors;
  return made;
}

TEST(VertexCodec, predicts_the_normals_of_smooth_surfaces_by_their_triangles) {
  const AttributeFormat positions{kPositions, Coding::kGrid, 0, 0x1p-15f};
  const VertexFormat format = make_format({positions, {kNormals, Coding::kOctahedral, 8, 0}});
  const Ball made = ball(format);
  const std::vector<uint32_t> none(made.predictors.size(), kNone);
  const std::vector<ComponentRange> ranges(5, {-(1 << 17), 18});
  const auto bytes = [&](std::span<const uint8_t> triangles) {
    return expect_same(format, made.integers, {made.predictors, triangles}, {none, none}, ranges);
  };
  // Without triangles, each normal is predicted by two others. A bit for each component less.
  EXPECT_LT(8 * bytes(made.triangles) + 2 * none.size(), 8 * bytes({}));
}

// The triangles of a ball pressed flat are of many shapes, so the parallelogram rule is far off.
TEST(VertexCodec, predicts_texture_coordinates_by_positions) {
  const AttributeFormat positions{kPositions, Coding::kGrid, 0, 0x1p-15f};
  const AttributeFormat uvs{kUvs, Coding::kGrid, 0, 0x1p-12f};
  const VertexFormat format = make_format({positions, uvs});
  const Ball made = ball(make_format({positions}));
  const auto count = static_cast<uint32_t>(made.predictors.size());
  std::vector<int32_t> integers;
  for (uint32_t v = 0; v < count; ++v) {
    const int32_t* const p = &made.integers[3 * v];
    integers.insert(integers.end(), {p[0], p[1], 0, p[0] + 2 * p[1], 3 * p[1] - p[0]});
  }
  const std::vector<uint32_t> none(count, kNone);
  const auto bytes = [&](int32_t lowest, uint32_t bits) {
    const std::vector<ComponentRange> ranges(5, {lowest, bits});
    return expect_same(format, integers, {made.predictors, made.triangles}, {none, none}, ranges);
  };
  // Not where a group has large ones.
  EXPECT_LT(10 * bytes(-(1 << 17), 18), 8 * bytes(-(1 << 27), 28));
}

TEST(VertexCodec, stores_values_of_twins_once) {
  const VertexFormat format = octahedral_and_uvs();
  Ball made = ball(make_format({format.attributes[0], format.attributes[1]}));
  // Random texture coordinates; every second vertex has those of the one before.
  std::mt19937 random(5);
  const auto count = static_cast<uint32_t>(made.predictors.size());
  std::vector<int32_t> integers;
  std::vector<uint32_t> none(count, kNone), twin(count, kNone);
  for (uint32_t v = 0; v < count; ++v) {
    if (v % 2 == 1) {
      twin[v] = count + v - 1;
      integers.insert(integers.end(), integers.end() - 7, integers.end());
      continue;
    }
    integers.insert(integers.end(), &made.integers[5 * v], &made.integers[5 * v] + 5);
    for (int c = 0; c < 2; ++c) integers.push_back(static_cast<int32_t>(random() % 65536));
  }
  const std::vector<ComponentRange> ranges(7, {-(1 << 17), 18});
  const size_t all =
      expect_same(format, integers, {made.predictors, made.triangles}, {none, none}, ranges);
  const size_t once =
      expect_same(format, integers, {made.predictors, made.triangles}, {none, twin}, ranges);
  EXPECT_LT(10 * once, 6 * all);
}

TEST(VertexCodec, stores_boxes_along_the_axes_in_fewer_bits_than_turned_ones) {
  const VertexFormat format = make_format({{kPositions, Coding::kGrid, 0, 1.0f}});
  std::vector<int32_t> along, turned;
  std::vector<Predictors> predictors;
  std::mt19937 random(7);
  for (uint8_t box = 0; box < 16; ++box) {
    const std::array<int32_t, 3> at{int32_t(random() % 999), int32_t(random() % 999),
                                    int32_t(random() % 999)};
    for (uint32_t corner = 0; corner < 8; ++corner) {
      const int32_t x = at[0] + ((corner & 1) != 0 ? 300 : 0);
      const int32_t y = at[1] + ((corner & 2) != 0 ? 410 : 0);
      const int32_t z = at[2] + ((corner & 4) != 0 ? 520 : 0);
      for (const int32_t value : {x, y, z}) along.push_back(value);
      for (const int32_t value : {x + y, y + z, z - x}) turned.push_back(value);
      const uint32_t before = std::max(8u * box + corner, 1u) - 1;
      predictors.push_back(predictors_of(before, before, before));
    }
  }
  const std::vector<uint32_t> none(predictors.size(), kNone);
  const std::vector<ComponentRange> ranges(3, {-2048, 13});
  const auto bytes = [&](std::span<const int32_t> integers) {
    return expect_same(format, integers, {predictors, {}}, {none, none}, ranges);
  };
  EXPECT_LT(4 * bytes(along), 3 * bytes(turned));
}

TEST(VertexCodec, refuses_codes_that_cannot_be) {
  const VertexFormat format = make_format({{kPositions, Coding::kGrid, 0, 1.0f}});
  const std::vector<ComponentRange> ranges(3, {0, 8});
  const std::vector<Predictors> predictors(1, predictors_of(0, 0, 0));
  const std::vector<uint32_t> none(1, kNone);
  for (const uint32_t parameter : {15u, 16u, 30u, 31u}) {
    std::vector<std::byte> bytes;
    BitWriter out(bytes);
    out.write(0, 2);  // damping
    out.write(0, 1);  // starts
    out.write(1, 1);  // kinds
    for (int c = 0; c < 3; ++c) {
      out.write(parameter, kParameterBits);
      if (parameter != kAllZero) out.write(RemainderCode::kExponential, kKindBits);
    }
    for (int c = 0; c < 3; ++c) out.write(0, 8);
    out.finish();
    BitReader in(bytes);
    std::vector<int32_t> group(4);
    const auto decode = [&] {
      decode_vertices(kVersionMajor, format, {predictors, {}}, {none, {}}, ranges, in, group, 0);
    };
    if (parameter == 16 || parameter == 30)
      EXPECT_THROW(decode(), Error) << parameter;
    else
      EXPECT_NO_THROW(decode()) << parameter;
  }
}

TEST(VertexFormat, refuses_what_cannot_be) {
  const AttributeFormat positions{kPositions, Coding::kFloats, 0, 0};
  EXPECT_NO_THROW(make_format({positions}));
  const AttributeFormat octahedral{kNormals, Coding::kOctahedral, 10, 0};
  const AttributeFormat angles{kTangents, Coding::kAngle, 10, 0};
  EXPECT_NO_THROW(make_format({positions, octahedral, angles}));
  const std::vector<std::vector<AttributeFormat>> impossible{
      {},
      {octahedral},
      {positions, positions},
      {positions, angles},
      {positions, angles, octahedral},
      {positions, octahedral, octahedral},
      {positions, {kNormals, Coding::kOctahedral, 1, 0}},
      {positions, {kNormals, Coding::kOctahedral, 17, 0}},
      {positions, {kNormals, Coding::kGrid, 0, 1}},
      {positions, {kUvs, Coding::kGrid, 0, 0}},
      {positions, {kUvs, Coding::kGrid, 0, 0.3f}},
      {positions, {kUvs, Coding::kGrid, 0, -0.5f}},
      {positions, {kUvs, Coding::kGrid, 0, std::numeric_limits<float>::infinity()}},
      {positions, {kColors, Coding::kAngle, 8, 0}},
      {positions, {kColors, static_cast<Coding>(9), 8, 0}},
      {positions, {3, Coding::kFloats, 0, 0}},
      {positions, {kJoints, Coding::kSrgb, 8, 0}},
      {positions, {128, Coding::kFloats, 0, 0}}};
  for (size_t i = 0; i < impossible.size(); ++i)
    EXPECT_THROW(make_format(impossible[i]), Error) << i;
}

/// A sphere with smooth normals, tangents, texture coordinates and colours, on a grid.
Mesh decorated_sphere(float step) {
  Mesh mesh = shapes::sphere(3);
  for (const Vec3& n : mesh.positions) {
    mesh.normals.push_back(n);
    const float r = std::hypot(n.x, n.y);
    mesh.tangents.push_back(r > 0 ? Vec4{-n.y / r, n.x / r, 0, n.x > 0 ? 1.0f : -1.0f}
                                  : Vec4{1, 0, 0, 1});
    mesh.uvs.push_back({3 * n.x, n.z});
    mesh.colors.push_back({n.x * n.x, n.y * n.y, 0.5f, 0.25f});
  }
  snap_to_grid(mesh.positions, step);
  return mesh;
}

TEST(StoredAttributes, are_as_near_as_their_bits_say) {
  constexpr float kStep = 0x1p-12f;
  const Mesh mesh = decorated_sphere(kStep);
  lod::Dag dag = synthetic_dag(mesh);
  dag.config.position_step = kStep;
  const Scratch scratch;
  write_asset(scratch / "a.umbel", dag);
  const Asset asset(scratch / "a.umbel");
  EXPECT_EQ(asset.info().position_step, kStep);
  EXPECT_EQ(asset.info().normal_bits, 10u);
  EXPECT_EQ(asset.info().tangent_bits, 10u);
  EXPECT_EQ(asset.info().color_bits, 8u);
  EXPECT_EQ(asset.info().uv_step, 0x1p-14f);
  size_t seen = 0;
  for (uint32_t c = 0; c < dag.tables.clusters.size(); ++c) {
    const lod::ClusterGeometry g = asset.geometry(c);
    for (size_t v = 0; v < g.positions.size(); ++v, ++seen) {
      const auto at = std::find(mesh.positions.begin(), mesh.positions.end(), g.positions[v]);
      ASSERT_NE(at, mesh.positions.end());
      const auto i = static_cast<size_t>(at - mesh.positions.begin());
      EXPECT_GT(dot(g.normals[v], mesh.normals[i]), std::cos(0.004f));
      EXPECT_NEAR(dot(g.normals[v], g.normals[v]), 1, 1e-5);
      const Vec4 t = g.tangents[v], given = mesh.tangents[i];
      // A turn in 1024 steps, half a step off, and the normal's own error.
      EXPECT_GT(t.x * given.x + t.y * given.y + t.z * given.z, std::cos(0.008f));
      EXPECT_EQ(t.w, given.w);
      EXPECT_NEAR(g.uvs[v].x, mesh.uvs[i].x, 0x1p-15);
      EXPECT_NEAR(g.uvs[v].y, mesh.uvs[i].y, 0x1p-15);
      EXPECT_NEAR(g.colors[v].x, mesh.colors[i].x, 0.006);
      EXPECT_NEAR(g.colors[v].w, mesh.colors[i].w, 0.002);
    }
  }
  EXPECT_GE(seen, 2 * mesh.positions.size());
}

TEST(StoredAttributes, on_a_grid_are_several_times_smaller) {
  constexpr float kStep = 0x1p-14f;
  lod::Dag dag = synthetic_dag(decorated_sphere(kStep), {128, 26});
  const Scratch scratch;
  const uint64_t exact = write_asset(scratch / "a.umbel", dag, "{}", {}, AssetConfig::exact());
  dag.config.position_step = kStep;
  EXPECT_LT(2.5 * double(write_asset(scratch / "b.umbel", dag)), double(exact));
}

TEST(StoredAttributes, that_do_not_fit_stay_floats) {
  Mesh mesh = decorated_sphere(0x1p-12f);
  mesh.colors[5].y = 1.5f;
  mesh.uvs[7].x = 1e9f;
  lod::Dag dag = synthetic_dag(mesh);
  const Scratch scratch;
  write_asset(scratch / "a.umbel", dag);
  const AssetInfo info = Asset(scratch / "a.umbel").info();
  EXPECT_EQ(info.position_step, 0);
  EXPECT_EQ(info.color_bits, 0u);
  EXPECT_EQ(info.uv_step, 64);  // 2^24 steps reach 1e9
}

TEST(StoredAttributes, have_bits_in_range) {
  const lod::Dag dag = synthetic_dag(decorated_sphere(0x1p-12f));
  const Scratch scratch;
  for (const AssetConfig& config :
       {AssetConfig{1, 10, 8, 0}, AssetConfig{10, 17, 8, 0}, AssetConfig{10, 10, 99, 0},
        AssetConfig{10, 10, 8, 0.3f}, AssetConfig{10, 10, 8, -1}})
    EXPECT_THROW(write_asset(scratch / "a.umbel", dag, "{}", {}, config), Error);
  EXPECT_EQ(scratch.files(), 0u);
}

}  // namespace
}  // namespace umbel::asset
