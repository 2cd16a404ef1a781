#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "bvh/real_meshes.hpp"
#include "kdtree/meshes.hpp"
#include "umbel/kdtree.hpp"

namespace umbel {
namespace {

using namespace testing;
using kdtree::Node;
using kdtree::Tree;

constexpr kdtree::Builder kBuilders[] = {kdtree::Builder::kExact, kdtree::Builder::kBinned};

kdtree::Config config_of(kdtree::Builder builder) {
  kdtree::Config config;
  config.builder = builder;
  return config;
}

float& at(Vec3& v, uint32_t axis) { return (&v.x)[axis]; }

/// leaf(cell, node index) for every leaf.
template <typename Leaf>
void for_each_leaf(const Tree& tree, const Aabb& cell, uint32_t index, const Leaf& leaf) {
  const Node& node = tree.nodes[index];
  if (node.is_leaf()) {
    leaf(cell, node);
    return;
  }
  Aabb below = cell, above = cell;
  at(below.max, node.axis()) = node.at;
  at(above.min, node.axis()) = node.at;
  for_each_leaf(tree, below, index + 1, leaf);
  for_each_leaf(tree, above, node.above(), leaf);
}

Aabb grown(const Aabb& box, float by) {
  return {{box.min.x - by, box.min.y - by, box.min.z - by},
          {box.max.x + by, box.max.y + by, box.max.z + by}};
}

/// Far below what rays allow for, which is 2^-20 of the largest coordinate.
float rounding_of(const Aabb& bounds) {
  return 0x1p-22f *
         std::max({std::abs(bounds.min.x), std::abs(bounds.min.y), std::abs(bounds.min.z),
                   std::abs(bounds.max.x), std::abs(bounds.max.y), std::abs(bounds.max.z)});
}

/// Every triangle is in every leaf that it reaches into, and in no leaf that it does not touch.
void expect_sound(const Tree& tree, const MeshView& mesh) {
  check(tree, static_cast<uint32_t>(mesh.triangles.size()));
  ASSERT_EQ(tree.bounds, bounds(mesh));
  const float rounding = rounding_of(tree.bounds);
  std::vector<uint32_t> uses(mesh.triangles.size());
  for_each_leaf(tree, tree.bounds, 0, [&](const Aabb& cell, const Node& leaf) {
    const auto begin = tree.references.begin() + leaf.first, end = begin + leaf.count();
    for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
      const Vec3 &a = mesh.positions[mesh.triangles[t][0]],
                 &b = mesh.positions[mesh.triangles[t][1]],
                 &c = mesh.positions[mesh.triangles[t][2]];
      if (std::binary_search(begin, end, t)) {
        ++uses[t];
        EXPECT_TRUE(touches_box(grown(cell, rounding), a, b, c)) << "triangle " << t;
      } else {
        EXPECT_FALSE(touches_box(grown(cell, -rounding), a, b, c)) << "triangle " << t;
      }
    }
  });
  for (uint32_t t = 0; t < uses.size(); ++t) EXPECT_GT(uses[t], 0u) << "triangle " << t;
}

TEST(KdTreeBuild, every_leaf_lists_the_triangles_that_reach_into_it) {
  for (const kdtree::Builder builder : kBuilders)
    for (const NamedMesh& named : hard_meshes()) {
      SCOPED_TRACE(std::string(name(builder)) + ", " + named.name);
      expect_sound(kdtree::build(named.mesh.view(), config_of(builder)), named.mesh.view());
    }
}

/// A triangle in a plane that cells share may be in the leaves of either side, but is in one.
TEST(KdTreeBuild, flat_triangles_lie_in_a_leaf_that_touches_their_plane) {
  const Mesh mesh = boxes(4);
  const Tree tree = kdtree::build(mesh.view());
  std::vector<double> area(mesh.triangles.size());
  for_each_leaf(tree, tree.bounds, 0, [&](const Aabb& cell, const Node& leaf) {
    for (uint32_t i = 0; i < leaf.count(); ++i) {
      const uint32_t t = tree.references[leaf.first + i];
      Aabb box = cell;
      const Triangle& corners = mesh.triangles[t];
      for (uint32_t axis = 0; axis < 3; ++axis) {
        const auto c = [&](int k) {
          return at(const_cast<Vec3&>(mesh.positions[corners[k]]), axis);
        };
        at(box.min, axis) = std::max(at(box.min, axis), std::min({c(0), c(1), c(2)}));
        at(box.max, axis) = std::min(at(box.max, axis), std::max({c(0), c(1), c(2)}));
      }
      const double x = box.max.x - box.min.x, y = box.max.y - box.min.y, z = box.max.z - box.min.z;
      area[t] += std::max({x * y, y * z, z * x});
    }
  });
  // The rectangle around a flat triangle is twice as large, and is covered at least where the
  // triangle is.
  for (uint32_t t = 0; t < area.size(); ++t) {
    const Triangle& c = mesh.triangles[t];
    const Vec3d a = to_double(mesh.positions[c[0]]), b = to_double(mesh.positions[c[1]]),
                d = to_double(mesh.positions[c[2]]);
    EXPECT_GE(area[t], 0.5 * length(cross(b - a, d - a)) - 1e-6) << "triangle " << t;
  }
}

bool same_bytes(const Tree& a, const Tree& b) {
  return a.nodes.size() == b.nodes.size() && a.references == b.references && a.bounds == b.bounds &&
         std::memcmp(a.nodes.data(), b.nodes.data(), a.nodes.size() * sizeof(Node)) == 0;
}

TEST(KdTreeBuild, same_bytes_for_any_number_of_threads) {
  const Mesh meshes[] = {shapes::blob(5, 2), boxes(45)};
  for (const kdtree::Builder builder : kBuilders)
    for (const Mesh& mesh : meshes) {
      const Tree one =
          kdtree::build(mesh.view(), config_of(builder), {.progress = {}, .threads = 1});
      for (const uint32_t threads : {2u, 5u, 0u})
        EXPECT_TRUE(same_bytes(one, kdtree::build(mesh.view(), config_of(builder),
                                                  {.progress = {}, .threads = threads})));
    }
}

TEST(KdTreeBuild, clipping_costs_less_than_boxes_and_binning_little_more_than_exact) {
  const Mesh mesh = shapes::blob(4, 1);
  const double exact = statistics(kdtree::build(mesh.view())).sah_cost;
  const double binned =
      statistics(kdtree::build(mesh.view(), config_of(kdtree::Builder::kBinned))).sah_cost;
  EXPECT_LT(exact, binned);
  EXPECT_LT(binned, 1.15 * exact);
}

/// With every triangle four times, at a quarter of the cost, the best plane is the same; but cells
/// of more triangles keep events in order, and those of fewer count boxes.
TEST(KdTreeBuild, many_and_few_triangles_are_split_at_the_same_plane) {
  const NamedMesh meshes[] = {
      {"sphere", shapes::sphere(3)},          {"soup", shapes::soup(2000, 1)},
      {"flat grid", shapes::grid(40, 40)},    {"boxes", boxes(16)},
      {"concentric", concentric(1500)},       {"needles", needles(1500)},
      {"terrain", shapes::terrain(40, 40, 1)}};
  for (const NamedMesh& named : meshes) {
    SCOPED_TRACE(named.name);
    ASSERT_LE(named.mesh.triangles.size(), 4096u);
    ASSERT_GT(4 * named.mesh.triangles.size(), 4096u);
    kdtree::Config config;
    config.max_depth = 1;
    const Tree few = kdtree::build(named.mesh.view(), config);
    Mesh repeated = named.mesh;
    for (int copy = 1; copy < 4; ++copy)
      repeated.triangles.insert(repeated.triangles.end(), named.mesh.triangles.begin(),
                                named.mesh.triangles.end());
    config.cost.intersection /= 4;
    const Tree many = kdtree::build(repeated.view(), config);
    EXPECT_EQ(few.nodes[0].link & 3, many.nodes[0].link & 3);
    if (!few.nodes[0].is_leaf() && !many.nodes[0].is_leaf())
      EXPECT_EQ(few.nodes[0].at, many.nodes[0].at);
  }
}

/// The cheapest first split of all planes there are, tried one by one.
TEST(KdTreeBuild, root_is_split_where_no_plane_is_better) {
  for (const NamedMesh& named : hard_meshes()) {
    SCOPED_TRACE(named.name);
    const MeshView mesh = named.mesh.view();
    kdtree::Config config;
    config.empty_bonus = 0;
    config.max_depth = 1;
    const Tree tree = kdtree::build(mesh, config);
    if (named.name == "on a line") continue;  // which has no area
    const std::vector<Aabb> triangles = triangle_boxes(mesh);
    const double leaf = 2.0 * double(triangles.size());
    double best = leaf;
    for (uint32_t axis = 0; axis < 3; ++axis)
      for (const Aabb& candidate : triangles)
        for (const bool is_end : {false, true})
          for (const bool flat_below : {false, true}) {
            Aabb box = candidate, below = tree.bounds, above = tree.bounds;
            const float plane = is_end ? at(box.max, axis) : at(box.min, axis);
            at(below.max, axis) = at(above.min, axis) = plane;
            uint32_t count_below = 0, count_above = 0;
            for (Aabb t : triangles) {
              const bool is_flat = at(t.min, axis) == plane && at(t.max, axis) == plane;
              count_below += is_flat ? flat_below : at(t.min, axis) < plane;
              count_above += is_flat ? !flat_below : at(t.max, axis) > plane;
            }
            const auto area = [](const Aabb& b) {
              const double x = double(b.max.x) - b.min.x, y = double(b.max.y) - b.min.y,
                           z = double(b.max.z) - b.min.z;
              return x * y + y * z + z * x;
            };
            best = std::min(best, 3 + 2 * (area(below) * count_below + area(above) * count_above) /
                                          area(tree.bounds));
          }
    const kdtree::Statistics s = statistics(tree);
    EXPECT_LE(s.sah_cost, best * (1 + 1e-6));
    if (best < leaf) EXPECT_EQ(s.leaves, 2u);
  }
}

TEST(KdTreeBuild, stays_within_its_bounds_on_what_never_comes_apart) {
  const NamedMesh meshes[] = {{"concentric", concentric(4000)},
                              {"identical", identical(10000)},
                              {"needles", needles(4000)},
                              {"fan", shapes::fan(10000)}};
  for (const NamedMesh& named : meshes)
    for (const kdtree::Builder builder : kBuilders) {
      SCOPED_TRACE(named.name);
      kdtree::Config config = config_of(builder);
      config.max_references = 6;
      const Tree tree = kdtree::build(named.mesh.view(), config);
      const auto count = static_cast<uint32_t>(named.mesh.triangles.size());
      check(tree, count);
      const kdtree::Statistics s = statistics(tree);
      EXPECT_LE(s.references, 6 * uint64_t{count});
      EXPECT_LE(s.max_depth, static_cast<uint32_t>(8 + 1.3 * std::log2(double(count))));
    }
}

TEST(KdTreeBuild, real_meshes_and_nasty_ones) {
  for_real_meshes(kNastyFiles, [](const char*, const Mesh& mesh) {
    const auto count = static_cast<uint32_t>(mesh.triangles.size());
    for (const kdtree::Builder builder : kBuilders) {
      const Tree tree = kdtree::build(mesh.view(), config_of(builder));
      check(tree, count);
      EXPECT_LE(statistics(tree).references, 16 * uint64_t{count});
    }
  });
}

TEST(KdTreeBuild, scale_does_not_change_the_tree) {
  const Mesh mesh = shapes::blob(3, 1);
  const Tree tree = kdtree::build(mesh.view());
  for (const float scale : {0x1p-60f, 0x1p50f}) {
    const Tree scaled = kdtree::build(transformed(mesh, scale).view());
    EXPECT_EQ(scaled.references, tree.references);
    EXPECT_EQ(scaled.nodes.size(), tree.nodes.size());
  }
}

TEST(KdTreeBuild, nothing_gives_an_empty_tree) {
  const Tree tree = kdtree::build(MeshView{});
  EXPECT_TRUE(tree.nodes.empty());
  check(tree, 0);
  EXPECT_EQ(statistics(tree).sah_cost, 0);
}

ErrorCode code_of(const MeshView& mesh, const kdtree::Config& config) {
  try {
    kdtree::build(mesh, config);
  } catch (const Error& error) {
    return error.code();
  }
  ADD_FAILURE() << "nothing was refused";
  return ErrorCode::kIo;
}

TEST(KdTreeBuild, refuses_what_is_wrong) {
  Mesh mesh = shapes::sphere(1);
  const auto refused = [&](auto&& change) {
    kdtree::Config config;
    change(config);
    EXPECT_EQ(code_of(mesh.view(), config), ErrorCode::kInvalidArgument);
  };
  refused([](auto& c) { c.cost.traversal = 0; });
  refused([](auto& c) { c.cost.intersection = NAN; });
  refused([](auto& c) { c.empty_bonus = 1; });
  refused([](auto& c) { c.max_depth = 65; });
  refused([](auto& c) { c.bad_refines = 65; });
  refused([](auto& c) { c.max_references = 0.5f; });
  refused([](auto& c) { c.bins = 3; });
  refused([](auto& c) { c.builder = static_cast<kdtree::Builder>(2); });
  kdtree::Config config;
  config.empty_bonus = 0.95f;
  try {
    kdtree::build(mesh.view(), config);
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "empty_bonus is 0.95, but must be from 0 to 0.9");
  }
  EXPECT_THROW(kdtree::builder_by_name("octree"), Error);
  EXPECT_EQ(kdtree::builder_by_name("binned"), kdtree::Builder::kBinned);

