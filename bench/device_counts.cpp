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
#include "device_memory/exec.hpp"
#include "lod/select/instances.hpp"
#include "lod/select/select_queue.hpp"
#include "mesh_reader.hpp"
#include "picture_rays.hpp"
// The processor's form of this, as in tests/on_processor.
#include "cuda/bvh.cu"

namespace {

using namespace umbel;
using bench::CountingExec, bench::KernelCounts;

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

/// What builds over a mesh need.
struct Input {
  explicit Input(const Mesh& mesh)
      : positions{reinterpret_cast<const char*>(mesh.positions.data()), sizeof(Vec3)},
        triangles(mesh.triangles.data()),
        n(static_cast<uint32_t>(mesh.triangles.size())),
        nodes(bvh::compact_node_capacity(n)),
        leaves(n) {}

  cluster::Positions positions;
  const Triangle* triangles;
  uint32_t n;
  CpuBuffer<bvh::CompactNode> nodes;
  CpuBuffer<bvh::CompactTriangle> leaves;
  bvh::CompactInfo info{};
};

std::vector<KernelCounts> count_build(Input& input, const char* builder, CountingExec& exec) {
  std::vector<KernelCounts> stages;
  cuda::build_compact(exec, {input.positions, input.triangles}, nullptr, input.n,
                      cuda::device_builder_preset(builder),
                      {input.nodes.data(), input.leaves.data(), &input.info},
                      [&](const char* stage) { stages.push_back(exec.take(stage)); });
  return stages;
}

KernelCounts sum_of(const std::vector<KernelCounts>& stages) {
  KernelCounts sum;
  for (const KernelCounts& stage : stages) sum.add(stage);
  return sum;
}

void count_builds(Input& input) {
  std::printf(
      "\n| builder | kernels | waits | words read a triangle | written | atomics | bytes moved "
      "|\n|---|--:|--:|--:|--:|--:|--:|\n");
  const double n = input.n;
  const auto row = [&](const std::string& name, uint32_t waits, const KernelCounts& c) {
    std::printf("| %s | %.0f | %u | %.1f | %.1f | %.2f | %.0f |\n", name.c_str(),
                double(c.launches), waits, double(c.words_read) / n, double(c.words_written) / n,
                double(c.atomics) / n, double(c.bytes) / n);
    std::fflush(stdout);
  };
  for (const char* builder : {"lbvh", "hlbvh", "atrbvh", "ploc", "hploc", "kmeans-q2", "sweep"}) {
    // The sweep of larger meshes takes longer than all the rest.
    if (builder == std::string("sweep") && input.n > 200000) continue;
    CountingExec exec;
    const std::vector<KernelCounts> stages = count_build(input, builder, exec);
    row(builder, exec.waits, sum_of(stages));
    if (builder != std::string("lbvh") && builder != std::string("hploc")) continue;
    for (const KernelCounts& stage : stages) row("– " + stage.stage, 0, stage);
  }
}

/// Clusters of a frame, and the arrays that they are in.
struct Clusters {
  CpuBuffer<uint32_t> items, offsets;
  CpuBuffer<Triangle> triangles;
  CpuBuffer<Aabb> boxes;
  uint32_t count = 0;

  explicit Clusters(uint32_t n) : items(n), offsets(size_t{n} + 1), triangles(n), boxes(n) {}

  KernelCounts build(const Input& input, FrameMethod method) {
    FrameClusterConfig config;
    config.method = method;
    CountingExec exec;
    cluster::build_frame(exec, {input.positions, input.triangles, nullptr, input.n},
                         cluster::CheckedFrameConfig::of(config, input.n),
                         {items.data(), triangles.data(), offsets.data(), boxes.data(), &count});
    return exec.take("clusters");
  }
};

/// What a frame of examples/cuda starts, and the bytes that it moves.
void count_frame(const Mesh& mesh, Input& input, double bytes_a_ray) {
  constexpr double kRays = 1920 * 1080;
  std::printf("\n| step of a frame | kernels | MB |\n|---|--:|--:|\n");
  const auto row = [](const char* step, uint64_t kernels, double bytes) {
    std::printf("| %s | %.0f | %.0f |\n", step, double(kernels), 1e-6 * bytes);
  };
  row("deform", 2, 24.0 * static_cast<double>(mesh.positions.size()));
  Clusters clusters(input.n);
  const KernelCounts morton = clusters.build(input, FrameMethod::kMorton);
  row("clusters, Morton", morton.launches, double(morton.bytes));
  const KernelCounts hybrid = clusters.build(input, FrameMethod::kHybrid);
  row("clusters, hybrid", hybrid.launches, double(hybrid.bytes));
  CountingExec exec;
  cuda::build_compact(exec, {input.positions, clusters.triangles.data()}, clusters.items.data(),
                      input.n, cuda::device_builder_preset("lbvh"),
                      {input.nodes.data(), input.leaves.data(), &input.info}, cuda::NoStages{},
                      {clusters.offsets.data(), clusters.boxes.data(), &clusters.count,
                       max_frame_clusters(input.n, {})});
  const KernelCounts tree = exec.take("tree");
  row("a tree over the clusters", tree.launches, double(tree.bytes));
  row("two million rays", 1, kRays * bytes_a_ray);
}

/// An H200 as the model has it. What a device does not publish is assumed.
struct Model {
  static constexpr double kBandwidth = 4.8e12;  ///< bytes a second, as published
  static constexpr double kLaunch = 2e-6;       ///< of a kernel in a graph, after another: assumed
  static constexpr double kAtomics = 1e11;      ///< a second, where few meet: assumed

