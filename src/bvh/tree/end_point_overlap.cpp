// End-point overlap (Aila, Karras & Laine, "On Quality Metrics of Bounding Volume Hierarchies",
// 2013): the surface that lies in the boxes of subtrees which it does not belong to, weighed by
// what a visit of their roots costs. Each triangle goes down the tree and is clipped to the box of
// every node it meets; as boxes shrink on the way, a node clips only what its parent left over.
//
// Where all triangles meet most boxes (a fan's hub, needles, one centroid for all) that would take
// the square of their number; there the overlap is estimated from triangles at even distances in
// the order of the leaves.
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "base/parallel.hpp"
#include "base/shared_progress.hpp"
#include "bvh/tree/config.hpp"
#include "query/triangle_geometry.hpp"

namespace umbel::bvh {
namespace {

constexpr size_t kTrianglesAtOnce = 256;

// Visits of one thread between two reports.
constexpr size_t kUnreportedVisits = 1 << 16;

constexpr const char* kStage = "end-point overlap";

// Visits from which on there is no more than an estimate, in all and a triangle; meshes that are
// meant to be traced need some 40 a triangle. Of so many triangles the need is estimated.
constexpr double kMaxVisits = 2e7, kMaxMeanVisits = 200;
constexpr size_t kTrial = 512;

// What below would leave an array is refused; the rest of bvh::check is not needed here, and a tree
// may lack triangles that were dropped.
void check_references(const Bvh2& tree, const MeshView& mesh) {
  const auto corrupt = [](const char* what, size_t index) {
    throw Error(ErrorCode::kCorrupt, std::string(what) + std::to_string(index) +
                                         " of the tree refers to something that is not there");
  };
  const size_t count = tree.nodes.size();
  for (size_t i = 0; i < count; ++i) {
    const Node& node = tree.nodes[i];
    const bool fits = node.is_leaf() ? uint64_t{node.first} + node.count <= tree.primitives.size()
                                     : node.first > i && size_t{node.first} + 1 < count;
    if (!fits) corrupt("node ", i);
  }
  for (size_t i = 0; i < tree.primitives.size(); ++i) {
    if (tree.primitives[i] >= mesh.triangles.size()) corrupt("primitive ", i);
    for (uint32_t vertex : mesh.triangles[tree.primitives[i]])
      if (vertex >= mesh.positions.size())
        throw Error(ErrorCode::kInvalidMesh,
                    "triangle " + std::to_string(tree.primitives[i]) + ": vertex index " +
                        std::to_string(vertex) + " is out of range, the mesh has " +
                        std::to_string(mesh.positions.size()) + " vertices");
  }
}

// Where each subtree lies in depth-first order.
struct Order {
  std::vector<uint32_t> position;  // of each node
  std::vector<uint32_t> size;      // nodes of its subtree
};

Order depth_first_order(const Bvh2& tree) {
  const size_t count = tree.nodes.size();
  Order order{std::vector<uint32_t>(count, 0), std::vector<uint32_t>(count, 1)};
  for (size_t i = count; i-- > 0;) {
    const Node& node = tree.nodes[i];
    if (!node.is_leaf()) order.size[i] += order.size[node.first] + order.size[node.first + 1];
  }
  for (size_t i = 0; i < count; ++i) {
    const Node& node = tree.nodes[i];
    if (node.is_leaf()) continue;
    order.position[node.first] = order.position[i] + 1;
    order.position[node.first + 1] = order.position[i] + 1 + order.size[node.first];
  }
  return order;
}

// The leaves that hold each triangle, by their positions: most have one, split ones several.
struct Homes {
  std::vector<uint32_t> offsets;  // a triangle's are positions[offsets[t] .. offsets[t + 1])
  std::vector<uint32_t> positions;
  std::vector<uint32_t> triangles;  // those that the tree holds, in the order of its leaves

