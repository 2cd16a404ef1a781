#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <thread>

#include "../../../../bench/ply_reader.hpp"
#include "base/math.hpp"
#include "base/parallel.hpp"
#include "bvh/tree_tests.hpp"
#include "data_folder.hpp"
#include "umbel/kdtree.hpp"

namespace umbel::bvh {
namespace {

namespace fs = std::filesystem;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

Config with(Builder builder) {
  Config config;
  config.builder = builder;
  return config;
}

std::string error_of(const std::function<void()>& work, ErrorCode code) {
  try {
    work();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return {};
}

std::vector<Aabb> times(std::vector<Aabb> boxes, float scale) {
  for (Aabb& box : boxes) box = {box.min * scale, box.max * scale};
  return boxes;
}

/// Boxes around the origin, each `factor` times as large as the one before.
std::vector<Aabb> growing(uint32_t count, float smallest, float factor) {
  std::vector<Aabb> boxes(count);
  float size = smallest;
  for (Aabb& box : boxes) {
    box = {{size, 0, 0}, {1.5f * size, size, size}};
    size *= factor;
  }
  return boxes;
}

class BothBuilders : public ::testing::TestWithParam<Builder> {};
INSTANTIATE_TEST_SUITE_P(Build, BothBuilders, ::testing::Values(Builder::kSweep, Builder::kBinned),
                         [](const auto& info) { return std::string(name(info.param)); });

TEST_P(BothBuilders, give_the_same_large_tree_for_any_threads) {
  const Mesh mesh = shapes::blob(7, 3);
  const Bvh2 tree = build(mesh.view(), with(GetParam()), with_thread_count(1));
  check(tree, uint32_t(mesh.triangles.size()));
  expect_same(tree, build(mesh.view(), with(GetParam()), with_thread_count(2)));
  expect_same(tree, build(mesh.view(), with(GetParam()), with_thread_count(8)));
}

TEST_P(BothBuilders, take_any_scale) {
  const std::vector<Aabb> unit = random_boxes(5000, 2);
  const double cost = sah_cost(build(unit, with(GetParam())));
  for (const float scale : {1e-37f, 1e-20f, 1e-15f, 1e-7f, 1e7f, 1e15f, 1e37f}) {
    SCOPED_TRACE(scale);
    const std::vector<Aabb> boxes = times(unit, scale);
    const Bvh2 tree = build(boxes, with(GetParam()));
    check(tree, uint32_t(boxes.size()));
    expect_exact_boxes(tree, boxes);
    EXPECT_LT(sah_cost(tree), 1.02 * cost);
  }
}

TEST_P(BothBuilders, keep_what_floats_can_tell_apart_far_from_the_origin) {
  std::vector<Aabb> boxes;
  for (int i = 0; i < 256; ++i) {
    const auto row = i / 16, column = i % 16;
    const float x = 1e7f + float(column) * 4, y = 3e7f + float(row) * 8;
    boxes.push_back({{x, y, 0}, {x + 1, y + 2, 0}});
  }
  Config config = with(GetParam());
  config.max_leaf_size = 1;
  const Bvh2 tree = build(boxes, config);
  check(tree, 256);
  expect_exact_boxes(tree, boxes);
  for (const Node& node : tree.nodes) {
    if (node.is_leaf()) continue;
    const Aabb a = tree.nodes[node.first].box(), b = tree.nodes[node.first + 1].box();
    const bool apart =
        a.max.x < b.min.x || b.max.x < a.min.x || a.max.y < b.min.y || b.max.y < a.min.y;
    EXPECT_TRUE(apart);
  }
}

TEST_P(BothBuilders, bound_the_depth_of_boxes_that_grow_exponentially) {
  for (const uint32_t depth : {8u, 10u, 96u}) {
    Config config = with(GetParam());
    config.max_depth = depth;
    config.max_leaf_size = 1;
    const std::vector<Aabb> boxes = growing(240, 1e-35f, 2.0f);
    const Bvh2 tree = build(boxes, config);
    check(tree, 240);
    expect_exact_boxes(tree, boxes);
    EXPECT_LE(statistics(tree).max_depth, depth);
  }
  Config config = with(GetParam());
  config.max_depth = 18;
  const std::vector<Aabb> many = growing(200000, 1, 1.0001f);
  EXPECT_LE(statistics(build(many, config)).max_depth, 18u);
}

TEST_P(BothBuilders, take_meshes_of_every_shape) {
  for (const Mesh& mesh : {shapes::grid(40, 30), shapes::fan(5000), shapes::soup(5000, 1),
                           shapes::tetrahedra(500), shapes::terrain(60, 60, 2)}) {
    const Bvh2 tree = build(mesh.view(), with(GetParam()));
    check(tree, uint32_t(mesh.triangles.size()));
    expect_exact_boxes(tree, triangle_boxes(mesh.view()));
  }
}

TEST_P(BothBuilders, stop_when_progress_says_so) {
  const std::vector<Aabb> boxes = random_boxes(50000, 4);
  int calls = 0;
  BuildOptions count;
  float last = 0;
  count.progress = [&](float fraction, std::string_view stage) {
    EXPECT_GE(fraction, last);
    EXPECT_FALSE(stage.empty());
    last = fraction;
    ++calls;
    return true;
  };
  build(boxes, with(GetParam()), count);
  EXPECT_EQ(last, 1.0f);
  for (int stop = 1; stop <= std::min(calls, 4); ++stop) {
    int seen = 0;
    BuildOptions options;
    options.progress = [&](float, std::string_view) { return ++seen < stop; };
    error_of([&] { build(boxes, with(GetParam()), options); }, ErrorCode::kCancelled);
  }
}

TEST(Build, long_stages_ask_again_whether_to_stop) {
  const Mesh mesh = shapes::terrain(600, 600, 1);
  const std::pair<Builder, std::string_view> stages[] = {{Builder::kSweep, "sweeping"},
                                                         {Builder::kSpatial, "splitting in space"},
                                                         {Builder::kKmeans, "joining clusters"},
                                                         {Builder::kPloc, "clustering"}};
  for (const auto& [builder, stage] : stages) {
    SCOPED_TRACE(stage);
    BuildOptions options;
    options.threads = 1;  // with many, a stage may be over before it can ask again
    int seen = 0;
    options.progress = [&, stage = stage](float, std::string_view now) {
      return now != stage || ++seen < 2;
    };
    error_of([&, builder = builder] { build(mesh.view(), with(builder), options); },
             ErrorCode::kCancelled);
    EXPECT_EQ(seen, 2);
  }
}

TEST(Build, loops_of_the_progress_callback_report_nothing) {
  const std::vector<Aabb> boxes = random_boxes(50000, 4);
  int depth = 0, deepest = 0;
  BuildOptions options;
  options.progress = [&](float, std::string_view) {
    deepest = std::max(deepest, ++depth);
    if (depth == 1) {
      std::this_thread::sleep_for(std::chrono::milliseconds(25));
      parallel_for(2, 1, [](size_t) {});
    }
    --depth;
    return true;
  };
  build(boxes, with(Builder::kSweep), options);
  EXPECT_EQ(deepest, 1);
}

TEST(Build, binned_costs_as_little_as_the_full_sweep) {
  std::vector<NamedBoxes> inputs = nasty_boxes();
  for (const uint32_t n : {50u, 400u, 3000u, 40000u}) {
    inputs.push_back({std::to_string(n), random_boxes(n, n)});
    inputs.push_back({std::to_string(n) + " large", random_boxes(n, n, 0.4f)});
  }
  for (const NamedBoxes& input : inputs) {
    SCOPED_TRACE(input.name);
    const Bvh2 sweep = build(input.boxes, with(Builder::kSweep));
    const Bvh2 binned = build(input.boxes, with(Builder::kBinned));
    EXPECT_LE(sah_cost(binned), 1.03 * sah_cost(sweep));
  }
}

TEST(Build, sweep_finds_the_cheapest_first_split) {
  const std::vector<Aabb> boxes = random_boxes(300, 9, 0.3f);
  Config config = with(Builder::kSweep);
  config.max_leaf_size = 1;
  const Bvh2 tree = build(boxes, config);
  const auto area = [](const Aabb& b) { return double(half_area(b)); };
  double best = std::numeric_limits<double>::infinity();
  std::vector<Aabb> sorted = boxes;
  for (int axis = 0; axis < 3; ++axis) {
    const auto key = [&](const Aabb& b) {
      const Vec3 c = b.min + b.max;
      return axis == 0 ? c.x : axis == 1 ? c.y : c.z;
    };
    std::sort(sorted.begin(), sorted.end(),
              [&](const Aabb& a, const Aabb& b) { return key(a) < key(b); });
    for (size_t i = 1; i < sorted.size(); ++i) {
      Aabb left, right;
      for (size_t k = 0; k < sorted.size(); ++k) extend(k < i ? left : right, sorted[k]);
      best = std::min(best, area(left) * double(i) + area(right) * double(sorted.size() - i));
    }
  }
  std::vector<uint32_t> below(tree.nodes.size(), 1);
  for (size_t i = tree.nodes.size(); i-- > 0;) {
    const Node& node = tree.nodes[i];
    if (!node.is_leaf()) below[i] = below[node.first] + below[node.first + 1];
  }
  const double cost = area(tree.nodes[1].box()) * below[1] + area(tree.nodes[2].box()) * below[2];
  EXPECT_NEAR(cost, best, 1e-4 * best);
}

TEST(Build, empty_input_gives_an_empty_tree) {
  for (const Builder builder : builders()) {
    const Bvh2 tree = build(MeshView{}, with(builder));
    EXPECT_TRUE(tree.nodes.empty());
    EXPECT_TRUE(tree.primitives.empty());
  }
  EXPECT_TRUE(build(std::span<const Aabb>{}).nodes.empty());
}

TEST(Build, of_nothing_ends_its_progress_too) {
  const auto last = [](const auto& build_with) {
    float fraction = -1;
    BuildOptions options;
    options.progress = [&](float now, std::string_view) {
      fraction = now;
      return true;
    };
    build_with(options);
    return fraction;
  };
  Mesh mesh = shapes::soup(1, 1);
  for (Vec3& position : mesh.positions) position.x = kNan;
  Config dropping = preset("quality");
  dropping.invalid = InvalidTriangles::kDrop;
  const std::span<const Aabb> no_boxes;
  EXPECT_EQ(last([&](const auto& options) { build(no_boxes, {}, options); }), 1);
  EXPECT_EQ(last([&](const auto& options) { build(MeshView{}, {}, options); }), 1);
  EXPECT_EQ(last([&](const auto& options) { build(mesh.view(), dropping, options); }), 1);
  EXPECT_EQ(last([&](const auto& options) { build_kmeans_kary(no_boxes, {}, options); }), 1);
  EXPECT_EQ(last([&](const auto& options) { build_kmeans_kary(mesh.view(), dropping, options); }),
            1);
}

TEST(Build, names_go_both_ways) {
  for (const Builder builder : builders()) EXPECT_EQ(builder_by_name(name(builder)), builder);
  const std::string sentence =
      error_of([] { builder_by_name("bined"); }, ErrorCode::kInvalidArgument);
  EXPECT_NE(sentence.find("bined"), std::string::npos);
  EXPECT_NE(sentence.find("binned"), std::string::npos);
  for (const char* preset_name : {"fast", "quality", "best"})
    EXPECT_NO_THROW(build(shapes::sphere(1).view(), preset(preset_name)));
  error_of([] { preset("slow"); }, ErrorCode::kInvalidArgument);
}

TEST(Build, refuses_bad_boxes_naming_the_first) {
  const std::vector<Aabb> bad = {{{0, kNan, 0}, {1, 1, 1}},
                                 {{0, 0, 0}, {1, kInfinity, 1}},
                                 {{-kInfinity, 0, 0}, {1, 1, 1}},
                                 {{0, 0, 2}, {1, 1, 1}},
                                 Aabb{}};
  for (const Aabb& box : bad) {
    std::vector<Aabb> boxes = random_boxes(40000, 1);
    boxes[12345] = boxes[39000] = box;
    const std::string sentence = error_of([&] { build(boxes); }, ErrorCode::kInvalidMesh);
    EXPECT_NE(sentence.find("box 12345 "), std::string::npos) << sentence;
  }
}

TEST(Build, refuses_or_drops_invalid_triangles_by_choice) {
  Mesh mesh = shapes::sphere(4);
  mesh.positions[7].y = kNan;
  mesh.positions[100].z = -kInfinity;
  std::vector<uint32_t> valid;
  for (uint32_t i = 0; i < mesh.triangles.size(); ++i)
    if (std::ranges::all_of(mesh.triangles[i],
                            [&](uint32_t v) { return is_finite(mesh.positions[v]); }))
      valid.push_back(i);
  ASSERT_LT(valid.size(), mesh.triangles.size());
  for (const Builder builder : builders()) {
    SCOPED_TRACE(name(builder));
    Config config = with(builder);
    const std::string sentence =
        error_of([&] { build(mesh.view(), config); }, ErrorCode::kInvalidMesh);
    EXPECT_NE(sentence.find("not finite"), std::string::npos) << sentence;
    config.invalid = InvalidTriangles::kDrop;
    std::vector<uint32_t> found = build(mesh.view(), config).primitives;
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    EXPECT_EQ(found, valid);
  }
  mesh.positions.assign(mesh.positions.size(), {kNan, 0, 0});
  Config config;
  config.invalid = InvalidTriangles::kDrop;
  EXPECT_TRUE(build(mesh.view(), config).nodes.empty());
}

TEST(Build, refuses_indices_out_of_range_always) {
  Mesh mesh = shapes::sphere(2);
  mesh.triangles[33][1] = uint32_t(mesh.positions.size());
  Config config;
  config.invalid = InvalidTriangles::kDrop;
  const std::string sentence =
      error_of([&] { build(mesh.view(), config); }, ErrorCode::kInvalidMesh);
  EXPECT_NE(sentence.find("triangle 33"), std::string::npos) << sentence;
}

TEST(Build, vertices_without_triangles_may_be_anything) {
  Mesh mesh = shapes::sphere(2);
  mesh.positions.push_back({kNan, kInfinity, 0});
  EXPECT_NO_THROW(check(build(mesh.view()), uint32_t(mesh.triangles.size())));
}

TEST(Build, refuses_impossible_configurations_naming_field_and_value) {
  const std::vector<Aabb> boxes = random_boxes(1000, 1);
  const auto refuses = [&](const std::string& field, const std::function<void(Config&)>& set) {
    Config config;
    set(config);
    const std::string sentence =
        error_of([&] { build(boxes, config); }, ErrorCode::kInvalidArgument);
    EXPECT_EQ(sentence.rfind(field + " is ", 0), 0u) << sentence;
  };
  refuses("max_leaf_size", [](Config& c) { c.max_leaf_size = 0; });
  refuses("max_leaf_size", [](Config& c) { c.max_leaf_size = 256; });
  refuses("max_depth", [](Config& c) { c.max_depth = 7; });
  refuses("max_depth", [](Config& c) { c.max_depth = 9; });  // 1000 need ten levels
  refuses("bins", [](Config& c) { c.bins = 3; });
  refuses("bins", [](Config& c) { c.bins = 257; });
  refuses("cost.traversal", [](Config& c) { c.cost.traversal = 0; });
  refuses("cost.traversal", [](Config& c) { c.cost.traversal = kNan; });
  refuses("cost.intersection", [](Config& c) { c.cost.intersection = kInfinity; });
  refuses("spatial_budget", [](Config& c) { c.spatial_budget = kNan; });
  refuses("spatial_overlap", [](Config& c) { c.spatial_overlap = 2; });
  refuses("morton_bits", [](Config& c) { c.morton_bits = 31; });
  refuses("kmeans.clusters", [](Config& c) { c.kmeans.clusters = 1; });
  refuses("builder", [](Config& c) { c.builder = static_cast<Builder>(99); });
  refuses("builder", [](Config& c) { c.builder = Builder::kSpatial; });
}

TEST(Build, costs_that_measure_nothing_are_refused_by_passes_and_measures) {
  const Mesh mesh = shapes::blob(3, 1);
  const Bvh2 tree = build(mesh.view());
  const KaryTree kary = build_kmeans_kary(mesh.view());
  Bvh2 changed = tree;
  const auto refuses = [&](const std::string& field, const std::function<void()>& work) {
    const std::string sentence = error_of(work, ErrorCode::kInvalidArgument);
    EXPECT_EQ(sentence.rfind(field + " is ", 0), 0u) << sentence;
  };
  for (const float wrong : {kNan, kInfinity, -1.0f}) {
    const CostModel traversal{wrong, 2}, intersection{3, wrong};
    refuses("cost.traversal", [&] { sah_cost(tree, traversal); });
    refuses("cost.intersection", [&] { sah_cost(kary, intersection); });
    refuses("cost.traversal", [&] { statistics(kary, traversal); });
    refuses("cost.intersection", [&] { statistics(Bvh2{}, intersection); });
    refuses("cost.traversal", [&] { end_point_overlap(tree, mesh.view(), traversal); });
    refuses("cost.intersection", [&] { kdtree::statistics({}, intersection); });
    refuses("cost.traversal", [&] { collapse_leaves(changed, traversal, 8); });
    refuses("cost.intersection", [&] { restructure_treelets(changed, 9, 2, intersection); });
  }
  EXPECT_EQ(changed.nodes, tree.nodes);
  // The leaves alone, and the inner nodes alone.
  EXPECT_NEAR(sah_cost(tree, {0, 2}) + sah_cost(tree, {3, 0}), sah_cost(tree), 1e-9);
}

using umbel::testing::data_folder;

TEST(Build, real_meshes_give_sound_trees_of_the_sweeps_cost) {
  if (!fs::exists(data_folder())) GTEST_SKIP() << "no meshes";
  for (const auto& file : fs::directory_iterator(data_folder())) {
    const std::string path = file.path().string();
    if (file.path().extension() != ".ply" || file.file_size() > 3'000'000) continue;
    if (path.find("f64") != std::string::npos || path.find("out_of_range") != std::string::npos)
      continue;
    SCOPED_TRACE(path);
    const Mesh mesh = bench::read_ply(path);
    const DropResult valid = drop_invalid(mesh.view());
    const auto boxes = triangle_boxes(valid.mesh.view());
    std::array<double, 2> cost{};
    for (const Builder builder : {Builder::kSweep, Builder::kBinned}) {
      const Bvh2 tree = build(valid.mesh.view(), with(builder));
      ASSERT_NO_THROW(check(tree, uint32_t(valid.mesh.triangles.size())));
      expect_exact_boxes(tree, boxes);
      cost[builder == Builder::kBinned] = sah_cost(tree);
    }
    EXPECT_LE(cost[1], 1.03 * cost[0]);
    if (valid.dropped > 0) error_of([&] { build(mesh.view()); }, ErrorCode::kInvalidMesh);
  }
}

}  // namespace
}  // namespace umbel::bvh
