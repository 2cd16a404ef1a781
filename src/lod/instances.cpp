// Selection for instances: the view and the planes of the scene are brought into each instance's
// own space once, in double precision, and everything else is as for one mesh.
#include "lod/instances.hpp"

#include <algorithm>
#include <cmath>

#include "base/math.hpp"
#include "base/parallel.hpp"

namespace umbel::lod {
namespace {

using Row = std::array<double, 3>;
using Matrix = std::array<Row, 3>;

Matrix linear(const Transform& t) {
  Matrix m;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m[i][j] = t.rows[4 * i + j];
  return m;
}

Row cross(const Row& a, const Row& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double dot(const Row& a, const Row& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// The eigenvalues of the symmetric `m` by Jacobi's rotations, which keep small ones accurate.
Row eigenvalues(Matrix m) {
  for (int sweep = 0; sweep < 12; ++sweep)
    for (const auto& [p, q] : {std::pair{0, 1}, {0, 2}, {1, 2}}) {
      if (m[p][q] == 0) continue;
      const double theta = (m[q][q] - m[p][p]) / (2 * m[p][q]);
      const double t = std::copysign(1.0, theta) / (std::fabs(theta) + std::hypot(theta, 1.0));
      const double c = 1 / std::hypot(t, 1.0), s = t * c;
      for (int k = 0; k < 3; ++k) {
        const double a = m[k][p], b = m[k][q];
        m[k][p] = c * a - s * b, m[k][q] = s * a + c * b;
      }
      for (int k = 0; k < 3; ++k) {
        const double a = m[p][k], b = m[q][k];
        m[p][k] = c * a - s * b, m[q][k] = s * a + c * b;
      }
    }
  return {m[0][0], m[1][1], m[2][2]};
}

}  // namespace

Stretch stretch(const Transform& transform) {
  const Matrix m = linear(transform);
  Matrix square{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) square[i][j] += m[k][i] * m[k][j];
  const Row values = eigenvalues(square);
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  const double determinant = dot(m[0], cross(m[1], m[2]));
  const bool finite = std::all_of(transform.rows.begin(), transform.rows.end(),
                                  [](float value) { return std::isfinite(value); });
  if (!finite || !(*low > 0) || determinant == 0)
    throw Error(ErrorCode::kInvalidArgument,
                "a transform must be finite and invertible, but has the determinant " +
                    std::to_string(determinant));
  return {std::sqrt(*low), std::sqrt(*high)};
}

View to_object(const View& view, const Transform& transform) {
  check(view);
  const Stretch s = stretch(transform);
  View result = view;
  if (view.kind == View::Kind::kError) result.error = scaled(view.error, 1 / s.most);
  if (view.kind != View::Kind::kCamera) return result;
  result.threshold = scaled(view.threshold, s.least / s.most);
  const Matrix m = linear(transform);
  const Row from = {double{view.eye.x} - transform.rows[3], double{view.eye.y} - transform.rows[7],
                    double{view.eye.z} - transform.rows[11]};
  // The inverse's columns are the cross products of the rows over the determinant.
  const Row columns[] = {cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])};
  const double determinant = dot(m[0], columns[0]);
  float eye[3];
  for (int i = 0; i < 3; ++i)
    eye[i] = static_cast<float>(
        (columns[0][i] * from[0] + columns[1][i] * from[1] + columns[2][i] * from[2]) /
        determinant);
  result.eye = {eye[0], eye[1], eye[2]};
  if (!is_finite(result.eye))
    throw Error(ErrorCode::kInvalidArgument,
                "the eye is too far away in an instance's own space: its transform is too small");
  return result;
}

Plane to_object(const Plane& plane, const Transform& transform) {
  stretch(transform);
  const Matrix m = linear(transform);
  const Row world{plane.normal.x, plane.normal.y, plane.normal.z};
  Row normal{};
  double offset = plane.offset;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) normal[i] += m[k][i] * world[k];
    offset += world[i] * transform.rows[4 * i + 3];
  }
  const double length = std::sqrt(dot(normal, normal));
  return {{static_cast<float>(normal[0] / length), static_cast<float>(normal[1] / length),
           static_cast<float>(normal[2] / length)},
          static_cast<float>(offset / length)};
}

std::vector<Plane> to_object(std::span<const Plane> planes, const Transform& transform) {
  std::vector<Plane> result;
  result.reserve(planes.size());
  for (const Plane& plane : planes) result.push_back(to_object(plane, transform));
  return result;
}

InstanceCuts select_instances(const Tables& tables, const View& view, const Culling& culling,
                              std::span<const Transform> instances) {
  check(tables, view, culling);
  std::vector<std::vector<uint32_t>> cuts(instances.size());
  parallel_for(instances.size(), 1, [&](size_t i) {
    const std::vector<Plane> planes = to_object(culling.planes, instances[i]);
    cuts[i] = select_hierarchy(tables, to_object(view, instances[i]), {planes, culling.facing});
  });
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
