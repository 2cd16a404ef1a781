// How long selections of one mesh take on one core: flat, through the hierarchy and breadth first,
// which must agree. Groups are made small, so that there are as many as in a mesh of a hundred
// times the size.
//
//   select_bench [--runs N] MESH...
//
// Medians of N runs of processor time for four views: an error that shows a hundredth of the
// triangles, and a camera of 1080 lines and one pixel from two diagonals away, from the side of
// the mesh's box, and from inside the box, culled by the frustum.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <string>
#include <vector>

#include "base/math.hpp"
#include "mesh_reader.hpp"
#include "umbel/lod.hpp"

namespace {

namespace lod = umbel::lod;
using umbel::Vec3;

struct Views {
  const char* name;
  lod::View view;
  std::vector<lod::Plane> planes;
};

double processor_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

template <typename Select>
double median_ms(int runs, std::vector<uint32_t>& cut, const Select& select) {
  std::vector<double> times;
  for (int i = 0; i < runs; ++i) {
    const double start = processor_seconds();
    cut = select();
    times.push_back(1e3 * (processor_seconds() - start));
  }
  std::sort(times.begin(), times.end());
  return times[times.size() / 2];
}

Views seen_from(const char* name, const umbel::Aabb& box, float along) {
  constexpr float kFov = 1.0f;
  umbel::Camera camera;
  const Vec3 size = box.max - box.min;
  camera.target = (box.min + box.max) * 0.5f;
  camera.position = camera.target + Vec3{0, 0, along * umbel::length(size)};
  if (along == 0) camera.target = camera.target - Vec3{0, 0, 1};
  camera.fov_y = kFov;
  return {name, lod::view_camera(camera.position, kFov, 1080, 1.0f),
          lod::frustum_planes(camera, 16.0f / 9.0f)};
}

void measure(const std::string& path, int runs) {
  const umbel::Mesh mesh = bench::read_mesh(path);
  lod::Config config;
  config.max_triangles = config.max_vertices = 16;
  config.min_group = 2;
  config.max_group = 3;
  const lod::Dag dag = lod::build(mesh.view(), config);
  const lod::Tables& tables = dag.tables;
  const umbel::Aabb box = umbel::bounds(mesh.view());
  const std::string name = path.substr(path.find_last_of('/') + 1);
  const float error = lod::error_for_triangles(tables, mesh.triangles.size() / 100);
  for (const Views& v :
       {Views{"a hundredth", lod::view_error(error), {}}, seen_from("far", box, 2.0f),
        seen_from("side", box, 0.6f), seen_from("inside", box, 0.0f)}) {
    const lod::Culling culling{v.planes, {}};
    std::vector<uint32_t> flat, descended, broad;
    const double flat_ms =
        median_ms(runs, flat, [&] { return lod::select(tables, v.view, culling); });
    const double descended_ms =
        median_ms(runs, descended, [&] { return lod::select_hierarchy(tables, v.view, culling); });
    const double broad_ms =
        median_ms(runs, broad, [&] { return lod::select_breadth_first(tables, v.view, culling); });
    std::sort(descended.begin(), descended.end());
    std::sort(broad.begin(), broad.end());
    if (descended != flat || broad != flat) bench::fail(path, "selections differ");
    std::printf("| %s | %zu | %zu | %s | %zu | %.3f | %.3f | %.3f |\n", name.c_str(),
                tables.groups.size(), tables.clusters.size(), v.name, flat.size(), flat_ms,
                descended_ms, broad_ms);
  }
}

}  // namespace

int main(int count, char** arguments) {
  int runs = 21;
  std::vector<std::string> meshes;
  for (int i = 1; i < count; ++i) {
    if (std::strcmp(arguments[i], "--runs") == 0 && i + 1 < count)
      runs = static_cast<int>(std::max(1L, std::strtol(arguments[++i], nullptr, 10)));
    else
      meshes.emplace_back(arguments[i]);
  }
  if (meshes.empty()) {
    std::fprintf(stderr, "usage: %s [--runs N] MESH...\n", arguments[0]);
    return 2;
  }
  std::printf(
      "| mesh | groups | clusters | view | clusters shown | flat ms | hierarchy ms | breadth first "
      "ms |\n|---|--:|--:|---|--:|--:|--:|--:|\n");
  for (const std::string& path : meshes) measure(path, runs);
}
