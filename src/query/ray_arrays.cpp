// Chunks are small enough for their rays to be put together on the stack, and numbered by position,
// so that results do not depend on the threads.
#include "umbel/ray_arrays.hpp"

#include <algorithm>
#include <string>

#include "base/parallel.hpp"

namespace umbel {
namespace {

constexpr size_t kArrayRaysAtOnce = 256;

/// Checks one part's length; `count` is that of all rays, once known.
void check_length(size_t length, const char* name, size_t count) {
  if (length == count || length == 1) return;
  throw Error(ErrorCode::kInvalidArgument, std::string(name) + " has " + std::to_string(length) +
                                               " elements, but there are " + std::to_string(count) +
                                               " rays");
}

template <typename T>
void check_results(std::span<T> results, const char* name, size_t count, bool optional) {
  if (results.size() == count || (optional && results.empty())) return;
  throw Error(ErrorCode::kInvalidArgument, std::string(name) + " has room for " +
                                               std::to_string(results.size()) + " of " +
                                               std::to_string(count) + " rays");
}

/// Reads rays one at a time. A stride of 0 repeats the one element that there is.
class RayReader {
 public:
  explicit RayReader(const RayArrays& rays)
      : rays_(rays),
        origin_stride_(rays.origins.size() > 1),
        direction_stride_(rays.directions.size() > 1),
        t_min_stride_(rays.t_min.size() > 1),
        t_max_stride_(rays.t_max.size() > 1) {}

  Ray operator[](size_t i) const {
    Ray ray;
    ray.origin = rays_.origins[i * origin_stride_];
    ray.direction = rays_.directions[i * direction_stride_];
    if (!rays_.t_min.empty()) ray.t_min = rays_.t_min[i * t_min_stride_];
    if (!rays_.t_max.empty()) ray.t_max = rays_.t_max[i * t_max_stride_];
    return ray;
  }

 private:
  const RayArrays& rays_;
  size_t origin_stride_, direction_stride_, t_min_stride_, t_max_stride_;
};

void write(const HitArrays& hits, size_t i, const Hit& hit) {
  if (!hits.t.empty()) hits.t[i] = hit.t;
  if (!hits.primitive.empty()) hits.primitive[i] = hit.primitive;
  if (!hits.u.empty()) hits.u[i] = hit.u;
  if (!hits.v.empty()) hits.v[i] = hit.v;
}

/// Calls body(i) for every ray, in parallel.
template <typename Body>
void for_each_ray(size_t count, uint32_t threads, const Body& body) {
  with_threads(threads, [&] {
    parallel_chunks(count, kArrayRaysAtOnce, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) body(i);
    });
  });
}

/// Appends the nearest `max_hits` hits (0: all). `room` is reused from ray to ray.
size_t append_hits(const TriangleQueries& structure, const Ray& ray, size_t max_hits,
                   const RayOptions& options, std::vector<Hit>& room, std::vector<Hit>& hits) {
  size_t count = structure.all_hits(ray, room, options);
  while (count == room.size() && (max_hits == 0 || room.size() < max_hits)) {
    const size_t doubled = 2 * room.size();
    room.resize(max_hits == 0 ? doubled : std::min(doubled, max_hits));
    count = structure.all_hits(ray, room, options);
  }
  hits.insert(hits.end(), room.begin(), room.begin() + static_cast<std::ptrdiff_t>(count));
  return count;
}

}  // namespace

size_t ray_count(const RayArrays& rays) {
  if (rays.origins.empty() || rays.directions.empty()) {
    if (rays.origins.size() <= 1 && rays.directions.size() <= 1) return 0;
    check_length(rays.directions.size(), "directions", rays.origins.size());
    check_length(rays.origins.size(), "origins", rays.directions.size());
  }
  const size_t count = rays.origins.size() == 1 ? rays.directions.size() : rays.origins.size();
  check_length(rays.directions.size(), "directions", count);
  if (!rays.t_min.empty()) check_length(rays.t_min.size(), "t_min", count);
  if (!rays.t_max.empty()) check_length(rays.t_max.size(), "t_max", count);
  return count;
}

void intersect(const TriangleQueries& structure, const RayArrays& rays, const HitArrays& hits,
               const RayOptions& options, uint32_t threads) {
  const size_t count = ray_count(rays);
  check_results(hits.t, "hits.t", count, true);
  check_results(hits.primitive, "hits.primitive", count, true);
  check_results(hits.u, "hits.u", count, true);
  check_results(hits.v, "hits.v", count, true);
  const RayReader reader(rays);
  for_each_ray(count, threads,
               [&](size_t i) { write(hits, i, structure.intersect(reader[i], options)); });
}

void occluded(const TriangleQueries& structure, const RayArrays& rays, std::span<uint8_t> results,
              const RayOptions& options, uint32_t threads) {
  const size_t count = ray_count(rays);
  check_results(results, "results", count, false);
  const RayReader reader(rays);
  for_each_ray(count, threads,
               [&](size_t i) { results[i] = structure.occluded(reader[i], options); });
}

AllHits all_hits(const TriangleQueries& structure, const RayArrays& rays, size_t max_hits,
                 const RayOptions& options, uint32_t threads) {
  constexpr size_t kFirstRoom = 16;
  const size_t count = ray_count(rays);
  const RayReader reader(rays);
  AllHits result;
  result.offsets.resize(count + 1);
  std::vector<std::vector<Hit>> parts((count + kArrayRaysAtOnce - 1) / kArrayRaysAtOnce);
  with_threads(threads, [&] {
    parallel_chunks(count, kArrayRaysAtOnce, [&](size_t begin, size_t end) {
      std::vector<Hit> room(max_hits == 0 ? kFirstRoom : std::min(kFirstRoom, max_hits));
      std::vector<Hit>& part = parts[begin / kArrayRaysAtOnce];
      for (size_t i = begin; i < end; ++i)
        result.offsets[i + 1] = append_hits(structure, reader[i], max_hits, options, room, part);
    });
    for (size_t i = 0; i < count; ++i) result.offsets[i + 1] += result.offsets[i];
    result.hits.resize(result.offsets.back());
    parallel_for(parts.size(), 1, [&](size_t i) {
      std::copy(
          parts[i].begin(), parts[i].end(),
          result.hits.begin() + static_cast<std::ptrdiff_t>(result.offsets[i * kArrayRaysAtOnce]));
    });
  });
  return result;
}

}  // namespace umbel
