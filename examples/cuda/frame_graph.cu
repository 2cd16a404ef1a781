// How long a whole frame takes: 871,200 triangles deform, are clustered, get a tree, and two
// million rays are traced. Needs a device.
//
//   cuda_frame_example [FRAMES]
#include <cstdio>
#include <cstdlib>

#include "frame_graph.cuh"

namespace {

constexpr uint32_t kSide = 660, kWidth = 1920, kHeight = 1080;

std::vector<umbel::Vec3> sheet() {
  std::vector<umbel::Vec3> positions;
  for (uint32_t y = 0; y <= kSide; ++y)
    for (uint32_t x = 0; x <= kSide; ++x) {
      const float u = float(x) / kSide * 2 - 1, v = float(y) / kSide * 2 - 1;
      positions.push_back({u, v, 0.1f * sinf(9 * u) * cosf(7 * v)});
    }
  return positions;
}

std::vector<umbel::Triangle> sheet_triangles() {
  std::vector<umbel::Triangle> triangles;
  for (uint32_t y = 0; y < kSide; ++y)
    for (uint32_t x = 0; x < kSide; ++x) {
      const uint32_t a = y * (kSide + 1) + x, b = a + kSide + 1;
      triangles.push_back({a, a + 1, b});
      triangles.push_back({a + 1, b + 1, b});
    }
  return triangles;
}

void measure(int frames) {
  std::vector<umbel::Vec3> origins, directions;
  for (uint32_t y = 0; y < kHeight; ++y)
    for (uint32_t x = 0; x < kWidth; ++x) {
      origins.push_back({0, 0, 3});
      directions.push_back(
          {(float(x) / kWidth - 0.5f) * 1.6f, (float(y) / kHeight - 0.5f) * 0.9f, -1});
    }
  const std::vector<umbel::Triangle> triangles = sheet_triangles();
  example::FrameGraph graph(sheet(), triangles, origins, directions, 0.02f);
  cudaEvent_t begin, end;
  example::check(cudaEventCreate(&begin));
  example::check(cudaEventCreate(&end));
  graph.run();
  example::check(cudaEventRecord(begin, graph.stream()));
  for (int i = 0; i < frames; ++i) graph.run();
  example::check(cudaEventRecord(end, graph.stream()));
  example::check(cudaEventSynchronize(end));
  float milliseconds = 0;
  example::check(cudaEventElapsedTime(&milliseconds, begin, end));
  size_t hits = 0;
  for (const uint32_t primitive : graph.primitives.read()) hits += primitive != umbel::kNone;
  printf("%zu triangles, %u clusters, %zu rays, %zu hits: %.3f ms a frame\n", triangles.size(),
         graph.count.read()[0], origins.size(), hits, double(milliseconds) / frames);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    measure(argc > 1 ? atoi(argv[1]) : 100);
  } catch (const std::exception& error) {
    fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
