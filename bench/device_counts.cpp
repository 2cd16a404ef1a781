// What builds, rays and selections do on a device, counted on the processor, where the same code
// runs: kernels that a build starts, and how often it waits; nodes and triangles that a ray visits,
// and so the bytes that it reads; nodes, groups and clusters that a selection evaluates. Prints
// Markdown; nothing here is a time.
//
//   device_counts MESH...
#include <cmath>
#include <cstdio>

#include "bvh/compressed/trace_batches.hpp"
#include "cluster/frame/build_frame.hpp"
#include "crowd.hpp"
#include "lod/select/instances.hpp"
#include "mesh_reader.hpp"
#include "picture_rays.hpp"
// The processor's form of this, as in tests/on_processor.
#include "cuda/bvh.cu"

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

/// Counts what cuda_exec.cuh would start: what CUB does counts as the kernels of its usual ways.
class CountingExec : public CpuExec {
 public:
  uint32_t kernels = 0, waits = 0;

  template <typename T>
  T read(const T* value) {
    ++waits;
    return CpuExec::read(value);
  }
  template <typename Body>
  void for_each(size_t n, const Body& body, size_t grain = 1024) {
    kernels += n > 0 ? 1 : 0;
    CpuExec::for_each(n, body, grain);
  }
  template <typename Body>
  void for_each_of(const uint32_t* count, uint32_t most, uint32_t each, const Body& body) {
    ++kernels;
    CpuExec::for_each_of(count, most, each, body);
  }
  template <typename Body>
  void for_each_layer(const uint32_t* counts, uint32_t layers, uint32_t most, uint32_t each,
                      const Body& body) {
    ++kernels;
    CpuExec::for_each_layer(counts, layers, most, each, body);
  }
  template <typename Body>
  void for_each_team(size_t n, const Body& body) {
    kernels += n > 0 ? 1 : 0;
    CpuExec::for_each_team(n, body);
  }
  template <typename Body>
  void for_each_team_of(const uint32_t* count, uint32_t most, const Body& body) {
    ++kernels;
    CpuExec::for_each_team_of(count, most, body);
  }
  template <typename T, typename Map, typename Op>
  void reduce(size_t n, T init, const Map& map, const Op& op, T* result) {
    kernels += 2;
    CpuExec::reduce(n, init, map, op, result);
  }
  template <typename T, typename In>
  void exclusive_scan(size_t n, const In& in, T* out) {
    kernels += 2;
    CpuExec::exclusive_scan(n, in, out);
  }
  template <typename Keep>
  void select(size_t n, const Keep& keep, uint32_t* out, uint32_t* count) {
    kernels += 2;
    CpuExec::select(n, keep, out, count);
  }
  template <typename Key>
  void run_length(size_t n, const Key* keys, uint32_t* starts, uint32_t* runs) {
    kernels += 3;
    CpuExec::run_length(n, keys, starts, runs);
  }
  template <typename Key>
  void radix_sort_pairs(size_t n, Key* keys, uint32_t* values, uint32_t first_bit,
                        uint32_t last_bit) {
    const uint32_t passes = (last_bit - first_bit + 7) / 8;
    kernels += 2 + passes + (passes % 2 == 0 ? 0 : 2);
    CpuExec::radix_sort_pairs(n, keys, values, first_bit, last_bit);
  }
};

void count_builds(const Mesh& mesh) {
  const auto n = static_cast<uint32_t>(mesh.triangles.size());
  const cuda::MeshCorners corners{
      {reinterpret_cast<const char*>(mesh.positions.data()), sizeof(Vec3)}, mesh.triangles.data()};
  const CpuBuffer<bvh::CompactNode> nodes(bvh::compact_node_capacity(n));
  const CpuBuffer<bvh::CompactTriangle> triangles(n);
  bvh::CompactInfo info{};
  std::printf("\n| builder | kernels | waits |\n|---|--:|--:|\n");
  for (const char* builder : {"lbvh", "hlbvh", "atrbvh", "ploc", "hploc", "kmeans-q1", "kmeans-q2",
                              "kmeans-q5", "sweep"}) {
    CountingExec exec;
    cuda::build_compact(exec, corners, nullptr, n, cuda::device_builder_preset(builder),
                        {nodes.data(), triangles.data(), &info}, cuda::NoStages{});
    std::printf("| %s | %u | %u |\n", builder, exec.kernels, exec.waits);
  }
}

