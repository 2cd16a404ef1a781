#include <algorithm>
#include <limits>
#include <numeric>
#include <random>

#include "any_mesh.hpp"
#include "device_arrays.cuh"
#include "umbel/cuda_clusters.hpp"
#include "umbel/umbel_cuda_clusters.h"

namespace umbel::cuda {
namespace {

std::vector<FrameClusterConfig> configs() {
  std::vector<FrameClusterConfig> all;
  for (const FrameMethod method : {FrameMethod::kMorton, FrameMethod::kHybrid})
    for (const uint32_t bits : {30u, 63u})
      for (const uint32_t vertices : {0u, 64u}) {
        FrameClusterConfig config;
        config.method = method;
        config.code_bits = bits;
        config.max_vertices = vertices;
        all.push_back(config);
      }
  return all;
}

std::vector<Mesh> meshes() {
  std::vector<Mesh> all = {shapes::sphere(0), shapes::soup(1, 1)};
  if (kEmulated) {
    all.push_back(shapes::soup(300, 2));
  } else {
    all.push_back(shapes::sphere(5));
    all.push_back(shapes::grid(40, 300));
    all.push_back(shapes::soup(40000, 2));
  }
  Mesh same = shapes::soup(kEmulated ? 200 : 3000, 3);
  for (size_t v = 0; v < same.positions.size(); ++v)
    same.positions[v] = {float(v % 3), float(v % 3 == 1), 0};
  all.push_back(same);
  all.emplace_back();
  return all;
}

/// Positions as they may lie in a vertex buffer.
std::vector<float> interleaved(const Mesh& mesh, size_t floats) {
  std::vector<float> values(mesh.positions.size() * floats, -1e30f);
  for (size_t v = 0; v < mesh.positions.size(); ++v)
    memcpy(&values[v * floats], &mesh.positions[v], sizeof(Vec3));
  return values;
}

std::vector<uint32_t> indices_of(std::span<const Triangle> triangles) {
  std::vector<uint32_t> indices(triangles.size() * 3);
  memcpy(indices.data(), triangles.data(), indices.size() * sizeof(uint32_t));
  return indices;
}

/// The arrays of clusters.
struct Arrays {
  DeviceArray<uint32_t> items, indices, offsets, count;
  DeviceArray<Aabb> boxes;
  DeviceArray<uint64_t> now, at_build, total;

  Arrays(uint32_t n, const FrameClusterConfig& config)
      : Arrays(n, max_frame_clusters(n, config), 0) {}
  DeviceClusters view() const {
    return {items.data(), indices.data(), offsets.data(), boxes.data(), count.data()};
  }
  DeviceAreaGrowth area_growth() const { return {now.data(), at_build.data(), total.data()}; }

  void expect_same(const FrameClusterer& expected) const {
    const auto clusters = uint32_t(expected.count());
    const auto copy = [](auto span) {
      return std::vector<std::remove_const_t<typename decltype(span)::element_type>>(span.begin(),
                                                                                     span.end());
    };
    ASSERT_EQ(count.read()[0], clusters);
    EXPECT_EQ(items.read(), copy(expected.items()));
    EXPECT_EQ(indices.read(), indices_of(expected.triangles()));
    EXPECT_EQ(offsets.read(clusters + 1), copy(expected.offsets()));
    EXPECT_TRUE(same_bytes(boxes.read(clusters), copy(expected.boxes())));
  }
  void expect_area_growth(const AreaGrowth& expected) const {
    const auto sums = total.read();
    const AreaGrowth growth = area_growth_of(sums.data());
    EXPECT_EQ(growth.area_ratio, expected.area_ratio);
    EXPECT_EQ(growth.area_ratio_at_build, expected.area_ratio_at_build);
  }

 private:
  Arrays(uint32_t n, uint32_t most, int)
      : items(n),
        indices(size_t(n) * 3),
        offsets(most + 1),
        count(1),
        boxes(most),
        now(most),
        at_build(most),
        total(2) {}
};

/// The same scene on both sides.
struct Scene {
  static constexpr size_t kFloats = 5;
  const Mesh& mesh;
  FrameClusterConfig config;
  uint32_t n;
  DeviceArray<float> positions;
  DeviceArray<uint32_t> indices;
  Arrays first, second;
  FrameClusterer expected;

  Scene(const Mesh& m, const FrameClusterConfig& c)
      : mesh(m),
        config(c),
        n(uint32_t(m.triangles.size())),
        positions(interleaved(m, kFloats)),
        indices(indices_of(m.triangles)),
        first(n, c),
        second(n, c),
        expected(m.triangles, m.positions.size(), c) {}

