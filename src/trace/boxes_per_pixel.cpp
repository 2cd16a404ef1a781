// How many boxes each pixel's ray pierces. Each box is tried at the pixels of the rectangle that
// its corners span only, which is cheaper than a tree of boxes that overlap.
#include <algorithm>
#include <cmath>

#include "base/parallel.hpp"
#include "trace/camera.hpp"

namespace umbel::trace {
namespace {

constexpr uint32_t kBandRows = 8;  // of the picture, for one thread at a time

/// Pixels from a first to before a last.
struct Rectangle {
  uint32_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

uint32_t pixel_before(double at, uint32_t most) {
  return static_cast<uint32_t>(std::clamp(std::floor(at) - 1, 0.0, static_cast<double>(most)));
}

uint32_t pixel_after(double at, uint32_t most) {
  return static_cast<uint32_t>(std::clamp(std::ceil(at) + 1, 0.0, static_cast<double>(most)));
}

/// The pixels that may see a box, and some more: all where a corner is not before the camera.
Rectangle pixels_of(const Aabb& box, const RayCamera& camera, uint32_t width, uint32_t height) {
  double low[2] = {HUGE_VAL, HUGE_VAL}, high[2] = {-HUGE_VAL, -HUGE_VAL};
  for (uint32_t corner = 0; corner < 8; ++corner) {
    const Vec3 point{corner & 1 ? box.max.x : box.min.x, corner & 2 ? box.max.y : box.min.y,
                     corner & 4 ? box.max.z : box.min.z};
    double at[2];
    if (!camera.pixel_of(point, at)) return {0, 0, width, height};
    for (int k = 0; k < 2; ++k) {
      low[k] = std::min(low[k], at[k]);
      high[k] = std::max(high[k], at[k]);
    }
  }
  return {pixel_before(low[0], width), pixel_before(low[1], height), pixel_after(high[0], width),
          pixel_after(high[1], height)};
}

/// By slabs (Kay & Kajiya 1986). A ray within the plane of a side pierces the box.
bool pierces(const Ray& ray, const Aabb& box) {
  const double origin[3] = {ray.origin.x, ray.origin.y, ray.origin.z};
  const double direction[3] = {ray.direction.x, ray.direction.y, ray.direction.z};
  const double low[3] = {box.min.x, box.min.y, box.min.z};
  const double high[3] = {box.max.x, box.max.y, box.max.z};
  double near = 0, far = HUGE_VAL;
  for (int k = 0; k < 3; ++k) {
    if (direction[k] == 0) {
      if (origin[k] < low[k] || origin[k] > high[k]) return false;
      continue;
    }
    const double a = (low[k] - origin[k]) / direction[k], b = (high[k] - origin[k]) / direction[k];
    near = std::max(near, std::min(a, b));
    far = std::min(far, std::max(a, b));
  }
  return near <= far;
}

bool is_box(const Aabb& box) {
  return box.min.x <= box.max.x && box.min.y <= box.max.y && box.min.z <= box.max.z;
}

}  // namespace

std::vector<uint32_t> boxes_per_pixel(std::span<const Aabb> boxes, const Camera& camera,
                                      uint32_t width, uint32_t height,
                                      const BuildOptions& options) {
  check_picture_size(width, height);
  Camera pinhole = camera;
  pinhole.lens_radius = 0;
  const RayCamera rays(pinhole, width, height);
  std::vector<Rectangle> rectangles(boxes.size());
  std::vector<uint32_t> counts(size_t{width} * height);
  with_threads(options.threads, [&] {
    parallel_for(boxes.size(), 256, [&](size_t i) {
      if (is_box(boxes[i])) rectangles[i] = pixels_of(boxes[i], rays, width, height);
    });
    parallel_chunks(height, kBandRows, [&](size_t begin, size_t end) {
      std::vector<Ray> band;
      for (size_t y = begin; y < end; ++y) {
        for (uint32_t x = 0; x < width; ++x) {
          band.push_back(rays.ray(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f, {}));
        }
      }
      for (size_t i = 0; i < boxes.size(); ++i) {
        const Rectangle& r = rectangles[i];
        for (size_t y = std::max<size_t>(begin, r.y0); y < std::min<size_t>(end, r.y1); ++y) {
          for (size_t x = r.x0; x < r.x1; ++x) {
            counts[y * width + x] += pierces(band[(y - begin) * width + x], boxes[i]) ? 1 : 0;
          }
        }
      }
    });
  });
  return counts;
}

}  // namespace umbel::trace