/// What a frame of examples/cuda starts, and the bytes that each step moves at least: all that it
/// reads and writes, once a kernel, as if every vertex were read once and nothing stayed in a
/// cache.
void count_frame(const Mesh& mesh, double bytes_a_ray) {
  constexpr double kRays = 1920 * 1080;
  const auto n = static_cast<uint32_t>(mesh.triangles.size());
  const CpuBuffer<uint32_t> items(n), offsets(size_t{n} + 1);
  const CpuBuffer<Triangle> triangles(n);
  const CpuBuffer<Aabb> boxes(n);
  uint32_t count = 0;
  const auto* first = reinterpret_cast<const char*>(mesh.positions.data());
  const cluster::FrameMesh input{{first, sizeof(Vec3)}, mesh.triangles.data(), nullptr, n};
  const double each = n, vertices = static_cast<double>(mesh.positions.size());
  const double gathered = 12 * each + 12 * vertices;  // indices and positions
  const auto sorted = [&](double key, double bits) {
    const double passes = std::ceil(bits / 8), pair = key + 4;
    return each * (key + 2 * pair * (passes + (int(passes) % 2 ? 1 : 0)));
  };
  std::printf("\n| step of a frame | kernels | waits | MB |\n|---|--:|--:|--:|\n");
  const auto row = [](const char* step, const CountingExec& exec, double bytes) {
    std::printf("| %s | %u | %u | %.0f |\n", step, exec.kernels, exec.waits, 1e-6 * bytes);
  };
  CountingExec deform;
  deform.kernels = 2;
  row("deform", deform, 24 * vertices);
  for (const FrameMethod method : {FrameMethod::kMorton, FrameMethod::kHybrid}) {
    FrameClusterConfig config;
    config.method = method;
    CountingExec exec;
    cluster::build_frame(exec, input, cluster::CheckedFrameConfig::of(config, n),
                         {items.data(), triangles.data(), offsets.data(), boxes.data(), &count});
    const bool is_hybrid = method == FrameMethod::kHybrid;
    const double order = 2 * gathered + 8 * each + sorted(4, 30);
    const double bisect = is_hybrid ? 2 * gathered + 10 * each : 0;
    const double write = gathered + 20 * each + 28.0 * count;
    row(is_hybrid ? "clusters, hybrid" : "clusters, Morton", exec, order + bisect + write);
  }
  const CpuBuffer<bvh::CompactNode> nodes(bvh::compact_node_capacity(n));
  const CpuBuffer<bvh::CompactTriangle> leaves(n);
  bvh::CompactInfo info{};
  CountingExec exec;
  const uint32_t most = max_frame_clusters(n, {});
  cuda::build_compact(exec, {{first, sizeof(Vec3)}, triangles.data()}, items.data(), n,
                      cuda::device_builder_preset("lbvh"), {nodes.data(), leaves.data(), &info},
                      cuda::NoStages{}, {offsets.data(), boxes.data(), &count, most});
  const bvh::ClusterCodeBits bits(most);
  const double codes = gathered + (24 + 24 + 24 + 12) * each + sorted(8, bits.below_cluster());
  // Merges are written once; boxes below are read by the merge above, and again by the layout.
  const double tree = (12 + 24 + 36 + 24 + 16 + 4) * each, layout = (36 + 16 + 16 + 8) * each;
  const double finish = gathered + (4 + 4 + 48 + 48) * each + 3 * 80.0 * info.nodes;
  row("a tree over the clusters", exec, codes + tree + layout + finish);
  CountingExec rays;
  rays.kernels = 1;
  row("two million rays", rays, kRays * bytes_a_ray);
}

/// Returns the bytes that a ray reads and writes.
template <bool any>
double count_rays(const char* what, const bvh::CompactTree& tree, const std::vector<Ray>& rays) {
  double nodes = 0, triangles = 0;
  for (const Ray& ray : rays) {
    bvh::RayVisitor<any, CountTriangles> visitor;
    bvh::CompactTraversal traversal;
    if (!visitor.begin(tree, ray, false)) continue;
    traversal.begin(tree, visitor);
    ++nodes;
    while (traversal.step(tree, visitor)) ++nodes;
    triangles += static_cast<double>(visitor.triangles);
  }
  const auto n = static_cast<double>(rays.size());
  const double bytes = (80 * nodes + 48 * triangles) / n + (any ? 33 : 48);
  std::printf("| %s | %zu | %.1f | %.1f | %.0f |\n", what, rays.size(), nodes / n, triangles / n,
              bytes);
  return bytes;
}

void count_mesh(const std::string& path) {
  constexpr uint32_t kSize = 1024;
  const Mesh mesh = bench::read_mesh(path);
  std::printf("\n## %s: %zu triangles\n", bench::file_name(path).c_str(), mesh.triangles.size());
  count_builds(mesh);
  const trace::Scene scene = trace::Scene::build(mesh.view());
  const auto primary = bench::camera_rays(trace::auto_camera(scene, kSize, kSize), kSize, 1);
  const auto bounce = bench::bounces(mesh, primary, scene.structure());
  const Tree tree(mesh);
  std::printf(
      "\nA tree of %.1f MB:\n\n| rays | of | nodes a ray | triangles a ray | "
      "bytes a ray |\n|---|--:|--:|--:|--:|\n",
      1e-6 * (80.0 * tree.info.nodes + 48.0 * tree.info.triangles));
  const double bytes = count_rays<false>("primary, nearest", tree.view(), primary);
  count_rays<false>("bounce, nearest", tree.view(), bounce);
  count_rays<true>("bounce, any", tree.view(), bounce);
  count_frame(mesh, bytes);
}

void count_selection() {
  const bench::Crowd crowd;
  const lod::Tables& tables = crowd.dag.tables;
  const lod::InstanceCuts cuts =
      lod::select_instances(tables, crowd.view, {crowd.planes, {}}, crowd.instances);
  double visited = 0, opened = 0, groups = 0, clusters = 0;
  for (const umbel::Transform& transform : crowd.instances) {
    const lod::View view = to_object(crowd.view, transform);
    const auto planes = lod::to_object(crowd.planes, transform);
    std::vector<uint32_t> stack{0};
    while (!stack.empty()) {
      const lod::Node& node = tables.nodes[stack.back()];
      stack.pop_back();
      ++visited;
      if (node.group != kNone) {
        const lod::Group& group = tables.groups[node.group];
        if (!lod::must_refine(group.sphere, group.error, group.level, view) ||
            lod::is_outside(group.sphere, planes))
          continue;
        ++groups;
        clusters += group.clusters.count;
      } else if (lod::must_descend(node, view, planes)) {
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
