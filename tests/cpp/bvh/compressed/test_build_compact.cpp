// The functions of cuda_bvh.hpp on the processor: sound trees for any input, beside the trees of
// the processor's own builders.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <map>

#include "base/thread_teams.hpp"
#include "bvh/compressed/compact_oracle.hpp"
#include "bvh/tree_tests.hpp"
#include "umbel/bvh_presets.hpp"

// The processor's form of this, as in tests/on_processor.
#include "cuda/bvh.cu"

namespace umbel::cuda {
namespace {

using bvh::CompactOracle;
using bvh::CompactTree;
using bvh::holds;

const char* const kBuilders[] = {"lbvh",  "hlbvh",     "atrbvh", "ploc",
                                 "hploc", "kmeans-q1", "kmeans", "sweep"};

/// A triangle for each box, whose box it is.
Mesh mesh_of(const std::vector<Aabb>& boxes) {
  Mesh mesh;
  for (const Aabb& b : boxes) {
    const auto first = uint32_t(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), {b.min, {b.max.x, b.min.y, b.max.z}, b.max});
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

DeviceMesh view_of(const Mesh& mesh) {
  return {mesh.positions.data(), sizeof(Vec3),
          reinterpret_cast<const uint32_t*>(mesh.triangles.data()), nullptr,
          uint32_t(mesh.triangles.size())};
}

std::array<uint32_t, 3> bits_of(const Vec3& v) { return std::bit_cast<std::array<uint32_t, 3>>(v); }

CompactTree build(const Mesh& mesh, const DeviceBvhConfig& config) {
  CompactTree tree(device_references(uint32_t(mesh.triangles.size()), config));
  const DeviceBvh out{tree.nodes.data(), tree.triangles.data(), &tree.info};
  size_t bytes = 0;
  build_bvh(nullptr, bytes, view_of(mesh), config, out);
  std::vector<char> scratch(bytes);
  build_bvh(scratch.data(), bytes, view_of(mesh), config, out);
  return tree;
}

void expect_sound(const CompactTree& tree, const Mesh& mesh, bool repeats = false) {
  CompactOracle oracle(tree, repeats);
  oracle.check();
  std::vector<uint32_t> seen(mesh.triangles.size());
  for (const bvh::CompactTriangle& t : tree.triangles) {
    ++seen[t.primitive];
    const Triangle& corners = mesh.triangles[t.primitive];
    const Vec3* found[3] = {&t.p0, &t.p1, &t.p2};
    for (int k = 0; k < 3; ++k)  // as bits, because NaN is unlike itself
      ASSERT_EQ(bits_of(*found[k]), bits_of(mesh.positions[corners[k]]));
  }
  for (const uint32_t times : seen) ASSERT_TRUE(repeats ? times > 0 : times == 1);
}

class BuildBvh : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Builders, BuildBvh, ::testing::ValuesIn(kBuilders), [](const auto& info) {
  std::string name = info.param;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

TEST_P(BuildBvh, every_triangle_is_in_one_leaf_and_in_all_boxes_above) {
  std::vector<bvh::NamedBoxes> inputs = bvh::nasty_boxes();
  inputs.push_back({"random", bvh::random_boxes(20000, 1)});
  for (const bvh::NamedBoxes& input : inputs) {
    SCOPED_TRACE(input.name);
    const Mesh mesh = mesh_of(input.boxes);
    expect_sound(build(mesh, device_builder_preset(GetParam())), mesh);
  }
}

TEST_P(BuildBvh, boxes_are_those_that_a_refit_finds) {
  std::vector<bvh::NamedBoxes> inputs = bvh::nasty_boxes();
  inputs.push_back({"random", bvh::random_boxes(20000, 1)});
  for (const bvh::NamedBoxes& input : inputs) {
    SCOPED_TRACE(input.name);
    const Mesh mesh = mesh_of(input.boxes);
    const DeviceBvhConfig config = device_builder_preset(GetParam());
    const CompactTree built = build(mesh, config);
    CompactTree refitted = built;
    const DeviceBvh out{refitted.nodes.data(), refitted.triangles.data(), &refitted.info};
    size_t bytes = 0;
    refit_bvh(nullptr, bytes, view_of(mesh), config, out);
    std::vector<char> scratch(bytes);
    refit_bvh(scratch.data(), bytes, view_of(mesh), config, out);
    EXPECT_EQ(bits_of(built.info.bounds.min), bits_of(refitted.info.bounds.min));
    EXPECT_EQ(bits_of(built.info.bounds.max), bits_of(refitted.info.bounds.max));
    EXPECT_EQ(std::memcmp(built.nodes.data(), refitted.nodes.data(),
                          built.info.nodes * sizeof(bvh::CompactNode)),
              0);
  }
}

TEST_P(BuildBvh, no_triangles_give_no_nodes) {
  const CompactTree tree = build(Mesh{}, device_builder_preset(GetParam()));
  EXPECT_EQ(tree.info.nodes, 0u);
  EXPECT_EQ(tree.info.triangles, 0u);
  EXPECT_TRUE(is_empty(tree.info.bounds));
}

TEST_P(BuildBvh, triangles_that_are_not_finite_are_kept_out_of_boxes) {
  Mesh mesh = shapes::soup(3000, 4);
  Aabb bounds;
  for (const Vec3& p : mesh.positions) extend(bounds, p);
  const float inf = std::numeric_limits<float>::infinity();
  for (uint32_t i = 0; i < 3000; i += 7)
    mesh.positions[mesh.triangles[i][i % 3]].y = i % 2 == 0 ? std::nanf("") : inf;
  const CompactTree tree = build(mesh, device_builder_preset(GetParam()));
  expect_sound(tree, mesh);
  EXPECT_TRUE(holds(bounds, tree.info.bounds.min) && holds(bounds, tree.info.bounds.max));
  for (Vec3& p : mesh.positions) p = {inf, inf, -inf};
  const CompactTree nothing = build(mesh, device_builder_preset(GetParam()));
  expect_sound(nothing, mesh);
  EXPECT_TRUE(is_empty(nothing.info.bounds));
}

TEST_P(BuildBvh, scales_do_not_matter) {
  const Mesh mesh = mesh_of(bvh::random_boxes(3000, 9));
  const float cost = build(mesh, device_builder_preset(GetParam())).info.sah_cost;
  for (const float scale : {0x1p-120f, 0x1p-60f, 0x1p60f, 0x1p127f}) {
    SCOPED_TRACE(scale);
    Mesh scaled = mesh;
    for (Vec3& p : scaled.positions) p = p * scale;
    const CompactTree tree = build(scaled, device_builder_preset(GetParam()));
    expect_sound(tree, scaled);
    EXPECT_NEAR(tree.info.sah_cost, cost, 1e-3f * cost);
  }
}

TEST_P(BuildBvh, leaves_are_within_their_size) {
  DeviceBvhConfig config = device_builder_preset(GetParam());
  const Mesh mesh = shapes::soup(5000, 2);
  for (const uint32_t size : {1u, 3u, 8u}) {
    config.max_leaf_size = size;
    config.cost = {10, 1};  // leaves are cheap
    const CompactTree tree = build(mesh, config);
    CompactOracle oracle(tree, false);
    oracle.check();
    EXPECT_EQ(oracle.largest_leaf(), size);
  }
}

/// The processor's builder of the same name, as it was published.
bvh::Config same_on_processor(const std::string& name) {
  bvh::Config config = bvh::builder_preset(name == "hploc" ? "ploc" : name);
  config.ploc_sweep = 0;
  config.atrbvh_bits = 0;
  return config;
}

std::map<std::string, Mesh> scenes() {
  return {{"terrain", shapes::terrain(90, 90, 3)},
          {"blob", shapes::blob(4, 1)},
          {"soup", shapes::soup(12000, 6)}};
}

TEST_P(BuildBvh, costs_what_the_tree_of_the_processor_costs) {
  for (const auto& [name, mesh] : scenes()) {
    SCOPED_TRACE(name);
    const double expected = bvh::sah_cost(bvh::build(mesh.view(), same_on_processor(GetParam())));
    const double cost = build(mesh, device_builder_preset(GetParam())).info.sah_cost;
    // Hierarchical clustering does not find the very clusters that the other does.
    const bool differs = GetParam() == std::string("hploc");
    EXPECT_NEAR(cost / expected, 1, differs ? 0.05 : 0.001);
  }
}

TEST_P(BuildBvh, the_same_for_any_number_of_threads) {
  const Mesh mesh = shapes::terrain(70, 90, 5);
  const DeviceBvhConfig config = device_builder_preset(GetParam());
  const CompactTree tree = build(mesh, config);
  for (const uint32_t threads : {1u, 2u, 7u})
    with_threads(threads, [&] { bvh::expect_same(build(mesh, config), tree); });
}

TEST_P(BuildBvh, teams_of_threads_give_the_same_bytes) {
  std::vector<bvh::NamedBoxes> inputs = bvh::nasty_boxes();
  inputs.push_back({"random", bvh::random_boxes(1500, 1)});
  const DeviceBvhConfig config = device_builder_preset(GetParam());
  for (const bvh::NamedBoxes& input : inputs) {
    SCOPED_TRACE(input.name);
    std::vector<Aabb> boxes = input.boxes;
    if (boxes.size() > 300 && input.name != "random") boxes.resize(300);
    const Mesh mesh = mesh_of(boxes);
    CompactTree tree(uint32_t(boxes.size()));
    ThreadTeamExec exec;
    build_compact(exec, corners_of(view_of(mesh)), nullptr, uint32_t(boxes.size()), config,
                  tree.view(), NoStages{});
    bvh::expect_same(tree, build(mesh, config));
  }
}

TEST_P(BuildBvh, refitted_trees_hold_the_new_triangles) {
  Mesh mesh = shapes::terrain(50, 60, 5);
  const DeviceBvhConfig config = device_builder_preset(GetParam());
  CompactTree tree = build(mesh, config);
  const CompactTree before = tree;
  const DeviceBvh out{tree.nodes.data(), tree.triangles.data(), &tree.info};
  const auto refit = [&] {
    size_t bytes = 0;
    refit_bvh(nullptr, bytes, view_of(mesh), config, out);
    std::vector<char> scratch(bytes);
    refit_bvh(scratch.data(), bytes, view_of(mesh), config, out);
  };
  refit();
  bvh::expect_same(tree, before);  // nothing has moved
  for (Vec3& p : mesh.positions) p = {p.x * std::cos(3 * p.y) - 5, p.y + 2 * p.x * p.x, p.z - p.x};
  refit();
  expect_sound(tree, mesh);
}

/// Binary trees as merges.
bvh::Bvh2 merged(const std::vector<Aabb>& boxes, const DeviceBvhConfig& config) {
  BigVector<bvh::Merge> merges(boxes.size());
  bvh::Subtree root{};
  CpuExec exec;
  build_merges(exec, config, boxes.data(), uint32_t(boxes.size()), {}, merges.data(), &root,
               NoStages{});
  return bvh::emit(merges, root, boxes);
}

TEST(BuildBvhTree, of_lbvh_is_that_of_the_processor_byte_for_byte) {
  bvh::Config config;
  config.builder = bvh::Builder::kLbvh;
  config.max_leaf_size = 1;
  std::vector<bvh::NamedBoxes> inputs = bvh::nasty_boxes();
  inputs.push_back({"random", bvh::random_boxes(40000, 1)});
  for (const bvh::NamedBoxes& input : inputs) {
    SCOPED_TRACE(input.name);
    bvh::Bvh2 tree = merged(input.boxes, device_builder_preset("lbvh"));
    bvh::Bvh2 expected = bvh::build(input.boxes, config);
    // Both list their nodes in an order of their own.
    bvh::reorder(tree);
    bvh::reorder(expected);
    bvh::expect_same(tree, expected);
  }
}

TEST(BuildBvhTree, of_ploc_and_sweep_are_those_of_the_processor) {
  const std::vector<Aabb> boxes = bvh::random_boxes(5000, 3);
  for (const char* name : {"ploc", "sweep"}) {
    SCOPED_TRACE(name);
    bvh::Config config = same_on_processor(name);
    config.max_leaf_size = 1;
    bvh::Bvh2 tree = merged(boxes, device_builder_preset(name));
    bvh::Bvh2 expected = bvh::build(boxes, config);
    bvh::reorder(tree);
    bvh::reorder(expected);
    bvh::expect_same(tree, expected);
  }
}

/// Long triangles that cross each other.
Mesh needles(uint32_t count) {
  Mesh mesh;
  for (const Aabb& b : bvh::random_boxes(count, 11)) {
    const auto first = uint32_t(mesh.positions.size());
    const Vec3 p = b.min, far{p.y - p.z, p.z - p.x, p.x - p.y};
    mesh.positions.insert(mesh.positions.end(), {p, p + 0.7f * far, {p.x + 0.01f, p.y, p.z}});
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

TEST(Presplit, gives_exactly_as_many_parts_as_were_asked_for) {
  Mesh flat = shapes::grid(30, 20);  // nothing to gain
  for (const Mesh& mesh :
       {needles(3000), flat, mesh_of(bvh::nasty_boxes()[5].boxes), mesh_of({{}})})
    for (const char* name : kBuilders)
      for (const float share : {0.1f, 1.0f}) {
        SCOPED_TRACE(name);
        DeviceBvhConfig config = device_builder_preset(name);
        config.presplit = share;
        const CompactTree tree = build(mesh, config);
        EXPECT_EQ(tree.triangles.size(),
                  mesh.triangles.size() + uint32_t(double(mesh.triangles.size()) * double(share)));
        expect_sound(tree, mesh, true);
      }
}

TEST(Presplit, parts_together_hold_their_triangle) {
  const Mesh mesh = needles(2000);
  const MeshCorners corners = corners_of(view_of(mesh));
  const uint32_t n = 2000, extra = 1500;
  std::vector<Aabb> parts(n + extra);
  std::vector<uint32_t> triangles(n + extra);
  CpuExec exec;
  bvh::presplit(exec, corners, n, extra, parts.data(), triangles.data());
  EXPECT_TRUE(std::is_sorted(triangles.begin(), triangles.end()));
  uint32_t most = 0;
  double whole = 0, of_parts = 0;
  for (uint32_t i = 0; i < n; ++i) {
    const auto begin = std::lower_bound(triangles.begin(), triangles.end(), i) - triangles.begin();
    const auto end = std::upper_bound(triangles.begin(), triangles.end(), i) - triangles.begin();
    ASSERT_LT(begin, end);
    most = std::max(most, uint32_t(end - begin));
    const TriangleCorners c = corners(i);
    whole += double(half_area(bvh::box_of_finite(c.a, c.b, c.c)));
    for (auto k = begin; k < end; ++k) of_parts += double(half_area(parts[k]));
    for (int step = 0; step < 400; ++step) {
      const int column = step % 20, row = step / 20;
      const float u = float(column) / 19, v = float(row) / 19 * (1 - u);
      // Points of the triangle, up to rounding.
      const Vec3 p = c.a + u * (c.b - c.a) + v * (c.c - c.a);
      const bool is_held = std::any_of(parts.begin() + begin, parts.begin() + end, [&](Aabb box) {
        const Vec3 slack{1e-6f, 1e-6f, 1e-6f};
        box = {box.min - slack, box.max + slack};
        return holds(box, p);
      });
      ASSERT_TRUE(is_held) << i;
    }
  }
  EXPECT_GT(most, 2u);
  EXPECT_LT(of_parts, 0.7 * whole);
}

TEST(Presplit, cuts_triangles_of_any_size) {
  const Mesh mesh = needles(500);
  for (const float scale : {0x1p-140f, 0x1p-80f, 0x1p62f, 0x1p100f, 0x1p125f}) {
    SCOPED_TRACE(scale);
    Mesh scaled = mesh;
    for (Vec3& p : scaled.positions) p = p * scale;
    DeviceBvhConfig config = device_builder_preset("hploc");
    config.presplit = 1;
    const CompactTree tree = build(scaled, config);
    EXPECT_EQ(tree.triangles.size(), 2 * mesh.triangles.size());
    expect_sound(tree, scaled, true);
  }
}

TEST(Presplit, lowers_the_cost_of_long_triangles) {
  const Mesh mesh = needles(4000);
  DeviceBvhConfig config = device_builder_preset("hploc");
  const float whole = build(mesh, config).info.sah_cost;
  config.presplit = 1;
  EXPECT_LT(build(mesh, config).info.sah_cost, 0.9f * whole);
}

/// A list: every merge joins one more item.
TEST(CompactTreeLayout, trees_that_are_too_deep_are_laid_out_evenly) {
  for (const uint32_t n : {300u, 5000u, 12000u}) {
    const std::vector<Aabb> boxes = bvh::random_boxes(n, 2);
    std::vector<bvh::Merge> merges(n - 1);
    const bool from_left = n != 5000;
    bvh::Subtree last = bvh::Subtree::of_primitive(0);
    Aabb all = boxes[0];
    for (uint32_t i = 1; i < n; ++i) {
      extend(all, boxes[i]);
      const bvh::Subtree one = bvh::Subtree::of_primitive(i);
      merges[i - 1] = {all, from_left ? last : one, from_left ? one : last, i + 1};
      last = bvh::Subtree::of_merge(i - 1);
    }
    const Mesh mesh = mesh_of(boxes);
    CompactTree tree(n);
    CpuExec exec;
    std::vector<uint32_t> order(n);
    tree.info = {};
    tree.info.triangles = n;
    const bvh::BinaryTree binary{merges.data(), n - 1, &last, boxes.data(), n};
    const bvh::CompactSumArrays<CpuExec> arrays(exec, n - 1);
    const uint32_t has_area = 1;
    const bvh::CompactSums sums = arrays.sums(&has_area, {}, 8);
    bvh::sum_up(exec, binary, sums);
    uint32_t unfitted = 0;
    bvh::lay_out_compact(exec, binary, sums, tree.nodes.data(), &tree.info, order.data(),
                         &unfitted);
    EXPECT_EQ(unfitted, tree.info.nodes);
    for (uint32_t i = 0; i < n; ++i) {
      const Triangle& t = mesh.triangles[order[i]];
      tree.triangles[i] = {mesh.positions[t[0]], order[i], mesh.positions[t[1]], 0,
                           mesh.positions[t[2]], 0};
    }
    bvh::refit_compact(exec, tree.view(), &unfitted, n, nullptr);
    expect_sound(tree, mesh);
    // The list's order is kept, so neighbours stay neighbours.
    if (n == 12000)
      EXPECT_GT(std::count_if(order.begin() + 1, order.end(),
                              [&](const uint32_t& i) { return i == *(&i - 1) + 1; }),
                n * 9 / 10);
  }
}

TEST(EvenSubtree, has_as_many_nodes_as_are_laid_out) {
  EXPECT_EQ(bvh::EvenSubtree::nodes(8), 0u);
  EXPECT_EQ(bvh::EvenSubtree::nodes(9), 1u);
  EXPECT_EQ(bvh::EvenSubtree::nodes(64), 1u);
  EXPECT_EQ(bvh::EvenSubtree::nodes(72), 2u);
  EXPECT_EQ(bvh::EvenSubtree::nodes(512), 9u);
  for (uint32_t n = 147; n < 100000; n = n * 3 / 2 + 1)
    EXPECT_LT(bvh::EvenSubtree::nodes(n), n / 10);
}

std::string message_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "none";
}

TEST(BuildBvhMistakes, are_named) {
  const auto with = [](const std::function<void(DeviceBvhConfig&)>& change) {
    return message_of([&] {
      DeviceBvhConfig config;
      change(config);
      device_references(10, config);
    });
  };
  EXPECT_EQ(with([](auto& c) { c.max_leaf_size = 9; }),
            "max_leaf_size is 9, but must be from 1 to 8");
  EXPECT_EQ(with([](auto& c) { c.presplit = 1.5f; }), "presplit is 1.5, but must be from 0 to 1");
  EXPECT_EQ(with([](auto& c) { c.presplit = std::nanf(""); }),
            "presplit is nan, but must be from 0 to 1");
  EXPECT_EQ(with([](auto& c) { c.builder = DeviceBuilder(77); }), "builder 77 does not exist");
  EXPECT_EQ(with([](auto& c) { c.treelet_size = 2; }),
            "treelet_size is 2, but must be from 3 to 15");
  EXPECT_EQ(with([](auto& c) { c.cost.traversal = 0; }),
            "cost.traversal is 0, but must be positive and finite");
  EXPECT_EQ(message_of([] { device_references(0x80000000u, {}); }),
            "2147483648 triangles and parts of triangles are more than the 268435448 that a tree "
            "can hold");
  EXPECT_EQ(message_of([] { device_builder_preset("sah"); }),
            "there is no builder \"sah\" on devices; the builders are lbvh, hlbvh, atrbvh, ploc, "
            "hploc, kmeans, kmeans-q1 to kmeans-q5, sweep");
  EXPECT_EQ(message_of([] { device_builder_preset("ploc-q1"); }).substr(0, 31),
            "there is no builder \"ploc-q1\" o");
  EXPECT_EQ(device_builder_preset("kmeans-q5").kmeans.clusters, 64u);
}

}  // namespace
}  // namespace umbel::cuda
