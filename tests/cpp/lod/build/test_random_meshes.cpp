// Whatever the mesh and the settings: one root, proved, and the same bytes for any number of
// threads.
#include <gtest/gtest.h>

#include "lod/synthetic_dag.hpp"

namespace umbel::lod {
namespace {

using testing::Random;

Mesh random_shape(Random& random) {
  switch (random.below(8)) {
    case 0:
      return shapes::grid(1 + random.below(20), 1 + random.below(20));
    case 1:
      return shapes::sphere(random.below(4));
    case 2:
      return shapes::torus(3 + random.below(20), 3 + random.below(12));
    case 3:
      return shapes::moebius(3 + random.below(40), 1 + random.below(4));
    case 4:
      return shapes::fan(3 + random.below(300));
    case 5:
      return shapes::soup(1 + random.below(200), random.below(1000));
    case 6:
      return shapes::tetrahedra(1 + random.below(60));
    default:
      return shapes::blob(random.below(4), random.below(1000));
  }
}

// Every corner a vertex of its own.
void unweld(Mesh& mesh) {
  Mesh apart;
  for (Triangle& t : mesh.triangles)
    for (uint32_t& v : t) {
      apart.positions.push_back(mesh.positions[v]);
      v = static_cast<uint32_t>(apart.positions.size() - 1);
    }
  mesh.positions = std::move(apart.positions);
}

void damage(Mesh& mesh, Random& random) {
  const auto any_vertex = [&] {
    return random.below(static_cast<uint32_t>(mesh.positions.size()));
  };
  const auto any_triangle = [&]() -> Triangle& {
    return mesh.triangles[random.below(static_cast<uint32_t>(mesh.triangles.size()))];
  };
  for (uint32_t i = random.below(6); i > 0; --i) any_triangle()[random.below(3)] = any_vertex();
  for (uint32_t i = random.below(6); i > 0; --i) mesh.triangles.push_back(any_triangle());
  for (uint32_t i = random.below(6); i > 0; --i) std::swap(any_triangle()[0], any_triangle()[1]);
  for (uint32_t i = random.below(6); i > 0; --i)
    mesh.positions[any_vertex()] = mesh.positions[any_vertex()];
}

void give_attributes(Mesh& mesh, Random& random) {
  const auto fill = [&](auto& stream, const auto& value) {
    if (random.below(2)) return;
    for (size_t v = 0; v < mesh.positions.size(); ++v) stream.push_back(value(v));
  };
  const auto number = [&] { return static_cast<float>(random.uniform()); };
  const bool seams = random.below(2) == 1;
  fill(mesh.normals, [&](size_t) { return seams ? random.point() : Vec3{0, 0, 1}; });
  fill(mesh.tangents, [&](size_t) { return Vec4{1, 0, 0, random.below(2) ? 1.0f : -1.0f}; });
  fill(mesh.uvs,
       [&](size_t v) { return Vec2{mesh.positions[v].x, seams ? number() : mesh.positions[v].y}; });
  fill(mesh.colors, [&](size_t) { return Vec4{number(), number(), 0.5f, 1}; });
  if (random.below(3) == 0)
    for (size_t i = 0; i < mesh.triangles.size(); ++i)
      mesh.materials.push_back(static_cast<uint32_t>(4 * i / mesh.triangles.size()));
}

Mesh random_mesh(Random& random) {
  Mesh mesh = random_shape(random);
  if (random.below(4) == 0) unweld(mesh);
  if (random.below(2)) damage(mesh, random);
  if (random.below(2)) give_attributes(mesh, random);
  const float scale = random.below(8) ? 1.0f : std::ldexp(1.0f, int(random.below(80)) - 40);
  for (Vec3& p : mesh.positions) p = {p.x * scale, p.y * scale, p.z * scale};
  return mesh;
}

Config random_config(Random& random) {
  Config config;
  config.max_triangles = 4 + random.below(random.below(2) ? 30 : 250);
  config.max_vertices = 6 + random.below(250);
  config.min_group = 2 + random.below(10);
  config.max_group = config.min_group + random.below(10);
  config.ratio = static_cast<float>(random.between(0.25, 0.75));
  config.attributes = random.below(4) != 0;
  config.refit_attributes = random.below(4) != 0;
  config.measured_error = random.below(4) == 0;
  config.seams = static_cast<SeamRule>(random.below(3));
  config.creases = static_cast<SeamRule>(random.below(3));
  config.keep_area = random.below(4) != 0;
  config.mix_materials = random.below(4) == 0;
  return config;
}

bool same(const Mesh& a, const Mesh& b) {
  return a.positions == b.positions && a.normals == b.normals && a.tangents == b.tangents &&
         a.uvs == b.uvs && a.colors == b.colors;
}

class RandomMeshes : public ::testing::TestWithParam<uint32_t> {};

TEST_P(RandomMeshes, end_in_one_proved_root_and_threads_do_not_matter) {
  constexpr uint32_t kMeshes = 100;
  BuildOptions one, many;
  one.threads = 1;
  many.threads = 4;
  for (uint32_t seed = kMeshes * GetParam(); seed < kMeshes * (GetParam() + 1); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const Mesh mesh = random_mesh(random);
    const Config config = random_config(random);
    const Dag dag = build(mesh.view(), config, one);
    ASSERT_EQ(dag.report.root_groups, 1u)
        << mesh.triangles.size() << " triangles, at most " << config.max_triangles << " and "
        << config.max_vertices << " vertices a cluster, groups of " << config.min_group << " to "
        << config.max_group << ", " << config.ratio << " are kept, " << mesh.materials.size()
        << " materials, " << dag.report.root_triangles << " are left";
    ASSERT_EQ(dag.report.stuck_groups, 0u);
    const VerifyReport report =
        verify(dag.tables, testing::reader_of(dag), testing::verify_config_of(dag, mesh, 4));
    ASSERT_TRUE(report.ok) << (report.problems.empty() ? "" : report.problems[0]);
    const Dag again = build(mesh.view(), config, many);
    ASSERT_EQ(dag.tables.groups, again.tables.groups);
    ASSERT_EQ(dag.tables.clusters, again.tables.clusters);
    ASSERT_EQ(dag.tables.nodes, again.tables.nodes);
    ASSERT_EQ(dag.cluster_vertices, again.cluster_vertices);
    ASSERT_EQ(dag.cluster_triangles, again.cluster_triangles);
    ASSERT_TRUE(same(dag.vertices, again.vertices));
  }
}

INSTANTIATE_TEST_SUITE_P(Thousand, RandomMeshes, ::testing::Range(0u, 10u));

}  // namespace
}  // namespace umbel::lod
