// Selection for instances: the view and the planes of the scene are brought into each instance's
// own space once, in double precision, and everything else is as for one mesh.
#include "lod/select/instances.hpp"

#include <string>
#include <utility>

#include "base/parallel.hpp"
#include "base/printed.hpp"

namespace umbel::lod {
namespace {

InstanceSpace space_of(const Transform& transform) {
  InstanceSpace space(transform);
  if (!space.is_invertible())
    throw Error(ErrorCode::kInvalidArgument,
                "a transform must be finite and invertible, but has the determinant " +
                    printed(space.determinant()));
  return space;
}

}  // namespace

Stretch stretch(const Transform& transform) { return space_of(transform).stretch(); }

double largest_stretch(const Transform& transform) {
  const InstanceSpace space(transform);
  return space.is_finite() ? space.most() : space_of(transform).most();
}

View to_object(const View& view, const Transform& transform) {
  check(view);
  if (view.kind == View::Kind::kError) {
    // What a transform flattens has errors too, which its largest scale says.
    View result = view;
    result.error = scaled(view.error, 1 / largest_stretch(transform));
    return result;
  }
  const View result = space_of(transform).view(view);
  if (view.kind == View::Kind::kCamera && !is_finite(result.eye))
    throw Error(ErrorCode::kInvalidArgument,
                "the eye is too far away in an instance's own space: its transform is too small");
  return result;
}

Plane to_object(const Plane& plane, const Transform& transform) {
  return space_of(transform).plane(plane);
}

std::vector<Plane> to_object(std::span<const Plane> planes, const Transform& transform) {
  const InstanceSpace space = space_of(transform);
  std::vector<Plane> result;
  result.reserve(planes.size());
  for (const Plane& plane : planes) result.push_back(space.plane(plane));
  return result;
}

InstanceCuts select_instances(const Tables& tables, const View& view, const Culling& culling,
                              std::span<const Transform> instances) {
  check(tables, view, culling);
  std::vector<std::vector<uint32_t>> cuts(instances.size());
  const auto seen_by = [&](size_t i) {
    return of_instance(i, [&] {
      return std::pair{to_object(culling.planes, instances[i]), to_object(view, instances[i])};
    });
  };
  try {
    parallel_for(instances.size(), 1, [&](size_t i) {
      const auto [planes, own_view] = seen_by(i);
      cuts[i] = select_hierarchy(tables, own_view, {planes, culling.normal_cones});
    });
  } catch (const Error&) {
    // The first instance that is refused, whichever thread met one first.
    for (size_t i = 0; i < instances.size(); ++i) seen_by(i);
    throw;
  }
  return join_cuts(cuts);
}

InstanceCuts join_cuts(std::span<const std::vector<uint32_t>> cuts) {
  InstanceCuts result;
  result.offsets.push_back(0);
  for (const std::vector<uint32_t>& cut : cuts) {
    if (result.clusters.size() + cut.size() > kNone)
      throw Error(ErrorCode::kUnsupported, "the cuts of all instances have over 2^32 clusters");
    result.clusters.insert(result.clusters.end(), cut.begin(), cut.end());
    result.offsets.push_back(static_cast<uint32_t>(result.clusters.size()));
  }
  return result;
}

}  // namespace umbel::lod
