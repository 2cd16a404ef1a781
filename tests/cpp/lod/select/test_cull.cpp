#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "lod/select/cull.hpp"
#include "lod/synthetic_dag.hpp"
#include "umbel/lod.hpp"

namespace umbel::lod {
namespace {

using testing::Random;

const Dag& blob_dag() {
  static const Dag dag = build(shapes::blob(5, 7).view(), testing::small_config());
  return dag;
}

const std::vector<ClusterBounds>& blob_normal_cones() {
  static const std::vector<ClusterBounds> bounds =
      normal_cone_bounds(blob_dag().tables, testing::reader_of(blob_dag()));
  return bounds;
}

struct Frustum {
  Camera camera;
  float aspect = 1, near_plane = 0, far_plane = std::numeric_limits<float>::infinity();
  std::vector<Plane> planes() const {
    return frustum_planes(camera, aspect, near_plane, far_plane);
  }
};

Frustum random_frustum(Random& random, double reach) {
  Frustum result;
  const Vec3 e = random.point(), t = random.point();
  const auto at = [&](float v) { return static_cast<float>(v * reach); };
  result.camera.position = {at(e.x), at(e.y), at(e.z)};
  result.camera.target = t;
  result.camera.up = {0.1f, 0.2f, 1};
  result.camera.fov_y = static_cast<float>(random.between(0.1, 2));
  result.aspect = static_cast<float>(random.between(0.5, 2));
  result.near_plane = static_cast<float>(random.between(0, 0.1));
  if (random.below(2)) result.far_plane = static_cast<float>(random.between(0.5, 4));
  return result;
}

// Boxes and spheres for tables without geometry.
void give_boxes(Tables& tables, Random& random) {
  for (Cluster& cluster : tables.clusters) {
    const Sphere& s = tables.groups[cluster.group].sphere;
    const Vec3 p = random.point();
    const float h = 0.5f * s.radius;
    const Vec3 c{s.center.x + h * p.x, s.center.y + h * p.y, s.center.z + h * p.z};
    cluster.box = {{c.x - 0.1f * h, c.y - 0.1f * h, c.z - 0.1f * h},
                   {c.x + 0.1f * h, c.y + 0.1f * h, c.z + 0.1f * h}};
  }
}

TEST(CulledSelect, all_three_ways_give_the_same) {
  Random random(5);
  std::set<size_t> sizes;
  for (int i = 0; i < 300; ++i) {
    const Frustum seen = random_frustum(random, 3);
    const std::vector<Plane> planes = seen.planes();
    Culling culling{planes, {}};
    if (i % 2) culling.normal_cones = blob_normal_cones();
    const View view =
        testing::camera(seen.camera.position, static_cast<float>(random.log_between(1e-5, 1)));
    const std::vector<uint32_t> cut = select(blob_dag().tables, view, culling);
    EXPECT_EQ(select_hierarchy(blob_dag().tables, view, culling), cut);
    EXPECT_EQ(select_breadth_first(blob_dag().tables, view, culling), cut);
    sizes.insert(cut.size());
  }
  EXPECT_GT(sizes.size(), 50u);
}

// Planes that touch spheres of groups and of nodes, where rounding decides, at any distance from
// the origin.
TEST(CulledSelect, all_three_ways_give_the_same_at_grazing_planes) {
  Random random(6);
  size_t partial = 0;
  for (const double far : {0.0, 10.0, 1e4, 1e7})
    for (const double scale : {1e-20, 1.0, 1e20}) {
      const Vec3 offset{static_cast<float>(far * scale), static_cast<float>(-far * scale), 0};
      Tables tables = testing::random_tables(static_cast<uint32_t>(far) + 3, 500, {scale, offset});
      give_boxes(tables, random);
      for (int i = 0; i < 300; ++i) {
        const Node& node = tables.nodes[random.below(static_cast<uint32_t>(tables.nodes.size()))];
        const Vec3 d = random.point();
        const double length = std::hypot(d.x, d.y, d.z);
        const Vec3 n{static_cast<float>(d.x / length), static_cast<float>(d.y / length),
                     static_cast<float>(d.z / length)};
        const Vec3& c = node.sphere.center;
        const double at = double{n.x} * c.x + double{n.y} * c.y + double{n.z} * c.z;
        const Plane plane{
            n, static_cast<float>(-at - node.sphere.radius * (1 + random.between(-1e-6, 1e-6)))};
        const Culling culling{{&plane, 1}, {}};
        const View view = view_error(static_cast<float>(random.log_between(1e-6, 1e-1) * scale));
        const std::vector<uint32_t> cut = select(tables, view, culling);
        ASSERT_EQ(select_hierarchy(tables, view, culling), cut);
        ASSERT_EQ(select_breadth_first(tables, view, culling), cut);
        partial += !cut.empty() && cut.size() < select(tables, view).size();
      }
    }
  EXPECT_GT(partial, 500u);
}

TEST(CulledSelect, nothing_that_is_seen_is_left_out) {
  const Tables& tables = blob_dag().tables;
  Random random(7);
  size_t left_out = 0;
  for (int i = 0; i < 60; ++i) {
    const Frustum seen = random_frustum(random, 3);
    const std::vector<Plane> planes = seen.planes();
    const View view =
        testing::camera(seen.camera.position, static_cast<float>(random.log_between(1e-4, 1e-1)));
    const std::vector<uint32_t> all = select(tables, view);
    const std::vector<uint32_t> kept = select(tables, view, {planes, blob_normal_cones()});
    ASSERT_TRUE(std::includes(all.begin(), all.end(), kept.begin(), kept.end()));
    for (const uint32_t c : all) {
      if (std::binary_search(kept.begin(), kept.end(), c)) continue;
      ++left_out;
      const ClusterGeometry g = blob_dag().geometry(c);
      for (size_t t = 0; t < g.triangles.size(); t += 3) {
        const Vec3 &p = g.positions[g.triangles[t]], &q = g.positions[g.triangles[t + 1]],
                   &r = g.positions[g.triangles[t + 2]];
        const double ux = double{q.x} - p.x, uy = double{q.y} - p.y, uz = double{q.z} - p.z;
        const double vx = double{r.x} - p.x, vy = double{r.y} - p.y, vz = double{r.z} - p.z;
        const double front = (uy * vz - uz * vy) * (double{seen.camera.position.x} - p.x) +
                             (uz * vx - ux * vz) * (double{seen.camera.position.y} - p.y) +
                             (ux * vy - uy * vx) * (double{seen.camera.position.z} - p.z);
        const auto is_inside = [&](const Vec3& v) {
          return std::all_of(planes.begin(), planes.end(), [&](const Plane& plane) {
            return double{plane.normal.x} * v.x + double{plane.normal.y} * v.y +
                       double{plane.normal.z} * v.z + plane.offset >
                   1e-6;
          });
        };
        if (front > 0) ASSERT_FALSE(is_inside(p) || is_inside(q) || is_inside(r));
      }
    }
  }
  EXPECT_GT(left_out, 1000u);
}

TEST(CulledSelect, the_frustum_holds_what_the_camera_sees) {
  Random random(8);
  for (int i = 0; i < 200; ++i) {
    Frustum seen = random_frustum(random, 2);
    seen.far_plane = 5;
    const std::vector<Plane> planes = seen.planes();
    ASSERT_EQ(planes.size(), 6u);
    // In the camera's own axes.
    const auto minus = [](const Vec3& a, const Vec3& b) {
      return std::array<double, 3>{double{a.x} - b.x, double{a.y} - b.y, double{a.z} - b.z};
    };
    auto f = minus(seen.camera.target, seen.camera.position);
    const double length = std::hypot(f[0], f[1], f[2]);
    for (double& v : f) v /= length;
    const Vec3& w = seen.camera.up;
    std::array<double, 3> r{f[1] * w.z - f[2] * w.y, f[2] * w.x - f[0] * w.z,
                            f[0] * w.y - f[1] * w.x};
    const double size = std::hypot(r[0], r[1], r[2]);
    for (double& v : r) v /= size;
    const std::array<double, 3> u{r[1] * f[2] - r[2] * f[1], r[2] * f[0] - r[0] * f[2],
                                  r[0] * f[1] - r[1] * f[0]};
    for (int k = 0; k < 50; ++k) {
      const Vec3 p = random.point();
      const auto d = minus(p, seen.camera.position);
      const double z = d[0] * f[0] + d[1] * f[1] + d[2] * f[2];
      const double x = d[0] * r[0] + d[1] * r[1] + d[2] * r[2];
      const double y = d[0] * u[0] + d[1] * u[1] + d[2] * u[2];
      const double tangent = std::tan(0.5 * seen.camera.fov_y);
      const double slack[] = {z * tangent * seen.aspect - std::fabs(x), z * tangent - std::fabs(y),
                              z - seen.near_plane, seen.far_plane - z};
      const double least = *std::min_element(std::begin(slack), std::end(slack));
      if (std::fabs(least) < 1e-5) continue;
      EXPECT_EQ(!is_outside(Sphere{p, 0}, planes), least > 0);
    }
  }
}

TEST(CulledSelect, instances_see_what_a_moved_mesh_would) {
  const Mesh mesh = shapes::blob(4, 7);
  const Dag dag = build(mesh.view(), testing::small_config());
  // A turn by a right angle, a doubling and a shift, all exact in floats.
  const Transform transform{{0, -2, 0, 8, 2, 0, 0, -4, 0, 0, 2, 16}};
  Tables moved = dag.tables;
  const auto move = [](Sphere& s, float& error) {
    s.center = {8 - 2 * s.center.y, -4 + 2 * s.center.x, 16 + 2 * s.center.z};
    s.radius *= 2;
    error *= 2;
  };
  for (Group& group : moved.groups) move(group.sphere, group.error);
  for (Node& node : moved.nodes) move(node.sphere, node.error);
  Random random(9);
  std::set<size_t> sizes;
  for (int i = 0; i < 100; ++i) {
    const Vec3 p = random.point();
    // Eyes on a coarse grid are exact in both spaces.
    const Vec3 eye{std::round(16 * p.x) + 8, std::round(16 * p.y), std::round(16 * p.z) + 16};
    const View view = i % 4 ? testing::camera(eye, std::ldexp(1.0f, -i % 16))
                            : view_error(std::ldexp(1.0f, -i % 16));
    const InstanceCuts cuts = select_instances(dag.tables, view, {}, {&transform, 1});
    ASSERT_EQ(cuts.offsets,
              (std::vector<uint32_t>{0, static_cast<uint32_t>(cuts.clusters.size())}));
    EXPECT_EQ(cuts.clusters, select_hierarchy(moved, view));
    sizes.insert(cuts.clusters.size());
  }
  EXPECT_GT(sizes.size(), 5u);
}

TEST(CulledSelect, stretched_instances_have_at_least_the_detail_that_they_need) {
  Random random(10);
  for (int i = 0; i < 200; ++i) {
    Transform t;
    for (float& value : t.rows) value = static_cast<float>(random.between(-2, 2));
    const Vec3 eye = random.point(), point = random.point();
    const View view = testing::camera(eye, 0.01f);
    const View object = to_object(view, t);
    const auto apply = [&](const Vec3& p, int row) {
      return double{t.rows[4 * row]} * p.x + double{t.rows[4 * row + 1]} * p.y +
             double{t.rows[4 * row + 2]} * p.z + t.rows[4 * row + 3];
    };
    // The eye comes back.
    EXPECT_NEAR(apply(object.eye, 0), eye.x, 1e-3);
    EXPECT_NEAR(apply(object.eye, 1), eye.y, 1e-3);
    EXPECT_NEAR(apply(object.eye, 2), eye.z, 1e-3);
    // An error in any direction that is fine here is fine in the scene.
    const double seen =
        std::hypot(apply(point, 0) - eye.x, apply(point, 1) - eye.y, apply(point, 2) - eye.z);
    const double own = std::hypot(double{point.x} - object.eye.x, double{point.y} - object.eye.y,
                                  double{point.z} - object.eye.z);
    const Vec3 d = random.point();
    const double length = std::hypot(d.x, d.y, d.z);
    double moved[3];
    for (int row = 0; row < 3; ++row) moved[row] = apply(d, row) - t.rows[4 * row + 3];
    const double grown = std::hypot(moved[0], moved[1], moved[2]) / length;
    EXPECT_LE(object.threshold * own * grown, 0.01 * seen * (1 + 1e-3));
  }
}

TEST(CulledSelect, planes_hold_the_same_points_in_an_instance) {
  Random random(11);
  const Transform t{{1, 0.5f, 0, 3, -0.25f, 2, 0, -1, 0, 0, 0.5f, 2}};
  for (int i = 0; i < 200; ++i) {
    const Vec3 d = random.point(), p = random.point();
    const float length = std::hypot(d.x, d.y, d.z);
    const Plane plane{{d.x / length, d.y / length, d.z / length},
                      static_cast<float>(random.between(-4, 4))};
    const Plane own = to_object(plane, t);
    EXPECT_NEAR(std::hypot(own.normal.x, own.normal.y, own.normal.z), 1, 1e-6);
    const Vec3 moved{p.x + 0.5f * p.y + 3, -0.25f * p.x + 2 * p.y - 1, 0.5f * p.z + 2};
    const float s = side(plane, moved.x, moved.y, moved.z), o = side(own, p.x, p.y, p.z);
    if (std::fabs(s) > 1e-4f) EXPECT_EQ(s > 0, o > 0);
  }
}

uint64_t cost_of(const std::vector<uint32_t>& cut, const std::vector<uint32_t>& costs) {
  uint64_t cost = 0;
  for (const uint32_t c : cut) cost += costs[c];
  return cost;
}

float& value_of(View& view) {
  return view.kind == View::Kind::kError ? view.error : view.threshold;
}

TEST(Budget, the_view_fits_and_the_next_finer_one_does_not) {
  const Tables& tables = blob_dag().tables;
  Random random(12);
  const std::vector<uint32_t> triangles = triangle_costs(tables), bytes = byte_costs(tables, 16);
  size_t bound = 0;
  for (int i = 0; i < 120; ++i) {
    const Frustum seen = random_frustum(random, 3);
    const std::vector<Plane> planes = seen.planes();
    const Culling culling{i % 2 ? std::span<const Plane>(planes) : std::span<const Plane>{}, {}};
    const std::vector<uint32_t>& costs = i % 3 ? triangles : bytes;
    const View finest = i % 5 ? testing::camera(seen.camera.position, 1e-6f) : view_error(0);
    const uint64_t all = cost_of(select(tables, finest, culling), costs);
    const uint64_t budget = static_cast<uint64_t>(random.uniform() * 1.1 * all);
    View view = view_for_budget(tables, finest, costs, budget, culling);
    const uint64_t cost = cost_of(select(tables, view, culling), costs);
    if (all <= budget) {
      EXPECT_EQ(value_of(view), i % 5 ? 1e-6f : 0.0f);
      continue;
    }
    View coarsest = view;
    value_of(coarsest) = 1e30f;
    if (cost > budget) {
      EXPECT_EQ(select(tables, view, culling), select(tables, coarsest, culling));
      continue;
    }
    ++bound;
    if (std::isinf(view.error)) {  // no threshold fits with the eye inside
      view = finest;
      value_of(view) = std::numeric_limits<float>::max();
    }
    value_of(view) = std::nextafter(value_of(view), 0.0f);
    EXPECT_GT(cost_of(select(tables, view, culling), costs), budget);
  }
  EXPECT_GT(bound, 60u);
}

TEST(Budget, one_instance_in_place_is_the_mesh_itself) {
  const Tables& tables = blob_dag().tables;
  const std::vector<uint32_t> costs = triangle_costs(tables);
  const Transform here;
  for (const uint64_t budget : {100ull, 1000ull, 5000ull}) {
    const View view = testing::camera({0, 0, 3}, 0);
    EXPECT_EQ(view_for_budget(tables, view, costs, budget, {}, {&here, 1}).threshold,
              view_for_budget(tables, view, costs, budget).threshold);
  }
}

TEST(Budget, instances_share_it) {
  const Tables& tables = blob_dag().tables;
  const std::vector<uint32_t> costs = triangle_costs(tables);
  std::vector<Transform> instances(5);
  for (size_t i = 0; i < instances.size(); ++i) {
    instances[i].rows[3] = 3.0f * static_cast<float>(i);
    instances[i].rows[0] = instances[i].rows[5] = instances[i].rows[10] = 0.5f + 0.3f * i;
  }
  const auto cost = [&](const View& view) {
    return cost_of(select_instances(tables, view, {}, instances).clusters, costs);
  };
  for (const View& from : {testing::camera({-3, 1, 0}, 0), view_error(0)})
    for (const uint64_t budget : {2000ull, 10000ull, 50000ull}) {
      View view = view_for_budget(tables, from, costs, budget, {}, instances);
      EXPECT_LE(cost(view), budget);
      value_of(view) = std::nextafter(value_of(view), 0.0f);
      EXPECT_GT(cost(view), budget);
    }
}

TEST(CulledSelect, units_are_those_of_the_camera) {
  EXPECT_DOUBLE_EQ(angular_error(1, 2), std::asin(0.5));
  EXPECT_DOUBLE_EQ(angular_error(3, 2), std::asin(1.0));
  EXPECT_EQ(angular_error(0, 0), 0);
  const View view = view_camera({0, 0, 0}, 1.0f, 1080, 2.5f);
  EXPECT_NEAR(pixel_error(view.threshold * 7.0, 7.0, 1.0, 1080), 2.5, 1e-6);
  EXPECT_EQ(pixel_error(1, 0, 1, 1080), std::numeric_limits<double>::infinity());
}

// Messages have no C++ names: callers in C and Python read them too.
TEST(CulledSelect, impossible_views_and_planes_are_named) {
  const Tables& tables = blob_dag().tables;
  const auto sentence = [&](const View& view, const Culling& culling) -> std::string {
    try {
      select(tables, view, culling);
    } catch (const Error& error) {
      return error.what();
    }
    return "not refused";
  };
  const View camera = testing::camera({0, 0, 3}, 0.1f);
  View wrong = view_error(1);
  wrong.error = -1;
  EXPECT_EQ(sentence(wrong, {}), "the view's error must be at least 0");
  wrong = camera;
  wrong.threshold = -1;
  EXPECT_EQ(sentence(wrong, {}), "the view's threshold must be at least 0");
  wrong = camera;
  wrong.eye.y = std::numeric_limits<float>::infinity();
  EXPECT_EQ(sentence(wrong, {}), "the view's eye must be finite");
  const Plane planes[] = {{{1, 0, 0}, 0}, {{2, 0, 0}, 0}};
  EXPECT_EQ(sentence(camera, {planes, {}}).find("planes[1] must have a normal of length 1"), 0u);
  const std::vector<ClusterBounds> few(3);
  EXPECT_EQ(sentence(camera, {{}, few}).find("normal_cones has 3 elements"), 0u);
  EXPECT_EQ(sentence(view_error(0), {{}, blob_normal_cones()}),
            "normal_cones needs a view by camera: other views have no eye");
}

TEST(CulledSelect, impossible_arguments_are_rejected) {
  const Tables& tables = blob_dag().tables;
  const View view = testing::camera({0, 0, 3}, 0.1f);
  const Plane long_normal{{2, 0, 0}, 0};
  const Plane no_offset{{1, 0, 0}, std::numeric_limits<float>::quiet_NaN()};
  EXPECT_THROW(select(tables, view, {{&long_normal, 1}, {}}), Error);
  EXPECT_THROW(select_hierarchy(tables, view, {{&no_offset, 1}, {}}), Error);
  const std::vector<ClusterBounds> few(3);
  EXPECT_THROW(select_breadth_first(tables, view, {{}, few}), Error);
  EXPECT_THROW(select(tables, view_error(0), {{}, blob_normal_cones()}), Error);
  Transform flat;
  flat.rows[0] = 0;
  EXPECT_THROW(select_instances(tables, view, {}, {&flat, 1}), Error);
  flat.rows[0] = std::numeric_limits<float>::infinity();
  EXPECT_THROW(to_object(view, flat), Error);
  const std::vector<uint32_t> costs = triangle_costs(tables);
  EXPECT_THROW(view_for_budget(tables, view_level(1), costs, 10), Error);
  EXPECT_THROW(view_for_budget(tables, view, std::span(costs).first(2), 10), Error);
  Frustum wrong;
  wrong.camera.target = wrong.camera.position;
  EXPECT_THROW(wrong.planes(), Error);
  wrong = {};
  wrong.camera.up = {0, 0, 3};
  EXPECT_THROW(wrong.planes(), Error);
  wrong = {};
  wrong.camera.fov_y = 4;
  EXPECT_THROW(wrong.planes(), Error);
  wrong = {};
  wrong.near_plane = 2, wrong.far_plane = 1;
  EXPECT_THROW(wrong.planes(), Error);
}

}  // namespace
}  // namespace umbel::lod