  bool any_in(uint32_t triangle, uint32_t begin, uint32_t end) const {
    for (uint32_t i = offsets[triangle]; i < offsets[triangle + 1]; ++i)
      if (positions[i] >= begin && positions[i] < end) return true;
    return false;
  }
};

Homes homes_of(const Bvh2& tree, const Order& order, size_t triangle_count) {
  Homes homes;
  homes.offsets.assign(triangle_count + 1, 0);
  for (uint32_t p : tree.primitives)
    if (homes.offsets[p + 1]++ == 0) homes.triangles.push_back(p);
  std::partial_sum(homes.offsets.begin(), homes.offsets.end(), homes.offsets.begin());
  homes.positions.resize(tree.primitives.size());
  std::vector<uint32_t> next(homes.offsets.begin(), homes.offsets.end() - 1);
  for (size_t i = 0; i < tree.nodes.size(); ++i) {
    const Node& node = tree.nodes[i];
    for (uint32_t k = 0; k < node.count; ++k)
      homes.positions[next[tree.primitives[node.first + k]]++] = order.position[i];
  }
  return homes;
}

// A convex polygon: a triangle clipped by up to six planes.
struct Polygon {
  std::array<Vec3d, 9> corners;
  uint32_t count = 0;

  void push(const Vec3d& corner) { corners[count++] = corner; }
  // Twice the area.
  double area() const {
    Vec3d sum{0, 0, 0};
    for (uint32_t i = 2; i < count; ++i)
      sum = sum + cross(corners[i - 1] - corners[0], corners[i] - corners[0]);
    return std::sqrt(dot(sum, sum));
  }
};

// Keeps what lies where sign * coordinate <= sign * limit (Sutherland & Hodgman 1974).
void clip(Polygon& polygon, double Vec3d::* axis, double sign, double limit) {
  const auto excess = [&](const Vec3d& corner) { return sign * (corner.*axis - limit); };
  bool crosses = false;
  for (uint32_t i = 0; i < polygon.count; ++i) crosses |= excess(polygon.corners[i]) > 0;
  if (!crosses) return;
  Polygon kept;
  for (uint32_t i = 0; i < polygon.count; ++i) {
    const Vec3d& from = polygon.corners[i];
    const Vec3d& to = polygon.corners[i + 1 == polygon.count ? 0 : i + 1];
    const double a = excess(from), b = excess(to);
    if (a <= 0 && kept.count < kept.corners.size()) kept.push(from);
    // Rounding may leave a polygon that is not quite convex; one corner more than there can be
    // would be one that rounding made.
    if ((a < 0 && b > 0) || (a > 0 && b < 0)) {
      Vec3d crossing = from + (to - from) * (a / (a - b));
      crossing.*axis = limit;
      if (kept.count < kept.corners.size()) kept.push(crossing);
    }
  }
  polygon = kept;
}

bool clip(Polygon& polygon, const Node& node) {
  clip(polygon, &Vec3d::x, -1, node.min.x);
  clip(polygon, &Vec3d::x, 1, node.max.x);
  clip(polygon, &Vec3d::y, -1, node.min.y);
  clip(polygon, &Vec3d::y, 1, node.max.y);
  clip(polygon, &Vec3d::z, -1, node.min.z);
  clip(polygon, &Vec3d::z, 1, node.max.z);
  return polygon.count >= 3;
}

struct Visit {
  uint32_t node;
  Polygon polygon;
};

class Descent {
 public:
  Descent(const Bvh2& tree, const MeshView& mesh, const CostModel& cost, const Order& order,
          const Homes& homes)
      : tree_(tree), mesh_(mesh), cost_(cost), order_(order), homes_(homes) {}

  // Twice the area of a triangle, and twice its weighted area in boxes it does not belong to.
  struct Areas {
    double own = 0, overlap = 0;
    size_t visits = 0;
    void add(const Areas& other) {
      own += other.own;
      overlap += other.overlap;
      visits += other.visits;
    }
  };
  Areas operator()(uint32_t triangle) {
    Visit root{0, {}};
    for (uint32_t vertex : mesh_.triangles[triangle])
      root.polygon.push(to_double(mesh_.positions[vertex]));
    Areas areas{root.polygon.area(), 0, 0};
    if (!(areas.own > 0) || !std::isfinite(areas.own)) return {};
    stack_.assign(1, root);
    while (!stack_.empty()) {
      Visit visit = stack_.back();
      stack_.pop_back();
      areas.overlap += enter(visit, triangle);
      ++areas.visits;
    }
    return areas;
  }

