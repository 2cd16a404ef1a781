// What the cells of a uniform structure list.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "query/leaf_store.hpp"
#include "query/triangle_geometry.hpp"

namespace umbel::testing {

/// The list of the leaf is sorted and has every triangle that touches the leaf's cell.
template <typename Nodes>
void expect_lists_what_touches(const Nodes& nodes, const typename Nodes::Link& leaf,
                               const LeafStore& store, const MeshView& mesh) {
  std::vector<uint32_t> listed;
  nodes.visit_runs(leaf, [&](uint32_t run) {
    store.for_each_triangle(run, [&](const LeafTriangle& t) { listed.push_back(t.primitive); });
  });
  ASSERT_TRUE(std::is_sorted(listed.begin(), listed.end()));
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle& c = mesh.triangles[t];
    if (touches_box(leaf.cell, mesh.positions[c[0]], mesh.positions[c[1]], mesh.positions[c[2]])) {
      ASSERT_TRUE(std::binary_search(listed.begin(), listed.end(), t)) << "triangle " << t;
    }
  }
}

}  // namespace umbel::testing
