#include <random>

#include "any_mesh.hpp"
#include "device_arrays.cuh"
#include "lod/synthetic_dag.hpp"
#include "selected.hpp"
#include "umbel/umbel_cuda_select.h"

namespace umbel::cuda {
namespace {

using lod::testing::Random;

const lod::Dag& blob() {
  static const lod::Dag dag =
      lod::build(shapes::blob(kEmulated ? 3 : 5, 7).view(), lod::testing::small_config());
  return dag;
}

std::vector<Transform> transforms(size_t count, uint32_t seed) {
  Random random(seed);
  std::vector<Transform> all(count);
  for (Transform& t : all)
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j)
        t.rows[4 * i + j] = static_cast<float>((i == j ? 1 : 0) + random.between(-0.3, 0.3));
      t.rows[4 * i + 3] = static_cast<float>(random.between(-20, 20));
    }
  return all;
}

std::vector<lod::Plane> frustum(const Vec3& eye) {
  return lod::frustum_planes({eye, {1, 2, 3}, {0, 1, 0}, 1.0f}, 1.5f);
}

/// A mesh's tables, instances, and all that a selection reads and writes, on the device.
struct Scene {
  DeviceArray<lod::Node> nodes;
  DeviceArray<lod::Group> groups;
  DeviceArray<lod::Cluster> clusters;
  DeviceArray<ClusterBounds> normal_cones;
  DeviceArray<lod::View> view;
  DeviceArray<lod::Plane> planes;
  DeviceArray<Transform> instances;
  SelectionRoom room;
  DeviceArray<uint32_t> offsets, cut;
  DeviceArray<SelectionCounts> counts;
  uint32_t layers;

  Scene(const lod::Tables& tables, const std::vector<ClusterBounds>& bounds,
        const std::vector<lod::Plane>& p, const std::vector<Transform>& t)
      : nodes(tables.nodes),
        groups(tables.groups),
        clusters(tables.clusters),
        normal_cones(bounds),
        view(1),
        planes(p),
        instances(t),
        room{uint32_t(tables.nodes.size() * t.size()), uint32_t(tables.groups.size() * t.size()),
             uint32_t(tables.clusters.size() * t.size())},
        offsets(t.size() + 1),
        cut(room.clusters),
        counts(1),
        layers(hierarchy_layers(tables)) {}

  DeviceTables tables() const {
    return {nodes.data(),
            groups.data(),
            clusters.data(),
            normal_cones.size() > 0 ? normal_cones.data() : nullptr,
            uint32_t(groups.size()),
            layers};
  }
  DeviceScene scene() const {
    return {view.data(), planes.data(), uint32_t(planes.size()), instances.data(),
            uint32_t(instances.size())};
  }
  DeviceSelection out() const { return {offsets.data(), cut.data(), counts.data()}; }

  void select(void* scratch, size_t& bytes, const DevicePages& pages,
              const DeviceFeedback& feedback, Stream stream = nullptr) const {
    select_instances(scratch, bytes, tables(), scene(), pages, room, out(), feedback, stream);
  }
  void select(const DevicePages& pages = {}, const DeviceFeedback& feedback = {}) const {
    size_t bytes = 0;
    select(nullptr, bytes, pages, feedback);
    const DeviceArray<unsigned char> scratch(bytes);
    select(scratch.data(), bytes, pages, feedback);
    check(cudaDeviceSynchronize(), "selecting");
  }
  void expect(const lod::InstanceCuts& expected) const {
    EXPECT_EQ(counts.read()[0].overflow, 0u);
    EXPECT_EQ(offsets.read(), expected.offsets);
    EXPECT_EQ(cut.read(expected.clusters.size()), expected.clusters);
  }
};

class SelectOnDevice : public OnDevice {};

TEST_F(SelectOnDevice, cuts_are_those_of_the_processor) {
  Random random(1);
  const auto bounds = lod::normal_cone_bounds(blob().tables, lod::testing::reader_of(blob()));
  const auto instances = transforms(kEmulated ? 12 : 1500, 2);
  for (int round = 0; round < 6; ++round) {
    const Vec3 p = random.point();
    const Vec3 eye{p.x * 20, p.y * 20, p.z * 20};
    const auto planes = round % 2 ? frustum(eye) : std::vector<lod::Plane>{};
    const auto normal_cones = round % 3 ? bounds : std::vector<ClusterBounds>{};
    const Scene scene(blob().tables, normal_cones, planes, instances);
    const lod::View view =
        lod::testing::camera(eye, static_cast<float>(random.log_between(1e-4, 1e-1)));
    const_cast<DeviceArray<lod::View>&>(scene.view).write({view});
    scene.select();
    scene.expect(lod::select_instances(blob().tables, view, {planes, normal_cones}, instances));
  }
}

TEST_F(SelectOnDevice, cuts_are_those_of_the_processor_where_rounding_decides) {
  Random random(3);
  for (const double scale : {1e-20, 1.0, 1e20}) {
    const lod::testing::Extent extent{scale, {}};
    const lod::Tables tables = lod::testing::random_tables(4, 300, extent);
    auto instances = transforms(kEmulated ? 3 : 20, 5);
    for (Transform& t : instances)
      for (const int k : {3, 7, 11}) t.rows[k] *= static_cast<float>(scale);
    Scene scene(tables, {}, {}, instances);
    for (int i = 0; i < (kEmulated ? 2 : 20); ++i) {
      const lod::View view = lod::testing::random_camera(random, tables, extent);
      scene.view.write({view});
      scene.select();
      scene.expect(lod::select_instances(tables, view, {}, instances));
    }
  }
}