 private:
  double enter(Visit& visit, uint32_t triangle) {
    const Node& node = tree_.nodes[visit.node];
    const uint32_t begin = order_.position[visit.node];
    const bool is_home = homes_.any_in(triangle, begin, begin + order_.size[visit.node]);
    double overlap = 0;
    // Without spatial splits a box that a triangle belongs to holds all of it.
    if (!clip(visit.polygon, node)) return 0;
    if (!is_home) {
      const double area = visit.polygon.area();
      if (area == 0) return 0;
      overlap = area * (node.is_leaf() ? double(cost_.intersection) * node.count
                                       : double(cost_.traversal));
    }
    if (!node.is_leaf()) {
      push(visit, node.first + 1);
      push(visit, node.first);
    }
    return overlap;
  }

  void push(const Visit& parent, uint32_t child) {
    const Node& node = tree_.nodes[child];
    const auto outside = [&](double Vec3d::* axis, double low, double high) {
      bool below = true, above = true;
      for (uint32_t i = 0; i < parent.polygon.count; ++i) {
        below &= parent.polygon.corners[i].*axis < low;
        above &= parent.polygon.corners[i].*axis > high;
      }
      return below || above;
    };
    if (outside(&Vec3d::x, node.min.x, node.max.x) || outside(&Vec3d::y, node.min.y, node.max.y) ||
        outside(&Vec3d::z, node.min.z, node.max.z))
      return;
    stack_.push_back({child, parent.polygon});
  }

  const Bvh2& tree_;
  const MeshView& mesh_;
  const CostModel& cost_;
  const Order& order_;
  const Homes& homes_;
  std::vector<Visit> stack_;
};

// The areas of every `stride`-th triangle. The parts are numbered by position, so that the sum does
// not depend on the threads.
Descent::Areas sum_of(const Descent& descent, const Homes& homes, size_t stride, double progress_to,
                      Progress& progress) {
  const size_t count = (homes.triangles.size() + stride - 1) / stride;
  std::vector<Descent::Areas> sums((count + kTrianglesAtOnce - 1) / kTrianglesAtOnce);
  SharedProgress shared(progress, kStage, 0, progress_to, count, SharedProgress::OnCancel::kThrow);
  parallel_chunks(count, kTrianglesAtOnce, [&](size_t begin, size_t end) {
    Descent own = descent;
    Descent::Areas& sum = sums[begin / kTrianglesAtOnce];
    size_t reported = begin, visits = 0;
    for (size_t i = begin; i < end; ++i) {
      sum.add(own(homes.triangles[i * stride]));
      if (sum.visits < visits + kUnreportedVisits && i + 1 < end) continue;
      shared.add(i + 1 - reported);
      reported = i + 1;
      visits = sum.visits;
    }
  });
  Descent::Areas sum;
  for (const Descent::Areas& part : sums) sum.add(part);
  return sum;
}

// 1, or how many triangles each one that is measured stands for.
size_t stride_for(const Descent& descent, const Homes& homes, Progress& progress) {
  const size_t count = homes.triangles.size();
  const size_t trial = std::max<size_t>(1, count / kTrial);
  const double visits = double(sum_of(descent, homes, trial, 0, progress).visits) * double(trial);
  return static_cast<size_t>(
      std::ceil(visits / std::max(kMaxVisits, kMaxMeanVisits * double(count))));
}

}  // namespace

double end_point_overlap(const Bvh2& tree, const MeshView& mesh, const CostModel& cost,
                         const BuildOptions& options) {
  check_measure(cost);
  check_references(tree, mesh);
  if (tree.nodes.empty()) return 0;
  Descent::Areas sum;
  Progress progress(options);
  progress.report(0, kStage);
  with_threads(options.threads, [&] {
    const Order order = depth_first_order(tree);
    const Homes homes = homes_of(tree, order, mesh.triangles.size());
    const Descent descent(tree, mesh, cost, order, homes);
    const size_t stride = std::max<size_t>(1, stride_for(descent, homes, progress));
    sum = sum_of(descent, homes, stride, 1, progress);
  });
  progress.report(1, kStage);
  return sum.own > 0 ? sum.overlap / sum.own : 0;
}

}  // namespace umbel::bvh