  DeviceMesh input() const { return {positions.data(), kFloats * 4, indices.data(), nullptr, n}; }
  void build(Arrays& out, DeviceMesh from) const {
    with_scratch([&](void* scratch, size_t& bytes) {
      build_frame_clusters(scratch, bytes, from, config, out.view());
    });
    with_scratch([&](void* scratch, size_t& bytes) {
      measure_frame_clusters(scratch, bytes, n, config, out.view(), out.area_growth(), true);
    });
  }
};

std::vector<Vec3> twisted(const std::vector<Vec3>& positions, float angle) {
  std::vector<Vec3> result = positions;
  for (Vec3& p : result) {
    const float a = angle * p.x;
    p = {p.x, p.y * std::cos(a) - p.z * std::sin(a), p.y * std::sin(a) + p.z * std::cos(a)};
  }
  return result;
}

class FrameClustersOnDevice : public OnDevice {};

TEST_F(FrameClustersOnDevice, builds_are_the_bytes_of_the_processor) {
  for (const Mesh& mesh : meshes())
    for (const FrameClusterConfig& config : configs()) {
      Scene scene(mesh, config);
      scene.expected.build(mesh.positions);
      scene.build(scene.first, scene.input());
      scene.first.expect_same(scene.expected);
      scene.first.expect_area_growth(scene.expected.area_growth());
    }
}

// A minimum with a NaN depends on the order of its operands, and that of a reduction on the run.
TEST_F(FrameClustersOnDevice, what_is_no_number_gives_the_same_clusters_each_time) {
  Mesh mesh = shapes::soup(kEmulated ? 200 : 40000, 5);
  const float none = std::numeric_limits<float>::quiet_NaN();
  for (size_t v = 0; v < mesh.positions.size(); v += 40) mesh.positions[v] = {none, 0, none};
  for (const FrameMethod method : {FrameMethod::kMorton, FrameMethod::kHybrid}) {
    FrameClusterConfig config;
    config.method = method;
    Scene scene(mesh, config);
    scene.build(scene.first, scene.input());
    const auto items = scene.first.items.read();
    const auto boxes = scene.first.boxes.read(scene.first.count.read()[0]);
    std::vector<uint32_t> sorted = items, all(scene.n);
    std::sort(sorted.begin(), sorted.end());
    std::iota(all.begin(), all.end(), 0u);
    EXPECT_EQ(sorted, all);
    for (int run = 0; run < 3; ++run) {
      scene.build(scene.second, scene.input());
      EXPECT_EQ(scene.second.items.read(), items);
      EXPECT_TRUE(same_bytes(scene.second.boxes.read(boxes.size()), boxes));
    }
  }
}

// Many triangles in one bin of a block: more than are ranked by comparing all with all.
TEST_F(FrameClustersOnDevice, crowded_bins_are_divided_as_on_the_processor) {
  Mesh mesh = shapes::soup(700, 8);
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    Vec3& p = mesh.positions[v];
    p = {p.x * 1e-3f + (v < 3 ? 1.0f : 0.0f), p.y * 1e-3f, p.z * 1e-3f};
  }
  FrameClusterConfig config;
  config.max_triangles = 100;
  Scene scene(mesh, config);
  scene.expected.build(mesh.positions);
  scene.build(scene.first, scene.input());
  scene.first.expect_same(scene.expected);
}

class LargerFrameClustersOnDevice : public FrameClustersOnDevice {};

TEST_F(LargerFrameClustersOnDevice, are_the_bytes_of_the_processor) {
  const Mesh mesh = shapes::sphere(4);
  for (const FrameMethod method : {FrameMethod::kMorton, FrameMethod::kHybrid}) {
    FrameClusterConfig config;
    config.method = method;
    Scene scene(mesh, config);
    scene.expected.build(mesh.positions);
    scene.build(scene.first, scene.input());
    scene.first.expect_same(scene.expected);
  }
}

/// After a build, whose clusters follow a twisted mesh.
void expect_same_updates(const Mesh& mesh, const FrameClusterConfig& config) {
  Scene scene(mesh, config);
  scene.expected.build(mesh.positions);
  scene.build(scene.first, scene.input());
  Mesh moved = mesh;
  moved.positions = twisted(mesh.positions, 2);
  scene.positions.write(interleaved(moved, Scene::kFloats));
  with_scratch([&](void* scratch, size_t& bytes) {
    refit_frame_clusters(scratch, bytes, scene.input(), config, scene.first.view(),
                         scene.first.area_growth());
  });
  scene.first.expect_area_growth(scene.expected.refit(moved.positions));
  scene.first.expect_same(scene.expected);
  if (!config.max_vertices) {
    with_scratch([&](void* scratch, size_t& bytes) {
      rebuild_worst_frame_clusters(scratch, bytes, scene.input(), config, 20, scene.first.view(),
                                   scene.first.area_growth(), scene.second.view(),
                                   scene.second.area_growth());
    });
    scene.second.expect_area_growth(scene.expected.rebuild_worst(moved.positions, 20));
    scene.second.expect_same(scene.expected);
  }
  Arrays& last = config.max_vertices ? scene.first : scene.second;
  Arrays& next = config.max_vertices ? scene.second : scene.first;
  DeviceMesh again = scene.input();
  again.indices = last.indices.data();
  again.items = last.items.data();
  scene.build(next, again);
  scene.expected.update(moved.positions);
  next.expect_same(scene.expected);
}

TEST_F(FrameClustersOnDevice, updates_refits_and_partial_rebuilds_are_the_bytes_of_the_processor) {
  const Mesh mesh = shapes::blob(kEmulated ? 2 : 5, 4);
  for (const FrameClusterConfig& config : configs()) expect_same_updates(mesh, config);
}

void expect_same_vertex_lists(const Mesh& mesh, const FrameClusterConfig& config) {
  Scene scene(mesh, config);
  scene.expected.build(mesh.positions);
  scene.build(scene.first, scene.input());
  const uint32_t most = max_frame_clusters(scene.n, config);
  const DeviceArray<uint32_t> offsets(most + 1), vertices(scene.n * 3);
  const DeviceArray<uint8_t> corners(scene.n * 3);
  with_scratch([&](void* scratch, size_t& bytes) {
    list_frame_vertices(scratch, bytes, scene.n, config, scene.first.view(),
                        {offsets.data(), vertices.data(), corners.data()});
  });
  const FrameVertexLists lists = list_frame_vertices(scene.expected);
  EXPECT_EQ(offsets.read(lists.vertex_offsets.size()), lists.vertex_offsets);
  EXPECT_EQ(vertices.read(lists.vertices.size()), lists.vertices);
  const auto bytes = corners.read();
  EXPECT_EQ(memcmp(bytes.data(), lists.corners.data(), bytes.size()), 0);
}

TEST_F(FrameClustersOnDevice, vertex_lists_are_the_bytes_of_the_processor) {
  const Mesh mesh = shapes::sphere(kEmulated ? 2 : 5);
  for (FrameClusterConfig config : configs()) {
    if (!config.max_vertices) config.max_triangles = 64;
    expect_same_vertex_lists(mesh, config);
  }
}

class AnySizeOfFrameClustersOnDevice : public FrameClustersOnDevice {};

TEST_F(AnySizeOfFrameClustersOnDevice, clusters) {
  const AnyMesh mesh(4000);
  FrameClusterConfig config;
  config.method = any_below(2) ? FrameMethod::kMorton : FrameMethod::kHybrid;
  config.code_bits = any_below(2) ? 30 : 63;
  config.max_triangles = 2 + any_below(any_below(2) ? 30 : 511);
  config.max_vertices = any_below(2) ? 3 + any_below(254) : 0;
  SCOPED_TRACE(mesh);
  SCOPED_TRACE(config.max_triangles);
  SCOPED_TRACE(config.max_vertices);
  expect_same_updates(mesh, config);
  if (config.max_vertices || config.max_triangles <= 85) expect_same_vertex_lists(mesh, config);
}

TEST_F(FrameClustersOnDevice, a_graph_follows_new_positions) {
  const Mesh mesh = shapes::blob(kEmulated ? 1 : 5, 9);
  for (const FrameClusterConfig& config : configs()) {
    Scene scene(mesh, config);
    size_t bytes = 0;
    build_frame_clusters(nullptr, bytes, scene.input(), config, {});
    const DeviceArray<unsigned char> scratch(bytes);
    cudaStream_t stream;
    check(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking), "making a stream");
    check(cudaStreamBeginCapture(stream, cudaStreamCaptureModeThreadLocal), "capturing");
    build_frame_clusters(scratch.data(), bytes, scene.input(), config, scene.first.view(), stream);
    cudaGraph_t graph;
    check(cudaStreamEndCapture(stream, &graph), "capturing");
    cudaGraphExec_t replay;
    check(cudaGraphInstantiate(&replay, graph, 0), "instantiating a graph");
    for (const float angle : {0.0f, 1.0f, 3.0f}) {
      Mesh moved = mesh;
      moved.positions = twisted(mesh.positions, angle);
      scene.positions.write(interleaved(moved, Scene::kFloats));
      check(cudaGraphLaunch(replay, stream), "replaying");
      check(cudaStreamSynchronize(stream), "waiting");
      scene.expected.build(moved.positions);
      scene.first.expect_same(scene.expected);
    }
    cudaGraphExecDestroy(replay);
    cudaGraphDestroy(graph);
    cudaStreamDestroy(stream);
  }
}