class AnySizeOfSelectOnDevice : public SelectOnDevice {};

TEST_F(AnySizeOfSelectOnDevice, cuts) {
  Random random(any_below(1000));
  const lod::testing::Extent extent{1, {}};
  const lod::Tables tables =
      lod::testing::random_tables(1 + any_below(100), any_size(1000), extent);
  const auto instances = transforms(any_size(100), any_below(1000));
  Scene scene(tables, {}, any_below(2) ? frustum({9, 5, 20}) : std::vector<lod::Plane>{},
              instances);
  const lod::View view = lod::testing::random_camera(random, tables, extent);
  scene.view.write({view});
  scene.select();
  scene.expect(lod::select_instances(tables, view, {scene.planes.read(), {}}, instances));
}

TEST_F(SelectOnDevice, a_graph_follows_the_camera) {
  const auto instances = transforms(kEmulated ? 5 : 300, 6);
  Scene scene(blob().tables, {}, {}, instances);
  size_t bytes = 0;
  scene.select(nullptr, bytes, {}, {});
  const DeviceArray<unsigned char> scratch(bytes);
  cudaStream_t stream;
  check(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking), "making a stream");
  check(cudaStreamBeginCapture(stream, cudaStreamCaptureModeThreadLocal), "capturing");
  scene.select(scratch.data(), bytes, {}, {}, stream);
  cudaGraph_t graph;
  check(cudaStreamEndCapture(stream, &graph), "capturing");
  cudaGraphExec_t replay;
  check(cudaGraphInstantiate(&replay, graph, 0), "instantiating a graph");
  for (const float x : {0.0f, 5.0f, 30.0f}) {
    const lod::View view = lod::testing::camera({x, 1, 2}, 1e-3f);
    scene.view.write({view});
    check(cudaGraphLaunch(replay, stream), "replaying");
    check(cudaStreamSynchronize(stream), "waiting");
    scene.expect(lod::select_instances(blob().tables, view, {}, instances));
  }
  cudaGraphExecDestroy(replay);
  cudaGraphDestroy(graph);
  cudaStreamDestroy(stream);
}

TEST_F(SelectOnDevice, what_is_missing_is_asked_for_as_on_the_processor) {
  const lod::Tables& tables = blob().tables;
  const auto instances = transforms(kEmulated ? 4 : 100, 7);
  Random random(8);
  Scene scene(tables, {}, {}, instances);
  const lod::View view = lod::testing::camera({1, 2, 0}, 2e-3f);
  scene.view.write({view});
  for (int round = 0; round < 5; ++round) {
    const uint32_t count = uint32_t(tables.groups.size()) / 3 + 1;
    std::vector<uint32_t> pages;
    std::vector<uint8_t> is_there;
    for (uint32_t g = 0; g < tables.groups.size(); ++g) pages.push_back(g / 3);
    for (uint32_t p = 0; p < count; ++p) is_there.push_back(random.below(10) < 8);
    const Selected expected =
        select_on_processor(tables, view, instances, scene.room, pages, is_there);
    const DeviceArray<uint32_t> of_group(pages), states(tables.groups.size());
    const DeviceArray<uint8_t> resident(is_there);
    const DevicePages there{of_group.data(), resident.data(), states.data(), count};
    const DeviceArray<float> urgencies(count);
    const DeviceArray<uint32_t> requests(count);
    size_t bytes = 0;
    mark_resident_groups(nullptr, bytes, scene.tables(), tables.levels.data(),
                         uint32_t(tables.levels.size()), there);
    const DeviceArray<unsigned char> scratch(bytes);
    mark_resident_groups(scratch.data(), bytes, scene.tables(), tables.levels.data(),
                         uint32_t(tables.levels.size()), there);
    scene.select(there, {urgencies.data(), requests.data()});
    EXPECT_EQ(states.read(), expected.states);
    scene.expect(expected.cuts);
    EXPECT_TRUE(same_bytes(urgencies.read(), expected.urgencies));
    EXPECT_EQ(scene.counts.read()[0].requests, expected.requests.size());
    EXPECT_EQ(requests.read(expected.requests.size()), expected.requests);
  }
}

// What is wrong is said before any device is asked.

TEST(SelectInC, mistakes_are_named) {
  size_t bytes = 0;
  const umbel_cuda_room room{1, 1, 1};
  umbel_cuda_tables tables{};
  tables.group_count = 1u << 20;
  umbel_cuda_scene scene{};
  scene.instance_count = 1u << 20;
  const auto select = [&](const umbel_cuda_tables* t) {
    return umbel_cuda_select(nullptr, &bytes, t, &scene, nullptr, &room, nullptr, nullptr, nullptr);
  };
  EXPECT_EQ(select(nullptr), UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(select(&tables), UMBEL_ERROR_UNSUPPORTED);
  EXPECT_NE(std::string(umbel_last_error()).find("1048576 instances"), std::string::npos);
  lod::Tables turned = blob().tables;
  std::swap(turned.groups[0], turned.groups[1]);
  EXPECT_THROW(check_device_tables(turned), Error);
  check_device_tables(blob().tables);
}

}  // namespace
}  // namespace umbel::cuda
