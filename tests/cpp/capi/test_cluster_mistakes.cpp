// Every mistake gives its code and a sentence, and leaves the arrays as they were.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <utility>

#include "capi/cluster_call.hpp"

namespace umbel {
namespace {

using namespace cluster_call;

/// Breaks a good call, and expects the result, the sentence and untouched arrays.
void expect_build_failure(const std::function<void(GoodCall&)>& spoil, umbel_result expected,
                          const char* named) {
  GoodCall call;
  spoil(call);
  expect_failure(call.build(), expected, named);
  for (const uint32_t item : call.items) ASSERT_EQ(item, kNone) << named;
  for (const umbel_range& range : call.ranges) ASSERT_EQ(range.offset, kNone) << named;
}

TEST(CapiMistakes, good_call_is_good) {
  GoodCall call;
  EXPECT_EQ(call.build(), UMBEL_OK) << umbel_last_error();
}

// Over 60 lines: a list of mistakes.
TEST(CapiMistakes, invalid_arguments_are_named) {
  const std::pair<std::function<void(GoodCall&)>, const char*> cases[] = {
      {[](GoodCall& c) { c.input.boxes = nullptr; }, "input->boxes"},
      {[](GoodCall& c) { c.input.item_count = size_t(1) << 32; }, "item_count"},
      {[](GoodCall& c) { c.input.position_count = size_t(1) << 32; }, "position_count"},
      {[](GoodCall& c) { c.input.segment_count = size_t(1) << 32; }, "segment_count"},
      {[](GoodCall& c) { c.input.connection_count = size_t(1) << 32; }, "connection_count"},
      {[](GoodCall& c) { c.input.vertices_per_item = 0; }, "vertices_per_item"},
      {[](GoodCall& c) { c.input.segment_count = 1; }, "input->segments"},
      {[](GoodCall& c) { c.input.connection_count = 1; }, "connection_ranges"},
      {[](GoodCall& c) {
         static const std::vector<umbel_range> ranges(c.boxes.size(), umbel_range{0, 0});
         c.input.connection_ranges = ranges.data();
         c.input.connection_count = 7;
       },
       "connection_targets"},
      {[](GoodCall& c) { c.input.shared_vertex_weight = -1; }, "shared_vertex_weight"},
      {[](GoodCall& c) { c.input.shared_vertex_weight = kNan; }, "shared_vertex_weight"},
      {[](GoodCall& c) {
         static const umbel_range segment{5, 0xfffffff0u};
         c.input.segments = &segment;
         c.input.segment_count = 1;
       },
       "segments[0]"},
      {[](GoodCall& c) {
         static const umbel_range segments[2] = {{5, 10}, {14, 10}};
         c.input.segments = segments;
         c.input.segment_count = 2;
       },
       "segments overlap"},
      {[](GoodCall& c) {
         c.input.positions = reinterpret_cast<const umbel_vec3*>(c.mesh.positions.data());
         c.input.position_count = c.mesh.positions.size();
       },
       "both boxes and positions"},
      {[](GoodCall& c) {
         set_mesh(c, c.mesh);
         c.input.boxes = nullptr;
         c.input.vertices_per_item = 4;
       },
       "vertices_per_item must be 3"},
      {[](GoodCall& c) {
         set_mesh(c, c.mesh);
         c.input.boxes = nullptr;
         c.input.item_vertices = nullptr;
       },
       "item_vertices is NULL"},
      {[](GoodCall& c) { c.config.min_items = 0; }, "min_items"},
      {[](GoodCall& c) { c.config.max_items = 0; }, "max_items"},
      {[](GoodCall& c) { c.config.min_items = 200; }, "min_items"},
      {[](GoodCall& c) { c.config.max_vertices = 2; }, "max_vertices"},
      {[](GoodCall& c) { c.config.underfill_cost = kNan; }, "underfill_cost"},
      {[](GoodCall& c) { c.config.overlap_cost = 1.5f; }, "overlap_cost"},
      {[](GoodCall& c) { c.config.vertex_underfill_cost = -1; }, "vertex_underfill_cost"},
      {[](GoodCall& c) { c.input.struct_size = 0; }, "input->struct_size"},
      {[](GoodCall& c) { c.config.struct_size = 0xcdcdcdcd; }, "config->struct_size"},
      {[](GoodCall& c) { c.options.struct_size = 4; }, "options->struct_size"},
      {[](GoodCall& c) { c.output.struct_size = 8; }, "output->struct_size"},
      {[](GoodCall& c) { c.output.ranges = nullptr; }, "output->ranges is NULL"},
      {[](GoodCall& c) { c.output.items = nullptr; }, "output->items is NULL"},
      {[](GoodCall& c) { c.output.segments = nullptr; }, "output->segments is NULL"},
  };
  for (const auto& [spoil, named] : cases)
    expect_build_failure(spoil, UMBEL_ERROR_INVALID_ARGUMENT, named);
}

TEST(CapiMistakes, invalid_geometry_is_named) {
  const auto invalid = UMBEL_ERROR_INVALID_MESH;
  expect_build_failure([](GoodCall& c) { c.boxes[17].max.y = kNan; }, invalid, "item 17");
  expect_build_failure([](GoodCall& c) { std::swap(c.boxes[3].min, c.boxes[3].max); }, invalid,
                       "item 3");
  for (const bool segmented : {false, true}) {
    static const umbel_range segment{0, 10};
    const auto by_positions = [=](GoodCall& c) {
      set_mesh(c, c.mesh);
      c.input.boxes = nullptr;
      if (segmented) {
        c.input.segments = &segment;
        c.input.segment_count = 1;
      }
    };
    expect_build_failure(
        [&](GoodCall& c) {
          by_positions(c);
          c.mesh.triangles[9][1] = 1u << 30;
        },
        invalid, "triangle 9");
    expect_build_failure(
        [&](GoodCall& c) {
          by_positions(c);
          c.mesh.positions[c.mesh.triangles[0][0]].z = kNan;
        },
        invalid, "triangle 0");
  }
}

TEST(CapiMistakes, no_room_is_asked_for_segments_that_hold_more_than_there_is) {
  GoodCall call;
  const std::vector<umbel_range> segments(3, umbel_range{0, uint32_t(call.boxes.size())});
  call.input.segments = segments.data();
  call.input.segment_count = segments.size();
  umbel_cluster_capacity needed;
  umbel_cluster_capacity_init(&needed);
  EXPECT_EQ(umbel_cluster_requirements(&call.input, &call.config, &needed),
            UMBEL_ERROR_INVALID_ARGUMENT);
  EXPECT_NE(std::string(umbel_last_error()).find("segments overlap"), std::string::npos);
}

TEST(CapiMistakes, null_structs_are_named) {
  GoodCall c;
  const auto invalid = UMBEL_ERROR_INVALID_ARGUMENT;
  expect_failure(umbel_cluster_build(nullptr, &c.config, &c.options, &c.output), invalid,
                 "input is NULL");
  expect_failure(umbel_cluster_build(&c.input, &c.config, &c.options, nullptr), invalid,
                 "output is NULL");
  expect_failure(umbel_cluster_requirements(nullptr, &c.config, &c.capacity), invalid,
                 "input is NULL");
  expect_failure(umbel_cluster_requirements(&c.input, &c.config, nullptr), invalid,
                 "capacity is NULL");
  expect_failure(umbel_cluster_get_metrics(nullptr, &c.output, 128, &c.metrics), invalid,
                 "input is NULL");
  expect_failure(umbel_cluster_get_metrics(&c.input, nullptr, 128, &c.metrics), invalid,
                 "clusters is NULL");
  expect_failure(umbel_cluster_get_metrics(&c.input, &c.output, 128, nullptr), invalid,
                 "metrics is NULL");
  expect_failure(umbel_cluster_config_preset(nullptr, "fast", 128), invalid, "config is NULL");
  expect_failure(umbel_cluster_config_preset(&c.config, nullptr, 128), invalid, "name is NULL");
  umbel_cluster_config_init_sized(nullptr, sizeof(umbel_cluster_config));
}

TEST(CapiMistakes, presets_that_are_none_leave_the_config) {
  Call call;
  call.config.max_items = 77;
  const auto invalid = UMBEL_ERROR_INVALID_ARGUMENT;
  expect_failure(umbel_cluster_config_preset(&call.config, "best", 128), invalid, "best");
  expect_failure(umbel_cluster_config_preset(&call.config, "fast", 0), invalid, "max_items");
  EXPECT_EQ(call.config.max_items, 77u);
}

TEST(CapiMistakes, small_arrays_are_named_with_what_they_need) {
  GoodCall call;
  ASSERT_EQ(call.require(), UMBEL_OK);
  ASSERT_EQ(call.build(), UMBEL_OK);
  const size_t count = call.boxes.size(), made = call.output.range_count;

  call.reserve(made, count - 1, 1);
  expect_failure(call.build(), UMBEL_ERROR_CAPACITY, "item_capacity");
  EXPECT_EQ(call.output.item_count, count);
  EXPECT_EQ(call.output.range_count, call.capacity.ranges);

  call.reserve(made - 1, count, 1);
  expect_failure(call.build(), UMBEL_ERROR_CAPACITY, "range_capacity");
  EXPECT_EQ(call.output.range_count, made);
  EXPECT_EQ(call.items[0], kNone);
  EXPECT_EQ(call.ranges[0].offset, kNone);

  call.reserve(0, 0, 0);
  call.output.ranges = nullptr;
  call.output.items = nullptr;
  expect_failure(call.build(), UMBEL_ERROR_CAPACITY, "item_capacity");

  const umbel_range segments[2] = {{0, 10}, {10, 10}};
  call.input.segments = segments;
  call.input.segment_count = 2;
  call.reserve(made, count, 1);
  expect_failure(call.build(), UMBEL_ERROR_CAPACITY, "segment_capacity");
  EXPECT_EQ(call.output.segment_count, 2u);

  call.input.segment_count = 0;
  call.reserve(made, count, 1);
  EXPECT_EQ(call.build(), UMBEL_OK) << "exactly enough is enough";
}

TEST(CapiMistakes, clusters_that_are_none_are_named) {
  GoodCall c;
  ASSERT_EQ(c.build(), UMBEL_OK);
  const auto measure = [&] {
    return umbel_cluster_get_metrics(&c.input, &c.output, 128, &c.metrics);
  };
  const auto invalid = UMBEL_ERROR_INVALID_ARGUMENT;
  ASSERT_EQ(measure(), UMBEL_OK);
  expect_failure(umbel_cluster_get_metrics(&c.input, &c.output, 0, &c.metrics), invalid,
                 "max_items");
  c.ranges[1].count = 0xffffffffu;
  expect_failure(measure(), invalid, "ranges[1]");
  c.ranges[1].count = 1;
  c.items[2] = 1u << 30;
  expect_failure(measure(), invalid, "items[2]");
  for (size_t* const count : {&c.output.range_count, &c.output.item_count}) {
    const size_t before = std::exchange(*count, SIZE_MAX);
    expect_failure(measure(), invalid, "_count");
    *count = before;
  }
  c.output.items = nullptr;
  expect_failure(measure(), invalid, "NULL");
}

}  // namespace
}  // namespace umbel