  static double besides(const KernelCounts& c) {
    return double(c.launches) * kLaunch + double(c.atomics) / kAtomics;
  }
  static double seconds(const KernelCounts& c) { return double(c.bytes) / kBandwidth + besides(c); }
};

/// A goal, and what the model says of it: also the share of the bandwidth that would do.
void print_goal(const char* work, const KernelCounts& c, double goal) {
  const double left = goal - Model::besides(c);
  std::printf("| %s | %.0f | %.2f | %.1f | %.3f | %.3f | %.0f %% |\n", work, double(c.launches),
              1e-6 * double(c.atomics), 1e-6 * double(c.bytes), 1e3 * Model::seconds(c), 1e3 * goal,
              100 * double(c.bytes) / Model::kBandwidth / left);
}

/// For a mesh of that many triangles, if each takes what one of this mesh does.
KernelCounts scaled(KernelCounts c, double factor) {
  c.bytes = static_cast<uint64_t>(double(c.bytes) * factor);
  c.atomics = static_cast<uint64_t>(double(c.atomics) * factor);
  return c;
}

void print_goal_head() {
  std::printf(
      "\n| work | kernels | million atomics | MB | model ms | goal ms | bandwidth that the goal "
      "takes |\n|---|--:|--:|--:|--:|--:|--:|\n");
}

void count_goals(Input& input) {
  print_goal_head();
  constexpr double kLarge = 16e6;
  const auto build = [&](const char* name) {
    CountingExec exec;
    return scaled(sum_of(count_build(input, name, exec)), kLarge / input.n);
  };
  print_goal("LBVH, ready to trace, 16 M triangles", build("lbvh"), kLarge / 2.5e9);
  print_goal("H-PLOC, ready to trace, 16 M triangles", build("hploc"), kLarge / 1.5e9);
  Clusters clusters(input.n);
  print_goal("Morton clusters of the mesh", clusters.build(input, FrameMethod::kMorton), 0.12e-3);
  print_goal("hybrid clusters of the mesh", clusters.build(input, FrameMethod::kHybrid), 0.3e-3);
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
  Input input(mesh);
  count_goals(input);
  count_builds(input);
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
  count_frame(mesh, input, bytes);
}

uint32_t layers_of(const lod::Tables& tables) {
  uint32_t layers = 0;
  for (std::vector<uint32_t> layer{0}, next; !layer.empty(); ++layers) {
    next.clear();
    for (const uint32_t node : layer)
      for (uint32_t k = 0; k < tables.nodes[node].children.count; ++k)
        next.push_back(tables.nodes[node].children.offset + k);
    std::swap(layer, next);
  }
  return layers;
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
  // As on a device.
  const CpuBuffer<uint32_t> offsets(crowd.instances.size() + 1), out(cuts.clusters.size() + 1000);
  cuda::SelectionCounts found{};
  const auto room = static_cast<uint32_t>(out.size());
  CountingExec exec;
  cuda::select_by_queue(
      exec,
      {tables.nodes.data(), tables.groups.data(), tables.clusters.data(), nullptr,
       static_cast<uint32_t>(tables.groups.size()), layers_of(tables)},
      {&crowd.view, crowd.planes.data(), static_cast<uint32_t>(crowd.planes.size()),
       crowd.instances.data(), static_cast<uint32_t>(crowd.instances.size())},
      {}, {static_cast<uint32_t>(tables.nodes.size() * 64), room, room},
      {offsets.data(), out.data(), &found}, {});
  print_goal_head();
  print_goal("selection of 10,000 instances", exec.take("selection"), 0.15e-3);
}

}  // namespace

int main(int argc, char** argv) try {
  std::printf("# What devices do\n");
  count_selection();
  for (int i = 1; i < argc; ++i) count_mesh(argv[i]);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "device_counts: %s\n", error.what());
  return 1;
}