  mesh.positions[3].y = NAN;
  EXPECT_EQ(code_of(mesh.view(), {}), ErrorCode::kInvalidMesh);
  kdtree::Config drop;
  drop.invalid = bvh::InvalidTriangles::kDrop;
  const Tree tree = kdtree::build(mesh.view(), drop);
  for (const uint32_t t : tree.references)
    for (const uint32_t vertex : mesh.triangles[t]) EXPECT_NE(vertex, 3u);
  mesh.triangles[0][1] = 1000;
  EXPECT_EQ(code_of(mesh.view(), drop), ErrorCode::kInvalidMesh);
}

/// Of large cells every split is a chance to stop, and so is the end of every subtree.
TEST(KdTreeBuild, can_be_cancelled_at_any_report) {
  const Mesh mesh = shapes::blob(5, 1);
  for (const kdtree::Builder builder : kBuilders)
    for (const uint32_t threads : {1u, 4u}) {
      std::vector<float> fractions;
      const auto watch = [&](size_t most) {
        fractions.clear();
        return BuildOptions{.progress =
                                [&fractions, most](float fraction, std::string_view) {
                                  fractions.push_back(fraction);
                                  return fractions.size() < most;
                                },
                            .threads = threads};
      };
      const Tree whole = kdtree::build(mesh.view(), config_of(builder), watch(1u << 30));
      EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
      EXPECT_EQ(fractions.back(), 1.0f);
      EXPECT_TRUE(same_bytes(whole, kdtree::build(mesh.view(), config_of(builder))));
      const size_t reports = fractions.size();
      if (threads == 1) EXPECT_GT(reports, 8u);
      for (const size_t most : {size_t{1}, size_t{4}, size_t{6}}) {
        if (most >= reports) continue;
        try {
          kdtree::build(mesh.view(), config_of(builder), watch(most));
          ADD_FAILURE() << "went on after report " << most;
        } catch (const Error& error) {
          EXPECT_EQ(error.code(), ErrorCode::kCancelled);
        }
        EXPECT_EQ(fractions.size(), most);
      }
    }
}

