#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "trace/camera.hpp"
#include "trace/scenes.hpp"

namespace umbel::trace {
namespace {

constexpr uint32_t kWidth = 64, kHeight = 48;

Camera from_front() {
  Camera camera;
  camera.position = {0, 0, 4};
  camera.target = {0, 0, 0};
  return camera;
}

std::vector<Aabb> some_boxes(uint32_t count, float reach) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> at(-reach, reach), size(0, 2);
  std::vector<Aabb> boxes;
  for (uint32_t i = 0; i < count; ++i) {
    const Vec3 low{at(random), at(random), at(random)};
    boxes.push_back({low, {low.x + size(random), low.y + size(random), low.z + size(random)}});
  }
  return boxes;
}

// Whether some of many points along the ray is in the box, which is enlarged a bit.
bool walks_through(const Ray& ray, const Aabb& box, float margin) {
  for (int i = 0; i <= 4000; ++i) {
    const float t = 0.004f * static_cast<float>(i);
    const Vec3 p = ray.origin + ray.direction * t;
    if (p.x >= box.min.x - margin && p.x <= box.max.x + margin && p.y >= box.min.y - margin &&
        p.y <= box.max.y + margin && p.z >= box.min.z - margin && p.z <= box.max.z + margin) {
      return true;
    }
  }
  return false;
}

TEST(BoxesPerPixel, counts_what_a_walk_along_each_ray_meets) {
  // Some of the boxes are around the camera, and some behind it.
  const std::vector<Aabb> boxes = some_boxes(40, 4.5f);
  const Camera camera = from_front();
  const std::vector<uint32_t> counts = boxes_per_pixel(boxes, camera, kWidth, kHeight);
  const RayCamera rays(camera, kWidth, kHeight);
  uint64_t hits = 0;
  for (uint32_t y = 0; y < kHeight; y += 7) {
    for (uint32_t x = 0; x < kWidth; x += 5) {
      const Ray ray = rays.ray(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f, {});
      uint32_t least = 0, most = 0;
      for (const Aabb& box : boxes) {
        least += walks_through(ray, box, -0.004f) ? 1 : 0;
        most += walks_through(ray, box, 0.004f) ? 1 : 0;
      }
      EXPECT_GE(counts[y * kWidth + x], least);
      EXPECT_LE(counts[y * kWidth + x], most);
      hits += least;
    }
  }
  EXPECT_GT(hits, 20u);
}

TEST(BoxesPerPixel, a_box_around_the_camera_covers_the_picture_and_one_behind_it_nothing) {
  const Aabb around{{-9, -9, -9}, {9, 9, 9}}, behind{{-1, -1, 5}, {1, 1, 6}};
  const std::vector<uint32_t> counts =
      boxes_per_pixel(std::vector<Aabb>{around, behind}, from_front(), kWidth, kHeight);
  EXPECT_EQ(counts, std::vector<uint32_t>(kWidth * kHeight, 1));
}

TEST(BoxesPerPixel, flat_boxes_count_and_empty_ones_do_not) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const Aabb flat{{-9, -9, 0}, {9, 9, 0}}, empty{{1, 1, 1}, {-1, -1, -1}},
      nan{{kNan, 0, 0}, {1, 1, 1}};
  const std::vector<uint32_t> counts =
      boxes_per_pixel(std::vector<Aabb>{flat, empty, nan}, from_front(), kWidth, kHeight);
  EXPECT_EQ(counts, std::vector<uint32_t>(kWidth * kHeight, 1));
}

TEST(BoxesPerPixel, any_number_of_threads_counts_the_same) {
  const std::vector<Aabb> boxes = some_boxes(300, 3);
  const auto counted = [&](uint32_t threads) {
    BuildOptions options;
    options.threads = threads;
    return boxes_per_pixel(boxes, from_front(), kWidth, kHeight, options);
  };
  EXPECT_EQ(counted(1), counted(2));
}

TEST(BoxesPerPixel, sizes_and_cameras_out_of_range_are_refused) {
  const std::vector<Aabb> boxes = some_boxes(1, 1);
  EXPECT_THROW(boxes_per_pixel(boxes, from_front(), 0, 10), Error);
  EXPECT_THROW(boxes_per_pixel(boxes, from_front(), 40000, 10), Error);
  Camera nowhere = from_front();
  nowhere.target = nowhere.position;
  EXPECT_THROW(boxes_per_pixel(boxes, nowhere, 10, 10), Error);
}

}  // namespace
}  // namespace umbel::trace
