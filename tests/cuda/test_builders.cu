// Hierarchies that are built on a device: their bytes must be those of the processor.
#include "any_mesh.hpp"
#include "builders.hpp"
#include "device_arrays.cuh"

namespace umbel::cuda {
namespace {

/// A mesh on the device.
class MeshOnDevice {
 public:
  explicit MeshOnDevice(const Mesh& mesh)
      : positions_(mesh.positions), triangles_(mesh.triangles) {}

  DeviceMesh view() const {
    return {positions_.data(), sizeof(Vec3), reinterpret_cast<const uint32_t*>(triangles_.data()),
            nullptr, uint32_t(triangles_.size())};
  }
  void move(const std::vector<Vec3>& positions) { positions_.write(positions); }

 private:
  DeviceArray<Vec3> positions_;
  DeviceArray<Triangle> triangles_;
};

class TreeOnDevice {
 public:
  explicit TreeOnDevice(uint32_t references)
      : nodes_(bvh::compact_node_capacity(references)), triangles_(references), info_(1) {}

  DeviceBvh view() const { return {nodes_.data(), triangles_.data(), info_.data()}; }
  void expect(const BuiltBvh& expected) const {
    EXPECT_TRUE(same_bytes(info_.read(), std::vector<bvh::CompactInfo>{expected.info}));
    EXPECT_TRUE(same_bytes(triangles_.read(), expected.triangles));
    EXPECT_TRUE(same_bytes(nodes_.read(expected.nodes.size()), expected.nodes));
  }