TEST_F(FrameClustersOnDevice, scratch_that_is_too_small_is_refused) {
  const Mesh mesh = shapes::sphere(3);
  Scene scene(mesh, {});
  size_t bytes = 0;
  build_frame_clusters(nullptr, bytes, scene.input(), {}, {});
  const DeviceArray<unsigned char> scratch(bytes);
  size_t fewer = bytes - 1;
  EXPECT_THROW(build_frame_clusters(scratch.data(), fewer, scene.input(), {}, scene.first.view()),
               Error);
}

TEST_F(FrameClustersOnDevice, c_gives_the_same_clusters) {
  const Mesh mesh = shapes::sphere(kEmulated ? 1 : 4);
  Scene scene(mesh, {});
  umbel_frame_config config;
  umbel_frame_config_init(&config);
  const umbel_cuda_mesh input{scene.positions.data(), Scene::kFloats * 4, scene.indices.data(),
                              nullptr, scene.n};
  const DeviceClusters view = scene.first.view();
  const umbel_cuda_clusters out{view.items, view.indices, view.offsets,
                                reinterpret_cast<umbel_aabb*>(view.boxes), view.count};
  size_t bytes = 0;
  ASSERT_EQ(umbel_cuda_build_frame_clusters(nullptr, &bytes, &input, &config, nullptr, nullptr),
            UMBEL_OK);
  const DeviceArray<unsigned char> scratch(bytes);
  ASSERT_EQ(umbel_cuda_build_frame_clusters(scratch.data(), &bytes, &input, &config, &out, nullptr),
            UMBEL_OK);
  scene.expected.build(mesh.positions);
  scene.first.expect_same(scene.expected);
}

