#include <gtest/gtest.h>

#include "cluster/frame/frame_cases.hpp"

namespace umbel {
namespace {

using namespace testing;

TEST(LimitVertices, vertex_lists_name_the_corners) {
  const Mesh mesh = shapes::sphere(4);
  for (const FrameClusterConfig& config : configs()) {
    const FrameClusterer c = clusters_of(mesh, config);
    const FrameVertexLists lists = list_frame_vertices(c);
    ASSERT_EQ(lists.vertex_offsets.size(), c.count() + 1);
    for (size_t k = 0; k < c.count(); ++k) {
      const uint32_t* vertices = lists.vertices.data() + lists.vertex_offsets[k];
      ASSERT_EQ(lists.vertex_offsets[k + 1] - lists.vertex_offsets[k], vertices_of(c, k));
      for (uint32_t i = c.offsets()[k]; i < c.offsets()[k + 1]; ++i)
        for (int corner = 0; corner < 3; ++corner)
          ASSERT_EQ(vertices[lists.corners[i][corner]], c.triangles()[i][corner]);
    }
  }
}

TEST(LimitVertices, lists_need_clusters_of_few_vertices) {
  const Mesh mesh = soup(300, 1);  // 128 triangles with 384 vertices
  const FrameClusterer c = clusters_of(mesh, {});
  EXPECT_THROW(list_frame_vertices(c), Error);
}

}  // namespace
}  // namespace umbel