 private:
  DeviceArray<bvh::CompactNode> nodes_;
  DeviceArray<bvh::CompactTriangle> triangles_;
  DeviceArray<bvh::CompactInfo> info_;
};

/// Asks a call for its scratch memory, and calls it.
template <typename Call>
void call(const Call& function) {
  size_t bytes = 0;
  function(nullptr, bytes);
  const DeviceArray<unsigned char> scratch(bytes);  // with a guard behind it
  function(scratch.data(), bytes);
  check(cudaDeviceSynchronize(), "waiting for the device");
}

class BuildersOnDevice : public OnDevice {
 public:
  static void expect_same(Mesh mesh, const DeviceBvhConfig& config) {
    const auto n = uint32_t(mesh.triangles.size());
    MeshOnDevice on_device(mesh);
    const TreeOnDevice tree(device_references(n, config));
    const BuiltBvh expected = build_on_processor(mesh, config);
    call([&](void* scratch, size_t& bytes) {
      build_bvh(scratch, bytes, on_device.view(), config, tree.view());
    });
    tree.expect(expected);
    for (Vec3& p : mesh.positions) p = {p.x + p.y * p.y, p.y - p.z, p.z * 3};
    on_device.move(mesh.positions);
    call([&](void* scratch, size_t& bytes) {
      refit_bvh(scratch, bytes, on_device.view(), config, tree.view());
    });
    tree.expect(refit_on_processor(expected, mesh));
  }
  /// The emulated device takes long for the barriers of a sweep.
  static bool sweeps(const DeviceBvhConfig& config) {
    return config.builder == DeviceBuilder::kSweep || config.builder == DeviceBuilder::kHlbvh;
  }
  /// All triangles the same, of a line, and of a point.
  static void expect_same_of_degenerate_meshes(const DeviceBvhConfig& config) {
    Mesh mesh = shapes::soup(kEmulated ? (sweeps(config) ? 5 : 20) : 2000, 5);
    for (size_t v = 0; v < mesh.positions.size(); ++v)
      mesh.positions[v] = {float(v % 3), float(v % 3 == 1), 0};
    expect_same(mesh, config);
    for (size_t v = 0; v < mesh.positions.size(); ++v) mesh.positions[v] = {float(v), 0, 0};
    expect_same(mesh, config);
    for (Vec3& p : mesh.positions) p = {1, 2, -0.0f};
    expect_same(mesh, config);
  }
  static void expect_same(const char* builder) {
    const DeviceBvhConfig config = device_builder_preset(builder);
    DeviceBvhConfig split = config;
    split.presplit = 0.5f;
    for (const uint32_t n : {1u, 2u, 9u}) expect_same(shapes::soup(n, n), config);
    expect_same_of_degenerate_meshes(config);
    if (kEmulated) {
      expect_same(shapes::soup(sweeps(config) ? 6 : 60, 7), split);
      const bool has_treelets = config.builder == DeviceBuilder::kAtrbvh;
      if (!sweeps(config)) expect_same(shapes::soup(has_treelets ? 70 : 300, 7), config);
      return;
    }
    for (const uint32_t n : {33u, 400u}) expect_same(shapes::soup(n, n), config);
    expect_same(shapes::terrain(150, 120, 5), device_builder_preset(builder));
    expect_same(shapes::grid(70, 90), device_builder_preset(builder));
    expect_same(shapes::fan(3000), device_builder_preset(builder));
    expect_same(shapes::soup(3000, 7), split);
  }
};

TEST_F(BuildersOnDevice, lbvh_is_that_of_the_processor) { expect_same("lbvh"); }
TEST_F(BuildersOnDevice, hlbvh_is_that_of_the_processor) { expect_same("hlbvh"); }
TEST_F(BuildersOnDevice, atrbvh_is_that_of_the_processor) { expect_same("atrbvh"); }
TEST_F(BuildersOnDevice, ploc_is_that_of_the_processor) { expect_same("ploc"); }
TEST_F(BuildersOnDevice, hploc_is_that_of_the_processor) { expect_same("hploc"); }
TEST_F(BuildersOnDevice, sweep_is_that_of_the_processor) { expect_same("sweep"); }
TEST_F(BuildersOnDevice, kmeans_is_that_of_the_processor) {
  expect_same("kmeans");
  DeviceBvhConfig medians = device_builder_preset("kmeans-q3");
  medians.kmeans.distance = bvh::KmeansDistance::kManhattan;
  expect_same(kEmulated ? shapes::terrain(6, 5, 2) : shapes::terrain(80, 70, 2), medians);
  for (const char* quality : {"kmeans-q1", "kmeans-q2", "kmeans-q3", "kmeans-q4", "kmeans-q5"})
    expect_same(shapes::soup(kEmulated ? 60 : 3000, 6), device_builder_preset(quality));
}

// The fewer clusters are forwarded, the more memory the medians' sort takes.
TEST_F(BuildersOnDevice, scratch_is_enough_for_medians_where_few_clusters_are_forwarded) {
  for (const uint32_t k : {2u, 4u, 8u})
    for (const uint32_t forwarded : {1u, 2u}) {
      DeviceBvhConfig config = device_builder_preset("kmeans");
      config.kmeans.distance = bvh::KmeansDistance::kManhattan;
      config.kmeans.clusters = k;
      config.kmeans.forwarded_clusters = forwarded;
      expect_same(shapes::soup(kEmulated ? 50 : 2000, k), config);
    }
}

TEST_F(BuildersOnDevice, more_clusters_than_a_device_takes_are_refused) {
  const MeshOnDevice mesh(shapes::soup(9, 1));
  const TreeOnDevice tree(9);
  DeviceBvhConfig config = device_builder_preset("kmeans");
  size_t bytes = 0;
  config.kmeans.clusters = 64;
  EXPECT_NO_THROW(build_bvh(nullptr, bytes, mesh.view(), config, tree.view()));
  config.kmeans.clusters = 65;  // a processor takes them
  try {
    build_bvh(nullptr, bytes, mesh.view(), config, tree.view());
    FAIL() << "65 clusters were taken";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kInvalidArgument);
    EXPECT_STREQ(e.what(), "kmeans.clusters is 65, but must be from 2 to 64 on a device");
  }
}

/// Also half of them with several boxes for long triangles.
class AnySizeOfBuildersOnDevice : public BuildersOnDevice {
 protected:
  static void expect_same_of_any(const char* builder, uint32_t most = 3000) {
    const AnyMesh mesh(most);
    SCOPED_TRACE(mesh);
    DeviceBvhConfig config = device_builder_preset(builder);
    config.presplit = any_below(2) ? 0.25f * float(1 + any_below(4)) : 0;
    expect_same(mesh, config);
  }
};

TEST_F(AnySizeOfBuildersOnDevice, lbvh) { expect_same_of_any("lbvh"); }
TEST_F(AnySizeOfBuildersOnDevice, hlbvh) { expect_same_of_any("hlbvh", 600); }
TEST_F(AnySizeOfBuildersOnDevice, atrbvh) { expect_same_of_any("atrbvh"); }
TEST_F(AnySizeOfBuildersOnDevice, ploc) { expect_same_of_any("ploc"); }
TEST_F(AnySizeOfBuildersOnDevice, hploc) { expect_same_of_any("hploc"); }
TEST_F(AnySizeOfBuildersOnDevice, sweep) { expect_same_of_any("sweep", 600); }
TEST_F(AnySizeOfBuildersOnDevice, kmeans) {
  constexpr const char* kQualities[] = {"kmeans-q1", "kmeans-q2", "kmeans-q3", "kmeans-q4",
                                        "kmeans-q5"};
  expect_same_of_any(kQualities[any_below(5)]);
}

class LargerBuildersOnDevice : public BuildersOnDevice {};

TEST_F(LargerBuildersOnDevice, are_those_of_the_processor) {
  for (const char* builder : {"lbvh", "atrbvh", "ploc", "hploc"}) {
    expect_same(shapes::terrain(40, 30, 5), device_builder_preset(builder));
    expect_same(shapes::fan(3000), device_builder_preset(builder));
  }
  for (const char* builder : {"hlbvh", "sweep", "kmeans-q2", "kmeans-q5"})
    expect_same(shapes::soup(2000, 8), device_builder_preset(builder));
}

/// What compute-sanitizer looks at, which is slow.
class BuildersSmallOnDevice : public BuildersOnDevice {};

TEST_F(BuildersSmallOnDevice, are_those_of_the_processor) {
  for (const char* builder : {"lbvh", "hlbvh", "atrbvh", "ploc", "hploc", "kmeans", "sweep"}) {
    DeviceBvhConfig config = device_builder_preset(builder);
    expect_same(shapes::soup(kEmulated ? 12 : 1500, 3), config);
    config.presplit = 0.3f;
    expect_same(shapes::soup(kEmulated ? 5 : 200, 4), config);
  }
}

TEST_F(BuildersOnDevice, graphs_follow_new_positions) {
  Mesh mesh = kEmulated ? shapes::terrain(3, 2, 1) : shapes::terrain(100, 100, 1);
  const auto n = uint32_t(mesh.triangles.size());
  MeshOnDevice on_device(mesh);
  for (const char* builder : {"lbvh", "hlbvh", "atrbvh", "hploc"}) {
    SCOPED_TRACE(builder);
    const DeviceBvhConfig config = device_builder_preset(builder);
    const TreeOnDevice tree(n);
    size_t bytes = 0;
    build_bvh(nullptr, bytes, on_device.view(), config, tree.view());
    const DeviceArray<unsigned char> scratch(bytes);
    cudaStream_t stream;
    cudaGraph_t graph;
    cudaGraphExec_t replay;
    check(cudaStreamCreate(&stream), "making a stream");
    check(cudaStreamBeginCapture(stream, cudaStreamCaptureModeThreadLocal), "capturing");
    build_bvh(scratch.data(), bytes, on_device.view(), config, tree.view(), stream);
    check(cudaStreamEndCapture(stream, &graph), "capturing");
    check(cudaGraphInstantiate(&replay, graph, 0), "instantiating a graph");
    for (Vec3& p : mesh.positions) p.z *= 1.7f;
    on_device.move(mesh.positions);
    check(cudaGraphLaunch(replay, stream), "replaying");
    check(cudaStreamSynchronize(stream), "waiting");
    tree.expect(build_on_processor(mesh, config));
    cudaGraphExecDestroy(replay);
    cudaGraphDestroy(graph);
    cudaStreamDestroy(stream);
  }
}

}  // namespace
}  // namespace umbel::cuda