// What is wrong is said before any device is asked.

TEST(FrameClustersInC, mistakes_are_named) {
  umbel_frame_config config;
  umbel_frame_config_init(&config);
  uint32_t most = 0;
  ASSERT_EQ(umbel_frame_max_clusters(1000, &config, &most), UMBEL_OK);
  EXPECT_EQ(most, max_frame_clusters(1000, {}));
  umbel_cuda_mesh mesh{nullptr, 10, nullptr, nullptr, 8};
  size_t bytes = 0;
  const auto build = [&] {
    return umbel_cuda_build_frame_clusters(nullptr, &bytes, &mesh, &config, nullptr, nullptr);
  };
  EXPECT_EQ(build(), UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_STREQ(umbel_last_error(),
               "position_stride must be a multiple of 4 and at least 12, not 10");
  mesh.position_stride = 12;
  config.max_triangles = 1000;
  EXPECT_EQ(build(), UMBEL_ERROR_INVALID_ARGUMENT);
  umbel_frame_config_init(&config);
  config.struct_size = 4;
  EXPECT_EQ(build(), UMBEL_ERROR_INVALID_ARGUMENT);
  umbel_frame_config_init(&config);
  EXPECT_EQ(umbel_cuda_build_frame_clusters(nullptr, nullptr, &mesh, &config, nullptr, nullptr),
            UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(umbel_cuda_build_frame_clusters(nullptr, &bytes, nullptr, &config, nullptr, nullptr),
            UMBEL_ERROR_INVALID_ARGUMENT);
}

TEST(FrameClustersInC, without_a_device_cuda_is_quoted) {
  if (has_device()) GTEST_SKIP() << "there is a CUDA device here";
  umbel_frame_config config;
  umbel_frame_config_init(&config);
  const umbel_cuda_mesh mesh{nullptr, 12, nullptr, nullptr, 1000};
  size_t bytes = 0;
  EXPECT_EQ(umbel_cuda_build_frame_clusters(nullptr, &bytes, &mesh, &config, nullptr, nullptr),
            UMBEL_ERROR_DEVICE);
  EXPECT_NE(std::string(umbel_last_error()).find("CUDA says: "), std::string::npos);
}

}  // namespace
}  // namespace umbel::cuda
