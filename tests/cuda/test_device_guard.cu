// Work goes to the device that holds the memory, whichever is the current one.

#include <gtest/gtest.h>

#include "device_arrays.cuh"
#include "umbel/cuda_clusters.hpp"
#include "umbel/cuda_memory.hpp"
#include "umbel/cuda_select.hpp"
#include "umbel/mesh.hpp"

namespace umbel::cuda {
namespace {

class OnTwoDevices : public OnDevice {
 protected:
  void SetUp() override {
    OnDevice::SetUp();
    int count = 0;
    if (cudaGetDeviceCount(&count) != cudaSuccess || count < 2)
      GTEST_SKIP() << "there is only one device here";
    check(cudaSetDevice(1), "changing the device");
  }
  void TearDown() override { cudaSetDevice(0); }

  /// Runs `work` while device 0 is current: all its kernels must start on device 1.
  template <typename Work>
  void expect_on_the_other(const Work& work) {
    check(cudaSetDevice(0), "changing the device");
#if defined(UMBEL_SIMT)
    const size_t here = simt::launches(0), there = simt::launches(1);
#endif
    work();
#if defined(UMBEL_SIMT)
    EXPECT_EQ(simt::launches(0), here);
    EXPECT_GT(simt::launches(1), there);
#endif
    int current = -1;
    check(cudaGetDevice(&current), "asking for the device");
    EXPECT_EQ(current, 0);
    check(cudaSetDevice(1), "changing the device");
  }
};

TEST_F(OnTwoDevices, clusters_are_built_where_the_mesh_is) {
  const Mesh mesh = shapes::sphere(1);
  const auto n = uint32_t(mesh.triangles.size());
  const FrameClusterConfig config;
  const uint32_t most = max_frame_clusters(n, config);
  const DeviceArray<Vec3> positions(mesh.positions);
  const DeviceArray<Triangle> triangles(mesh.triangles);
  const DeviceArray<uint32_t> items(n), indices(3 * n), offsets(most + 1), count(1);
  const DeviceArray<Aabb> boxes(most);
  const DeviceMesh input{positions.data(), sizeof(Vec3),
                         reinterpret_cast<const uint32_t*>(triangles.data()), nullptr, n};
  const DeviceClusters out{items.data(), indices.data(), offsets.data(), boxes.data(),
                           count.data()};
  size_t bytes = 0;
  build_frame_clusters(nullptr, bytes, input, config, out);
  const DeviceArray<unsigned char> scratch(bytes);
  expect_on_the_other([&] { build_frame_clusters(scratch.data(), bytes, input, config, out); });
  EXPECT_EQ(offsets.read()[count.read()[0]], n);
}

TEST_F(OnTwoDevices, views_are_put_where_their_memory_is) {
  const DeviceArray<lod::View> view(1);
  expect_on_the_other([&] { put_view(lod::view_error(0.5f), view.data()); });
  EXPECT_EQ(view.read()[0].error, 0.5f);
}

TEST_F(OnDevice, views_are_put_behind_what_is_in_the_stream_without_waiting) {
  cudaStream_t stream = nullptr;
  check(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking), "making a stream");
  const DeviceArray<lod::View> view(1);
  EXPECT_FALSE(is_captured(stream));
  check(cudaStreamBeginCapture(stream, cudaStreamCaptureModeThreadLocal), "capturing");
  EXPECT_TRUE(is_captured(stream));
  {
    lod::View given = lod::view_error(0.25f);
    put_view(given, view.data(), stream);
    given.error = 7;  // what was given counts
  }
  cudaGraph_t graph = nullptr;
  check(cudaStreamEndCapture(stream, &graph), "capturing");
  EXPECT_NE(view.read()[0].error, 0.25f);
  cudaGraphExec_t exec = nullptr;
  check(cudaGraphInstantiate(&exec, graph, 0), "instantiating");
  check(cudaGraphLaunch(exec, stream), "replaying");
  wait_for(stream);
  EXPECT_EQ(view.read()[0].error, 0.25f);
  cudaGraphExecDestroy(exec);
  cudaGraphDestroy(graph);
  cudaStreamDestroy(stream);
}

TEST_F(OnDevice, memory_is_copied_in_and_back) {
  const std::vector<uint32_t> values = {1, 2, 3, 5};
  std::vector<uint32_t> back(values.size());
  void* memory = device_allocate(values.size() * sizeof(uint32_t));
  device_copy(memory, values.data(), values.size() * sizeof(uint32_t));
  device_copy(back.data(), memory, values.size() * sizeof(uint32_t));
  EXPECT_EQ(back, values);
  device_free(memory);
}

}  // namespace
}  // namespace umbel::cuda
