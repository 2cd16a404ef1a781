#include <gtest/gtest.h>

#include <limits>

#include "umbel/mesh.hpp"

namespace umbel {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

std::string sentence_of(const MeshView& mesh, ErrorCode expected, uint32_t threads = 0) {
  try {
    BuildOptions options;
    options.threads = threads;
    validate(mesh, options);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), expected);
    return error.what();
  }
  ADD_FAILURE() << "not rejected";
  return {};
}

TEST(Validate, accepts_every_shape) {
  EXPECT_NO_THROW(validate(Mesh{}.view()));
  EXPECT_NO_THROW(validate(shapes::blob(3, 1).view()));
  EXPECT_NO_THROW(validate(shapes::fan(100).view()));
}

TEST(Validate, accepts_degenerate_and_duplicate_triangles) {
  Mesh mesh = shapes::grid(1, 1);
  mesh.triangles = {{0, 0, 0}, {0, 1, 2}, {0, 1, 2}, {0, 1, 1}};
  EXPECT_NO_THROW(validate(mesh.view()));
}

TEST(Validate, names_the_index_out_of_range) {
  Mesh mesh = shapes::grid(2, 2);
  mesh.triangles[5][2] = 9;
  EXPECT_EQ(sentence_of(mesh.view(), ErrorCode::kInvalidMesh),
            "triangle 5, corner 2: vertex index 9 is out of range, the mesh has 9 vertices");
}

TEST(Validate, names_the_value_that_is_not_finite) {
  Mesh mesh = shapes::grid(2, 2);
  mesh.positions[mesh.triangles[3][1]].y = kNan;
  const std::string sentence = sentence_of(mesh.view(), ErrorCode::kInvalidMesh);
  EXPECT_NE(sentence.find("position"), std::string::npos) << sentence;
  EXPECT_NE(sentence.find("nan"), std::string::npos) << sentence;
}

TEST(Validate, judges_every_attribute) {
  const Mesh clean = shapes::grid(2, 2);
  for (int stream = 0; stream < 4; ++stream) {
    Mesh mesh = clean;
    mesh.normals.resize(9), mesh.tangents.resize(9), mesh.uvs.resize(9), mesh.colors.resize(9);
    EXPECT_NO_THROW(validate(mesh.view()));
    if (stream == 0) mesh.normals[4].z = kInfinity;
    if (stream == 1) mesh.tangents[4].w = kNan;
    if (stream == 2) mesh.uvs[4].x = -kInfinity;
    if (stream == 3) mesh.colors[4].w = kNan;
    const char* names[] = {"normal", "tangent", "texture coordinate", "colour"};
    const std::string sentence = sentence_of(mesh.view(), ErrorCode::kInvalidMesh);
    EXPECT_NE(sentence.find(std::string(names[stream]) + " of vertex 4"), std::string::npos)
        << sentence;
  }
}

TEST(Validate, ignores_vertices_that_no_triangle_uses) {
  Mesh mesh = shapes::grid(2, 2);
  mesh.positions.push_back({kNan, kInfinity, 0});
  EXPECT_NO_THROW(validate(mesh.view()));
  mesh.positions.resize(1000, {kNan, 0, 0});  // more unused than used
  EXPECT_NO_THROW(validate(mesh.view()));
  mesh.triangles.clear();
  EXPECT_NO_THROW(validate(mesh.view()));
}

TEST(Validate, names_the_first_offender_for_any_thread_count) {
  Mesh mesh = shapes::blob(6, 3);
  for (size_t i : {81000u, 40123u, 77777u}) mesh.triangles[i][1] = kNone;
  mesh.triangles[60000][0] = 1u << 30;
  const std::string expected = "triangle 40123, corner 1: vertex index 4294967295 is out of range";
  for (uint32_t threads : {1u, 2u, 4u})
    for (int run = 0; run < 5; ++run)
      EXPECT_EQ(
          sentence_of(mesh.view(), ErrorCode::kInvalidMesh, threads).substr(0, expected.size()),
          expected);
}

TEST(Validate, rejects_streams_of_the_wrong_length) {
  Mesh mesh = shapes::grid(2, 2);
  mesh.uvs.resize(8);
  EXPECT_EQ(sentence_of(mesh.view(), ErrorCode::kInvalidArgument),
            "uvs has 8 elements, but the mesh has 9 vertices");
  mesh.uvs.clear();
  mesh.materials.resize(9);
  EXPECT_EQ(sentence_of(mesh.view(), ErrorCode::kInvalidArgument),
            "materials has 9 elements, but the mesh has 8 triangles");
}

TEST(DropInvalid, removes_exactly_what_validate_rejects) {
  Mesh mesh = shapes::blob(4, 3);
  mesh.materials.resize(mesh.triangles.size());
  for (size_t i = 0; i < mesh.materials.size(); ++i) mesh.materials[i] = static_cast<uint32_t>(i);
  mesh.triangles[7][1] = kNone;
  mesh.positions[20].x = kNan;
  const DropResult result = drop_invalid(mesh.view());
  EXPECT_NO_THROW(validate(result.mesh.view()));
  EXPECT_EQ(result.mesh.positions.size(), mesh.positions.size());
  EXPECT_EQ(result.mesh.triangles.size() + result.dropped, mesh.triangles.size());
  EXPECT_GT(result.dropped, 1u);
  size_t next = 0;
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    if (i == 7 || t[0] == 20 || t[1] == 20 || t[2] == 20) continue;
    ASSERT_LT(next, result.mesh.triangles.size());
    EXPECT_EQ(result.mesh.triangles[next], t);
    EXPECT_EQ(result.mesh.materials[next], i);
    ++next;
  }
  EXPECT_EQ(next, result.mesh.triangles.size());
}

TEST(DropInvalid, leaves_a_valid_mesh_as_it_is) {
  const Mesh mesh = shapes::torus(8, 9);
  const DropResult result = drop_invalid(mesh.view());
  EXPECT_EQ(result.dropped, 0u);
  EXPECT_EQ(result.mesh.triangles, mesh.triangles);
  EXPECT_EQ(result.mesh.positions, mesh.positions);
}

}  // namespace
}  // namespace umbel
