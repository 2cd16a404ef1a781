// Fuzzes the two-level grid, the octree and the bounding interval hierarchy: the bytes become a
// mesh (NaN, infinite and huge positions, indices out of range among them), settings and rays.
// Whatever is accepted must give hits of its triangles, and within the promised range those of a
// hierarchy.
#include <memory>
#include <vector>

#include "c_interface.hpp"
#include "structure_file.hpp"
#include "umbel/triangle_bvh.hpp"
#include "umbel/uniform.hpp"

namespace {

using umbel::Mesh;
using umbel::TriangleQueries;
using umbel::Vec3;
using umbel::fuzz::expect;
using umbel::fuzz::Input;

Vec3 point(Input& in) {
  const umbel_vec3 p = in.point();
  return {p.x, p.y, p.z};
}

Mesh read_mesh(Input& in) {
  Mesh mesh;
  for (uint32_t i = 1 + in.below(60); i-- > 0;) mesh.positions.push_back(point(in));
  const auto vertices = static_cast<uint32_t>(mesh.positions.size());
  for (uint32_t i = in.below(120); i-- > 0;)
    mesh.triangles.push_back({in.below(vertices), in.below(vertices), in.below(vertices)});
  if (in.likes(7) && !mesh.triangles.empty()) mesh.triangles[0][1] = in.bytes.integral<uint32_t>();
  return mesh;
}

umbel::BuildOptions some_threads(Input& in) {
  umbel::BuildOptions options;
  options.threads = 1 + in.below(2);
  return options;
}

umbel::bvh::InvalidTriangles invalid(Input& in) {
  return in.likes(2) ? umbel::bvh::InvalidTriangles::kDrop : umbel::bvh::InvalidTriangles::kRefuse;
}

std::unique_ptr<TriangleQueries> build_grid(Input& in, const Mesh& mesh,
                                            std::span<const uint32_t> masks) {
  umbel::uniform::GridConfig config;
  config.invalid = invalid(in);
  config.compact = in.below(2) != 0;
  if (in.likes(1)) {
    float* const fields[] = {&config.density, &config.leaf_density, &config.max_references,
                             &config.cost.traversal, &config.cost.intersection};
    *fields[in.below(std::size(fields))] = in.below(2) ? 16 * in.bytes.probability() : in.number();
  }
  return std::make_unique<umbel::uniform::TwoLevelGrid>(
      umbel::uniform::TwoLevelGrid::build(mesh.view(), config, masks, some_threads(in)));
}

std::unique_ptr<TriangleQueries> build_octree(Input& in, const Mesh& mesh,
                                              std::span<const uint32_t> masks) {
  umbel::uniform::OctreeConfig config;
  config.invalid = invalid(in);
  config.compact = in.below(2) != 0;
  if (in.likes(1)) {
    config.max_leaf_size = in.below(80);
    config.max_depth = in.below(24);
    if (in.below(2)) config.max_references = in.number();
  }
  return std::make_unique<umbel::uniform::Octree>(
      umbel::uniform::Octree::build(mesh.view(), config, masks, some_threads(in)));
}

std::unique_ptr<TriangleQueries> build_intervals(Input& in, const Mesh& mesh,
                                                 std::span<const uint32_t> masks) {
  umbel::uniform::IntervalConfig config;
  config.invalid = invalid(in);
  config.compact = in.below(2) != 0;
  if (in.likes(1)) config.max_leaf_size = in.below(80);
  return std::make_unique<umbel::uniform::IntervalHierarchy>(
      umbel::uniform::IntervalHierarchy::build(mesh.view(), config, masks, some_threads(in)));
}

std::unique_ptr<TriangleQueries> build_some(Input& in, const Mesh& mesh,
                                            std::span<const uint32_t> masks) {
  if (in.likes(6)) return build_grid(in, mesh, masks);
  return in.below(2) ? build_octree(in, mesh, masks) : build_intervals(in, mesh, masks);
}

/// Within the range that it is promised for, every structure gives the same hits.
void compare(Input& in, const Mesh& mesh, std::span<const uint32_t> masks,
             const TriangleQueries& tree) {
  const auto other = umbel::Bvh::build(mesh.view(), {}, masks);
  for (uint32_t i = 0; i < 16; ++i) {
    const umbel::Ray ray{point(in), 0, point(in)};
    const umbel::Hit one = tree.intersect(ray), two = other.intersect(ray);
    expect(one.primitive == two.primitive && one.t == two.t, "two structures give different hits");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Input in(data, size);
  const Mesh mesh = read_mesh(in);
  std::vector<uint32_t> masks;
  if (in.likes(3))
    for (size_t t = 0; t < mesh.triangles.size(); ++t) masks.push_back(in.below(255));
  if (in.likes(4) && in.likes(5)) masks.push_back(1);  // one too many
  try {
    const auto tree = build_some(in, mesh, masks);
    umbel::fuzz::ask_everything(*tree);
    for (uint32_t i = 0; i < 8; ++i) umbel::fuzz::ask_rays(*tree, point(in), point(in));
    if (in.is_tame()) compare(in, mesh, masks, *tree);
  } catch (const umbel::Error& error) {
    expect(error.what()[0] != '\0', "an error without a sentence");
  }
  return 0;
}
