// What rays and selections do on a device, counted on the processor, where the same code runs:
// nodes and triangles that a ray visits, and so the bytes that it reads; nodes, groups and clusters
// that a selection looks at. Prints Markdown; nothing here is a time.
//
//   device_counts MESH...
#include <cmath>
#include <cstdio>

#include "../tests/on_processor/run.hpp"
// What is above comes first.
#include "crowd.hpp"
#include "cuda/bvh_functions.hpp"
#include "cuda/trace_walks.hpp"
#include "lod/instances.hpp"
#include "mesh_reader.hpp"
#include "picture_rays.hpp"

namespace {

using namespace umbel;

struct CountTriangles {
  uint64_t triangles = 0;
  void count_triangle() { ++triangles; }
};

struct Tree {
  CpuBuffer<bvh::CompactNode> nodes;
  CpuBuffer<bvh::CompactTriangle> triangles;
  bvh::CompactInfo info{};

  explicit Tree(const Mesh& mesh) {
    const auto n = static_cast<uint32_t>(mesh.triangles.size());
    const cuda::DeviceBvhConfig config;
    const uint32_t references = cuda::device_references(n, config);
    nodes = CpuBuffer<bvh::CompactNode>(bvh::compact_node_capacity(references));
    triangles = CpuBuffer<bvh::CompactTriangle>(references);
    const cuda::DeviceMesh input{mesh.positions.data(), sizeof(Vec3), mesh.triangles[0].data(),
                                 nullptr, n};
    size_t bytes = 1;
    cuda::build_bvh(&bytes, bytes, input, config, {nodes.data(), triangles.data(), &info});
  }
  bvh::CompactTree view() const { return {nodes.data(), triangles.data(), &info}; }
};

template <bool any>
void count_rays(const char* what, const bvh::CompactTree& tree, const std::vector<Ray>& rays) {
  double nodes = 0, triangles = 0;
  for (const Ray& ray : rays) {
    bvh::RayVisitor<any, CountTriangles> visitor;
    bvh::CompactWalk walk;
    if (!visitor.begin(tree, ray, false)) continue;
    walk.begin(tree, visitor);
    ++nodes;
    while (walk.step(tree, visitor)) ++nodes;
    triangles += static_cast<double>(visitor.triangles);
  }
  const auto n = static_cast<double>(rays.size());
  const double bytes = (80 * nodes + 48 * triangles) / n + (any ? 33 : 48);
  std::printf("| %s | %zu | %.1f | %.1f | %.0f |\n", what, rays.size(), nodes / n, triangles / n,
              bytes);
}

void count_mesh(const std::string& path) {
  constexpr uint32_t kSize = 1024;
  const Mesh mesh = bench::read_mesh(path);
  const trace::Scene scene = trace::Scene::build(mesh.view());
  const auto primary = bench::camera_rays(trace::auto_camera(scene, kSize, kSize), kSize, 1);
  const auto bounce = bench::bounces(mesh, primary, scene.structure());
  const Tree tree(mesh);
  std::printf(
      "\n## %s: %zu triangles, a tree of %.1f MB\n\n| rays | of | nodes a ray | triangles a ray | "
      "bytes a ray |\n|---|--:|--:|--:|--:|\n",
      bench::file_name(path).c_str(), mesh.triangles.size(),
      1e-6 * (80.0 * tree.info.nodes + 48.0 * tree.info.triangles));
  count_rays<false>("primary, nearest", tree.view(), primary);
  count_rays<false>("bounce, nearest", tree.view(), bounce);
  count_rays<true>("bounce, any", tree.view(), bounce);
}

void count_selection() {
  const bench::Crowd crowd;
  const lod::Tables& tables = crowd.dag.tables;
  const lod::InstanceCuts cuts =
      lod::select_instances(tables, crowd.view, {crowd.planes, {}}, crowd.instances);
  double visited = 0, opened = 0, groups = 0, clusters = 0;
  for (const lod::Transform& transform : crowd.instances) {
    const lod::View view = to_object(crowd.view, transform);
    const auto planes = lod::to_object(crowd.planes, transform);
    std::vector<uint32_t> stack{0};
    while (!stack.empty()) {
      const lod::Node& node = tables.nodes[stack.back()];
      stack.pop_back();
      ++visited;
      if (node.group != kNone) {
        const lod::Group& group = tables.groups[node.group];
        if (!lod::needs_refining(group, view) || lod::is_outside(group.sphere, planes)) continue;
        ++groups;
        clusters += group.clusters.count;
      } else if (lod::opens(node, view, planes)) {
        ++opened;
        for (uint32_t k = 0; k < node.children.count; ++k)
          stack.push_back(node.children.offset + k);
      }
    }
  }
  std::printf(
      "\n## Selection: %zu instances of %zu groups, %zu clusters, %zu nodes\n\n| nodes visited | "
      "opened | groups shown | their clusters | clusters of the cuts |\n|--:|--:|--:|--:|--:|\n| "
      "%.0f | %.0f | %.0f | %.0f | %zu |\n",
      crowd.instances.size(), tables.groups.size(), tables.clusters.size(), tables.nodes.size(),
      visited, opened, groups, clusters, cuts.clusters.size());
  const double bits = std::ceil(static_cast<double>(tables.groups.size()) / 32) *
                      static_cast<double>(crowd.instances.size());
  const double traffic = bench::selection_bytes(crowd, groups, cuts.clusters.size());
  std::printf("\nWords of bits: %.0f. Bytes through memory at least: %.1f MB.\n", bits,
              1e-6 * traffic);
}

}  // namespace

int main(int argc, char** argv) try {
  std::printf("# What devices do\n");
  for (int i = 1; i < argc; ++i) count_mesh(argv[i]);
  count_selection();
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "device_counts: %s\n", error.what());
  return 1;
}
