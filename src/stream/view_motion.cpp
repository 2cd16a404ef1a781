#include "stream/view_motion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "lod/select/cull.hpp"

namespace umbel::stream {
namespace {

constexpr double kForEver = Evaluation::kForEver;
/// Covers the roundings of the tests in 32-bit floats.
constexpr double kSlack = 4e-6;

struct Point {
  double x, y, z;
};

Point operator-(const Point& a, const Point& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
double dot(const Point& a, const Point& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
double length(const Point& a) { return std::sqrt(dot(a, a)); }
Point point(const Vec3& v) { return {v.x, v.y, v.z}; }

/// Any point will do for a view without an eye: only distances to planes matter then.
Point eye_of(const StreamView& view) {
  return view.view.kind == lod::View::Kind::kCamera ? point(view.view.eye) : Point{0, 0, 0};
}

double side(const lod::Plane& plane, const Point& p) {
  return dot(point(plane.normal), p) + plane.offset;
}

/// How far the eye is from the distance at which the error becomes too large.
double margin_of_error(const GroupRef& group, const lod::View& view, double distance) {
  if (view.kind == lod::View::Kind::kError) return kForEver;
  const double limit = group.sphere.radius + group.error / static_cast<double>(view.threshold);
  if (!(limit < std::numeric_limits<float>::max())) return kForEver;
  return std::abs(distance - limit) - kSlack * (distance + limit);
}

/// How far the sphere is from leaving any plane, or, if it is outside, from entering all.
double margin_of_planes(const GroupRef& group, const StreamView& view, bool is_outside) {
  const Point c = point(group.sphere.center);
  double least = kForEver, most = -kForEver;
  for (const lod::Plane& plane : view.planes) {
    const Point n = point(plane.normal);
    const double size = std::abs(n.x * c.x) + std::abs(n.y * c.y) + std::abs(n.z * c.z) +
                        std::abs(plane.offset) + group.sphere.radius;
    const double inside = side(plane, c) + group.sphere.radius;
    least = std::min(least, inside - kSlack * size);
    most = std::max(most, -inside - kSlack * size);
  }
  return is_outside ? most : least;
}

/// How far the view may move until a ratio is inaccurate.
double margin_of_ratio(const GroupRef& group, double distance, bool is_missing) {
  const double reach = std::max<double>(distance, group.sphere.radius);
  if (!is_missing) return 0.25 * reach;
  const double outside = distance - group.sphere.radius;
  return outside < 0 ? std::max(-outside, 0.01 * reach) : std::max(0.02 * outside, 0.0005 * reach);
}

}  // namespace

bool ViewMotion::add(const StreamView& from, const StreamView& to) {
  const lod::View &a = from.view, &b = to.view;
  if (a.kind != b.kind || from.planes.size() != to.planes.size()) return false;
  double way = 0, zoom = 0;
  if (a.kind == lod::View::Kind::kError) {
    if (a.error != b.error) return false;
  } else {
    way = length(point(b.eye) - point(a.eye));
    if (a.threshold != b.threshold) zoom = std::abs(std::log(double{b.threshold} / a.threshold));
  }
  const Point eye = eye_of(from);
  double turn = 0, planes_way = way;
  for (size_t i = 0; i < to.planes.size(); ++i) {
    const lod::Plane &x = from.planes[i], &y = to.planes[i];
    turn = std::max(turn, length(point(y.normal) - point(x.normal)));
    planes_way = std::max(planes_way, std::abs(side(y, eye) - side(x, eye)));
  }
  moved += way;
  zoomed += zoom;
  planes_moved += planes_way;
  turned += turn;
  return std::isfinite(zoom);
}

Evaluation evaluate(const GroupRef& group, const StreamView& view, bool is_missing) {
  Evaluation evaluation;
  const bool always = group.error == std::numeric_limits<float>::infinity();
  const bool is_outside = !always && lod::is_outside(group.sphere, view.planes);
  const float ratio = lod::times_too_large(group.sphere, group.error, view.view);
  evaluation.ratio = is_outside ? 0 : ratio;
  const bool has_eye = view.view.kind == lod::View::Kind::kCamera;
  if (always || (!has_eye && view.planes.empty())) return evaluation;
  const double distance = length(point(group.sphere.center) - eye_of(view));
  const double size = std::max<double>(distance, group.sphere.radius);
  const double of_error = margin_of_error(group, view.view, distance);
  const double of_planes = margin_of_planes(group, view, is_outside);
  // What is small enough or outside stays so as long as either holds.
  const bool by_planes = evaluation.ratio > 0 ? !view.planes.empty()
                                              : is_outside && (ratio > 0 || of_planes > of_error);
  const bool by_error = has_eye && (evaluation.ratio > 0 || !by_planes);
  if (by_error)
    evaluation.error_margin =
        std::max(0.0, std::min(of_error, margin_of_ratio(group, distance, is_missing)));
  if (by_planes) evaluation.planes_margin = std::max(0.0, std::min(of_planes, 0.25 * size));
  evaluation.size =
      static_cast<int>(std::ceil(4 * std::log2(std::max(1.25 * size, 1e-300)) + 1e-3));
  return evaluation;
}

}  // namespace umbel::stream
