// Rays and selection on the device, beside what they must move at least, and beside one core of the
// processor, which is all there is to measure without a device. Prints Markdown.
//
//   cuda_query_bench [--runs N] MESH...
//
// Rays: of one picture of 1024 x 1024, and a diffuse bounce from each hit; nearest and any hits.
// Selection: 10,000 instances of a mesh of about 1,000 groups, seen from among them.
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>

#include "base/parallel.hpp"
#include "crowd.hpp"
#include "mesh_reader.hpp"
#include "picture_rays.hpp"
#include "timing.cuh"
#include "umbel/cuda_select.hpp"
#include "umbel/cuda_trace.hpp"

namespace umbel {
namespace {

constexpr uint32_t kSize = 1024;

struct Scene {
  std::string name;
  Mesh mesh;
  Bvh expected;
  std::vector<Ray> primary, bounce;

  explicit Scene(const std::string& path)
      : name(bench::file_name(path)),
        mesh(bench::read_mesh(path)),
        expected(Bvh::build(mesh.view())) {
    const trace::Scene whole = trace::Scene::build(mesh.view());
    primary = bench::camera_rays(trace::auto_camera(whole, kSize, kSize), kSize, 1);
    bounce = bench::bounces(mesh, primary, expected);
  }
};

// ---- rays

void print_ray_head(const char* floors) {
  printf("\n| rays | of | ms | M rays/s | %s |\n|---|--:|--:|--:|--:|\n", floors);
}
void print_rays(const char* what, size_t rays, double ms, double last) {
  printf("| %s | %zu | %.4f | %.1f | %.4f |\n", what, rays, ms, double(rays) / ms / 1e3, last);
  fflush(stdout);
}

void trace_on_processor(const Scene& scene, int runs) {
  std::vector<Hit> hits(scene.primary.size());
  std::vector<uint8_t> any(scene.primary.size());
  const auto nearest = [&](const std::vector<Ray>& rays) {
    return [&] { scene.expected.intersect(rays, std::span(hits).first(rays.size()), {}, 1); };
  };
  const std::vector<double> ms = processor_milliseconds(
      {nearest(scene.primary), nearest(scene.bounce),
       [&] {
         scene.expected.occluded(scene.bounce, std::span(any).first(scene.bounce.size()), {}, 1);
       }},
      runs);
  printf("\n## %s on one core: umbel::Bvh\n", scene.name.c_str());
  print_ray_head("");
  print_rays("primary, nearest", scene.primary.size(), ms[0], 0);
  print_rays("bounce, nearest", scene.bounce.size(), ms[1], 0);
  print_rays("bounce, any", scene.bounce.size(), ms[2], 0);
}

cuda::DeviceRays rays_of(const Device<Ray>& rays, size_t count) {
  const Ray* first = rays.data();
  return {&first->origin, &first->direction, sizeof(Ray), sizeof(Ray),
          &first->t_min,  &first->t_max,     sizeof(Ray), count};
}

/// How many of the hits are those of the processor, to the bit.
size_t count_equal(const Scene& scene, const Device<float>& t, const Device<uint32_t>& ids) {
  const size_t n = scene.bounce.size();
  std::vector<float> ts(n);
  std::vector<uint32_t> primitives(n);
  check(cudaMemcpy(ts.data(), t.data(), n * 4, cudaMemcpyDeviceToHost), "copying");
  check(cudaMemcpy(primitives.data(), ids.data(), n * 4, cudaMemcpyDeviceToHost), "copying");
  std::vector<Hit> hits(n);
  scene.expected.intersect(scene.bounce, hits);
  size_t equal = 0;
  for (size_t i = 0; i < n; ++i) equal += ts[i] == hits[i].t && primitives[i] == hits[i].primitive;
  return equal;
}

void trace_on_device(const Scene& scene, int runs, double bandwidth, cudaStream_t stream) {
  const auto n = uint32_t(scene.mesh.triangles.size());
  const Device<Vec3> positions(scene.mesh.positions.data(), scene.mesh.positions.size());
  const Device<Triangle> triangles(scene.mesh.triangles.data(), n);
  const cuda::DeviceMesh mesh{positions.data(), sizeof(Vec3),
                              reinterpret_cast<const uint32_t*>(triangles.data()), nullptr, n};
  const cuda::DeviceBvhConfig config;
  const uint32_t references = cuda::device_references(n, config);
  const Device<bvh::CompactNode> nodes(bvh::compact_node_capacity(references));
  const Device<bvh::CompactTriangle> leaves(references);
  const Device<bvh::CompactInfo> info(1);
  const cuda::DeviceBvh tree{nodes.data(), leaves.data(), info.data()};
  Call build(
      [&](void* s, size_t& b, cudaStream_t t) { cuda::build_bvh(s, b, mesh, config, tree, t); });
  build(stream);
  check(cudaStreamSynchronize(stream), "building");
  const size_t most = std::max(scene.primary.size(), scene.bounce.size());
  const Device<Ray> primary(scene.primary.data(), scene.primary.size());
  const Device<Ray> bounce(scene.bounce.data(), scene.bounce.size());
  const Device<float> t(most), uvs(2 * most);
  const Device<uint32_t> ids(most);
  const Device<uint8_t> any(most);
  const cuda::DeviceHits hits{t.data(), ids.data(), uvs.data()};
  Call first([&](void* s, size_t& b, cudaStream_t st) {
    cuda::intersect_rays(s, b, tree, rays_of(primary, scene.primary.size()), hits, st);
  });
  Call second([&](void* s, size_t& b, cudaStream_t st) {
    cuda::intersect_rays(s, b, tree, rays_of(bounce, scene.bounce.size()), hits, st);
  });
  Call shadows([&](void* s, size_t& b, cudaStream_t st) {
    cuda::occluded_rays(s, b, tree, rays_of(bounce, scene.bounce.size()), any.data(), st);
  });
  const std::vector<double> ms =
      time_all({std::ref(first), std::ref(second), std::ref(shadows)}, runs, stream);
  second(stream);
  check(cudaStreamSynchronize(stream), "tracing");
  const auto floor_of = [&](size_t rays, double bytes) {
    return 1e3 * double(rays) * bytes / bandwidth;
  };
  printf("\n## %s: %u triangles\n", scene.name.c_str(), n);
  print_ray_head("rays and hits alone, ms");
  print_rays("primary, nearest", scene.primary.size(), ms[0], floor_of(scene.primary.size(), 48));
  print_rays("bounce, nearest", scene.bounce.size(), ms[1], floor_of(scene.bounce.size(), 48));
  print_rays("bounce, any", scene.bounce.size(), ms[2], floor_of(scene.bounce.size(), 33));
  printf("\nOf %zu nearest hits of bounce rays, %zu are the processor's to the bit.\n",
         scene.bounce.size(), count_equal(scene, t, ids));
}

// ---- selection

using bench::Crowd;

cuda::SelectionRoom room_of(const Crowd& crowd, size_t clusters) {
  return {uint32_t(crowd.dag.tables.nodes.size() * 64), uint32_t(clusters), uint32_t(clusters)};
}

void select_on_processor(const Crowd& crowd, const lod::InstanceCuts& cuts, int runs) {
  const double ms = processor_milliseconds(
      {[&] {
        with_threads(1, [&] {
          lod::select_instances(crowd.dag.tables, crowd.view, {crowd.planes, {}}, crowd.instances);
        });
      }},
      runs)[0];
  printf(
      "\n## Selection on one core\n\n%zu instances of %zu groups and %zu clusters: %.2f ms for %zu "
      "clusters.\n",
      crowd.instances.size(), crowd.dag.tables.groups.size(), crowd.dag.tables.clusters.size(), ms,
      cuts.clusters.size());
}

void select_on_device(const Crowd& crowd, const lod::InstanceCuts& cuts, int runs, double bandwidth,
                      cudaStream_t stream) {
  const lod::Tables& t = crowd.dag.tables;
  const Device<lod::Node> nodes(t.nodes.data(), t.nodes.size());
  const Device<lod::Group> groups(t.groups.data(), t.groups.size());
  const Device<lod::Cluster> clusters(t.clusters.data(), t.clusters.size());
  const Device<lod::View> view(&crowd.view, 1);
  const Device<lod::Plane> planes(crowd.planes.data(), crowd.planes.size());
  const Device<umbel::Transform> instances(crowd.instances.data(), crowd.instances.size());
  const cuda::SelectionRoom room = room_of(crowd, cuts.clusters.size() + 1000);
  const Device<uint32_t> offsets(crowd.instances.size() + 1), out(room.clusters);
  const Device<cuda::SelectionCounts> counts(1);
  const cuda::DeviceTables tables{nodes.data(),
                                  groups.data(),
                                  clusters.data(),
                                  nullptr,
                                  uint32_t(t.groups.size()),
                                  cuda::hierarchy_layers(t)};
  const cuda::DeviceScene scene{view.data(), planes.data(), uint32_t(crowd.planes.size()),
                                instances.data(), uint32_t(crowd.instances.size())};
  Call select([&](void* s, size_t& b, cudaStream_t st) {
    cuda::select_instances(s, b, tables, scene, {}, room,
                           {offsets.data(), out.data(), counts.data()}, {}, st);
  });
  const Graph graph(std::ref(select), stream);
  const std::vector<double> ms = time_all({std::ref(select), std::ref(graph)}, runs, stream);
  cuda::SelectionCounts found;
  std::vector<uint32_t> cut(cuts.clusters.size());
  check(cudaMemcpy(&found, counts.data(), sizeof found, cudaMemcpyDeviceToHost), "copying");
  check(cudaMemcpy(cut.data(), out.data(), cut.size() * 4, cudaMemcpyDeviceToHost), "copying");
  printf(
      "\n## Selection\n\n%zu instances of %zu groups: %.4f ms, as a graph %.4f ms; %u groups and "
      "%u clusters, overflow %u, floor by traffic %.4f ms. The cuts are %s.\n",
      crowd.instances.size(), t.groups.size(), ms[0], ms[1], found.groups, found.clusters,
      found.overflow, 1e3 * bench::selection_bytes(crowd, found.groups, found.clusters) / bandwidth,
      cut == cuts.clusters ? "those of the processor" : "WRONG");
}

int run_all(const bench::Arguments& arguments) {
  const int runs = arguments.number("runs", 50, 1);
  std::vector<std::unique_ptr<Scene>> scenes;
  for (const std::string& path : arguments.meshes())
    scenes.push_back(std::make_unique<Scene>(path));
  const Crowd crowd;
  const lod::InstanceCuts cuts =
      lod::select_instances(crowd.dag.tables, crowd.view, {crowd.planes, {}}, crowd.instances);
  if (has_device()) {
    const OwnStream stream;
    const double bandwidth = copy_bandwidth(stream.get());
    printf("# Rays and selection on the device\n");
    for (const auto& scene : scenes) trace_on_device(*scene, runs, bandwidth, stream.get());
    select_on_device(crowd, cuts, runs, bandwidth, stream.get());
  } else {
    printf("# Rays and selection without a CUDA device\n");
  }
  for (const auto& scene : scenes) trace_on_processor(*scene, 3);
  select_on_processor(crowd, cuts, 3);
  return 0;
}

}  // namespace
}  // namespace umbel

int main(int argc, char** argv) {
  return bench::run_program("cuda_query_bench", argc, argv, umbel::run_all);
}