TEST(KdTreeCheck, finds_every_kind_of_fault) {
  const Mesh mesh = shapes::sphere(2);
  const Tree sound = kdtree::build(mesh.view());
  const auto count = static_cast<uint32_t>(mesh.triangles.size());
  const auto broken = [&](auto&& change) {
    Tree tree = sound;
    change(tree);
    EXPECT_THROW(check(tree, count), Error);
  };
  const size_t leaf =
      static_cast<size_t>(std::find_if(sound.nodes.begin(), sound.nodes.end(),
                                       [](const Node& n) { return n.is_leaf() && n.count() > 1; }) -
                          sound.nodes.begin());
  broken([](Tree& t) { t.nodes.pop_back(); });
  broken([](Tree& t) { t.nodes.push_back(Node::leaf(0, 0)); });
  broken([](Tree& t) { t.nodes[0] = Node::inner(0, 0, 1u << 29); });
  broken([](Tree& t) { t.nodes[0].at = 100; });
  broken([](Tree& t) { t.nodes[0].at = NAN; });
  broken([&](Tree& t) { t.references[0] = count; });
  broken([&](Tree& t) {
    std::swap(t.references[t.nodes[leaf].first], t.references[t.nodes[leaf].first + 1]);
  });
  broken([&](Tree& t) { t.nodes[leaf] = Node::leaf(t.nodes[leaf].first, 1u << 29); });
  broken([&](Tree& t) { t.nodes[leaf] = Node::leaf(t.nodes[leaf].first + 1, 1); });
  broken([](Tree& t) { t.bounds.min.x = NAN; });
  broken([](Tree& t) { t.nodes.clear(); });
}

}  // namespace
}  // namespace umbel
