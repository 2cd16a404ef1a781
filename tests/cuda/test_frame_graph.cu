// The whole way of a frame as one graph: the example's own code, beside the processor.
#include "../../examples/cuda/frame_graph.cuh"
#include "builders.hpp"
#include "device_arrays.cuh"
#include "umbel/triangle_bvh.hpp"

namespace umbel::cuda {
namespace {

class FrameGraphOnDevice : public OnDevice {};

TEST_F(FrameGraphOnDevice, every_replay_is_what_the_processor_makes_of_its_positions) {
  Mesh mesh = kEmulated ? shapes::blob(2, 4) : shapes::blob(6, 4);
  std::vector<Vec3> origins, directions;
  for (int i = 0; i < 100; ++i) {
    origins.push_back({float(i % 10) * 0.2f - 0.9f, float(i / 10) * 0.2f - 0.9f, 4});
    directions.push_back({0.01f, 0.02f, -1});
  }
  example::FrameGraph graph(mesh.positions, mesh.triangles, origins, directions, 0.4f);
  for (int frame = 0; frame < 3; ++frame) {
    graph.run();
    check(cudaStreamSynchronize(graph.stream()), "waiting");
    const std::vector<Vec3> moved = graph.positions.read();
    EXPECT_FALSE(same_bytes(moved, mesh.positions));
    mesh.positions = moved;
    FrameClusterer clusters(mesh.triangles, mesh.positions.size(), graph.cluster_config());
    clusters.build(mesh.positions);
    ASSERT_EQ(graph.count.read()[0], clusters.count());
    EXPECT_EQ(graph.items.read(),
              std::vector<uint32_t>(clusters.items().begin(), clusters.items().end()));
    const BuiltBvh expected =
        build_cluster_bvh_on_processor(mesh, clusters, graph.cluster_config(), graph.bvh_config());
    EXPECT_TRUE(same_bytes(graph.info.read(), std::vector<bvh::CompactInfo>{expected.info}));
    EXPECT_TRUE(same_bytes(graph.leaves.read(), expected.triangles));
    EXPECT_TRUE(same_bytes(graph.nodes.read(expected.nodes.size()), expected.nodes));
    const Bvh tree = Bvh::build(mesh.view());
    const std::vector<float> t = graph.t.read();
    const std::vector<uint32_t> primitives = graph.primitives.read();
    size_t hits = 0;
    for (size_t i = 0; i < origins.size(); ++i) {
      Ray ray;
      ray.origin = origins[i];
      ray.direction = directions[i];
      const Hit hit = tree.intersect(ray);
      ASSERT_EQ(t[i], hit.t) << "ray " << i;
      ASSERT_EQ(primitives[i], hit.primitive);
      hits += hit.hit() ? 1 : 0;
    }
    EXPECT_GT(hits, 10u);
  }
}

TEST_F(FrameGraphOnDevice, other_builders_take_clusters_and_the_rest_are_refused) {
  const Mesh mesh = shapes::soup(kEmulated ? 150 : 3000, 4);
  const auto n = uint32_t(mesh.triangles.size());
  FrameClusterConfig of_clusters;
  of_clusters.max_triangles = 20;
  FrameClusterer clusters(mesh.triangles, mesh.positions.size(), of_clusters);
  clusters.build(mesh.positions);
  const auto copy = [](auto span) {
    return std::vector<std::remove_const_t<typename decltype(span)::element_type>>(span.begin(),
                                                                                   span.end());
  };
  const uint32_t most = max_frame_clusters(n, of_clusters);
  auto offsets = copy(clusters.offsets());
  auto boxes = copy(clusters.boxes());
  offsets.resize(most + 1, 0xffffffff);  // what is not there must not be read
  boxes.resize(most, Aabb{{9, 9, 9}, {-9, -9, -9}});
  const DeviceArray<Vec3> positions(mesh.positions);
  const DeviceArray<uint32_t> items(copy(clusters.items())), starts(offsets),
      count(std::vector<uint32_t>{uint32_t(clusters.count())});
  const DeviceArray<Triangle> triangles(copy(clusters.triangles()));
  const DeviceArray<Aabb> around(boxes);
  const DeviceMesh input{positions.data(), sizeof(Vec3), nullptr, nullptr, n};
  const DeviceClusters given{items.data(), reinterpret_cast<uint32_t*>(triangles.data()),
                             starts.data(), around.data(), count.data()};
  for (const char* builder : {"lbvh", "atrbvh", "hploc"}) {
    const DeviceBvhConfig config = device_builder_preset(builder);
    const DeviceArray<bvh::CompactNode> nodes(bvh::compact_node_capacity(n));
    const DeviceArray<bvh::CompactTriangle> leaves(n);
    const DeviceArray<bvh::CompactInfo> info(1);
    with_scratch([&](void* scratch, size_t& bytes) {
      build_cluster_bvh(scratch, bytes, input, of_clusters, given, config,
                        {nodes.data(), leaves.data(), info.data()});
    });
    const BuiltBvh expected = build_cluster_bvh_on_processor(mesh, clusters, of_clusters, config);
    EXPECT_TRUE(same_bytes(info.read(), std::vector<bvh::CompactInfo>{expected.info})) << builder;
    EXPECT_TRUE(same_bytes(leaves.read(), expected.triangles)) << builder;
    EXPECT_TRUE(same_bytes(nodes.read(expected.nodes.size()), expected.nodes)) << builder;
  }
  size_t bytes = 0;
  EXPECT_THROW(build_cluster_bvh(nullptr, bytes, input, of_clusters, given,
                                 device_builder_preset("sweep"), {}),
               Error);
}

}  // namespace
}  // namespace umbel::cuda
