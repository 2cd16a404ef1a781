// The queries of every structure, which go to the kernels that it has chosen.
#include "umbel/triangle_queries.hpp"

#include <algorithm>
#include <string>

#include "base/parallel.hpp"
#include "query/ray_kernels.hpp"
#include "query/shape_kernels.hpp"

namespace umbel {
namespace {

/// Rays that one task traces: enough to hide what starting it costs.
constexpr size_t kRaysAtOnce = 256;

void check_same_length(const char* queries, size_t count, const char* results, size_t room) {
  if (count != room)
    throw Error(ErrorCode::kInvalidArgument, std::string(results) + " must be as many as the " +
                                                 queries + ": there are " + std::to_string(room) +
                                                 " and " + std::to_string(count) + " " + queries);
}

template <typename Work>
void for_rays(size_t count, uint32_t threads, const Work& work) {
  with_threads(threads, [&] {
    parallel_chunks(count, kRaysAtOnce, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) work(i);
    });
  });
}

Hit miss(const LeafStore& /*store*/, const Ray& /*ray*/, const RayOptions& /*options*/) {
  return {};
}
bool nothing_between(const LeafStore& /*store*/, const Ray& /*ray*/,
                     const RayOptions& /*options*/) {
  return false;
}
size_t no_hits(const LeafStore& /*store*/, const Ray& /*ray*/, std::span<Hit> /*hits*/,
               const RayOptions& /*options*/) {
  return 0;
}

}  // namespace

const RayKernels kNoRays{miss, nothing_between, no_hits};

TriangleQueries::TriangleQueries(std::unique_ptr<LeafStore> store) : store_(std::move(store)) {}
TriangleQueries::~TriangleQueries() = default;

Hit TriangleQueries::intersect(const Ray& ray, const RayOptions& options) const {
  return store_->rays->intersect(*store_, ray, options);
}

bool TriangleQueries::occluded(const Ray& ray, const RayOptions& options) const {
  return store_->rays->occluded(*store_, ray, options);
}

size_t TriangleQueries::all_hits(const Ray& ray, std::span<Hit> hits,
                                 const RayOptions& options) const {
  return store_->rays->all_hits(*store_, ray, hits, options);
}

void TriangleQueries::intersect(std::span<const Ray> rays, std::span<Hit> hits,
                                const RayOptions& options, uint32_t threads) const {
  check_same_length("rays", rays.size(), "hits", hits.size());
  for_rays(rays.size(), threads,
           [&](size_t i) { hits[i] = store_->rays->intersect(*store_, rays[i], options); });
}

void TriangleQueries::occluded(std::span<const Ray> rays, std::span<uint8_t> results,
                               const RayOptions& options, uint32_t threads) const {
  check_same_length("rays", rays.size(), "results", results.size());
  for_rays(rays.size(), threads, [&](size_t i) {
    results[i] = store_->rays->occluded(*store_, rays[i], options) ? 1 : 0;
  });
}

ClosestPoint TriangleQueries::closest_point(const Vec3& point, float max_distance) const {
  return store_->shapes->closest_point(*store_, point, max_distance);
}

void TriangleQueries::closest_point(std::span<const Vec3> points, std::span<ClosestPoint> results,
                                    float max_distance, uint32_t threads) const {
  check_same_length("points", points.size(), "results", results.size());
  with_threads(threads,
               [&] { store_->shapes->closest_points(*store_, points, results, max_distance); });
}

bool TriangleQueries::contains(const Vec3& point) const {
  return store_->shapes->contains(*store_, point);
}

void TriangleQueries::contains(std::span<const Vec3> points, std::span<uint8_t> results,
                               uint32_t threads) const {
  check_same_length("points", points.size(), "results", results.size());
  with_threads(threads, [&] { store_->shapes->contains_all(*store_, points, results); });
}

std::vector<uint32_t> TriangleQueries::overlaps(const Aabb& box) const {
  return store_->shapes->in_box(*store_, box);
}

std::vector<uint32_t> TriangleQueries::overlaps(const Sphere& sphere) const {
  return store_->shapes->in_sphere(*store_, sphere);
}

std::vector<uint32_t> TriangleQueries::overlaps(const Frustum& frustum) const {
  return store_->shapes->in_frustum(*store_, frustum);
}

Aabb TriangleQueries::bounds() const { return store_->bounds; }

uint32_t TriangleQueries::triangle_count() const { return store_->triangle_count; }

}  // namespace umbel
