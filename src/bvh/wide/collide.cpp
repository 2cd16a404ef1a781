// Collision detection by two hierarchies at once: pairs of nodes whose boxes meet are replaced by
// the pairs of their children, until both are leaves (Gottschalk, Lin & Manocha, "OBBTree: A
// Hierarchical Structure for Rapid Interference Detection", 1996, with axis-aligned boxes). The
// first pairs are taken breadth-first, until there are enough for all cores; the rest of each is a
// task of its own. Nothing that is found depends on the number of threads.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <utility>

#include "base/parallel.hpp"
#include "base/shared_progress.hpp"
#include "bvh/wide/triangle_bvh_data.hpp"
#include "bvh/wide/widen.hpp"
#include "query/overlap.hpp"
#include "query/triangle_pair.hpp"
#include "umbel/collision.hpp"

namespace umbel {
namespace {

using TriangleCorners = std::array<Vec3, 3>;

constexpr size_t kTasks = 512;

/// The map from the second mesh to the first.
class Placement {
 public:
  Placement(const std::array<double, 12>& rows, const Aabb& bounds) : rows_(rows) {
    const std::array<double, 12> identity = CollisionOptions{}.second_to_first;
    if (!std::all_of(rows.begin(), rows.end(), [](double x) { return std::isfinite(x); }))
      throw Error(ErrorCode::kInvalidArgument,
                  "the transform second_to_first has a value that is not finite");
    is_identity_ = rows == identity;
    if (is_identity_ || is_empty(bounds)) return;
    const Aabb all = box(bounds);
    const Vec3 furthest = max(all.max, all.min * -1.0f);
    const float most = std::max({furthest.x, furthest.y, furthest.z});
    if (!(most < std::numeric_limits<float>::max()))
      throw Error(
          ErrorCode::kInvalidArgument,
          "the transform second_to_first brings the second mesh out of the range of floats");
    // Rounding moves a corner by half a unit in the last place, and with it the part of a triangle
    // that a box holds.
    margin_ = most * 0x1p-22f;
  }

  Vec3 point(const Vec3& p) const {
    if (is_identity_) return p;
    return {static_cast<float>(mapped(0, p)), static_cast<float>(mapped(1, p)),
            static_cast<float>(mapped(2, p))};
  }
  TriangleCorners corners(const LeafTriangle& t) const {
    return {point(t.p0), point(t.p1), point(t.p2)};
  }

  /// Holds the maps of all points in a box.
  Aabb box(const Aabb& b) const {
    if (is_identity_) return b;
    Aabb result;
    for (uint32_t axis = 0; axis < 3; ++axis) {
      const double* const r = rows_.data() + 4 * axis;
      const double low[3] = {b.min.x, b.min.y, b.min.z}, high[3] = {b.max.x, b.max.y, b.max.z};
      double least = r[3], most = r[3], size = std::fabs(r[3]);
      for (uint32_t k = 0; k < 3; ++k) {
        least += std::min(r[k] * low[k], r[k] * high[k]);
        most += std::max(r[k] * low[k], r[k] * high[k]);
        size += std::max(std::fabs(r[k] * low[k]), std::fabs(r[k] * high[k]));
      }
      const double error = size * 0x1p-24 + double(margin_);
      component(result.min, axis) = static_cast<float>(least - error);
      component(result.max, axis) = static_cast<float>(most + error);
    }
    return result;
  }

 private:
  double mapped(uint32_t axis, const Vec3& p) const {
    const double* const r = rows_.data() + 4 * axis;
    return r[0] * p.x + r[1] * p.y + r[2] * p.z + r[3];
  }

  const std::array<double, 12>& rows_;
  bool is_identity_ = false;
  float margin_ = 0;
};

/// A node or a leaf, and its box in the first mesh's space.
struct BoxedNode {
  uint32_t link;
  Aabb box;
};
struct PartPair {
  BoxedNode first, second;
  bool is_leaves() const { return BvhData::is_leaf(first.link) && BvhData::is_leaf(second.link); }
};

/// The children of a part, or a leaf itself.
struct Parts {
  BoxedNode at[kMaxWidth];
  uint32_t count = 0;

  template <typename ToBox>
  Parts(const BvhData& tree, const BoxedNode& part, const ToBox& to_box) {
    if (BvhData::is_leaf(part.link)) {
      at[count++] = part;
      return;
    }
    const uint32_t node = tree.linked_node(part.link);
    for (uint32_t slot = 0; slot < tree.width; ++slot) {
      const uint32_t link = tree.link(node, slot);
      if (link != kNoChild) at[count++] = {link, to_box(tree.box(node, slot))};
    }
  }
};

class Collider {
 public:
  Collider(const BvhData& first, const BvhData& second, const CollisionOptions& options)
      : first_(first), second_(second), placement_(options.second_to_first, second.bounds) {}

  /// All pairs, sorted.
  std::vector<TrianglePair> pairs(const BuildOptions& options) {
    Progress progress(options);
    std::vector<TrianglePair> all;
    if (is_nothing()) return all;
    const std::vector<PartPair> tasks = first_pairs();
    std::vector<std::vector<TrianglePair>> found(tasks.size());
    SharedProgress shared(progress, kStage, 0, 1, tasks.size());
    parallel_for(tasks.size(), 1, [&](size_t i) {
      std::vector<PartPair> waiting{tasks[i]};
      for (uint32_t steps = 1; !waiting.empty() && !shared.is_stopped(); ++steps) {
        step(waiting, found[i]);
        if (steps % kStepsBetweenReports == 0) shared.add(0);
      }
      shared.add(1);
    });
    shared.finish();
    for (auto& part : found) {
      all.insert(all.end(), part.begin(), part.end());
      std::vector<TrianglePair>().swap(part);
    }
    // Spatial splits give a triangle more than one leaf.
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    return all;
  }

  /// Whether there are any. Most meshes that collide do so soon, and most that do not are told
  /// apart soon: other threads are called only after some thousand steps.
  bool any(const BuildOptions& options) {
    Progress progress(options);
    SharedProgress shared(progress, kStage, 0, 0, 1);
    if (is_nothing()) return false;
    std::vector<PartPair> waiting{root()};
    std::vector<TrianglePair> found;
    for (uint32_t steps = 0; steps < kStepsAlone && !waiting.empty(); ++steps) {
      step(waiting, found);
      if (!found.empty()) return true;
    }
    std::atomic<bool> is_found{false};
    if (waiting.empty()) return false;
    with_threads(options.threads, [&] {
      parallel_for(waiting.size(), 1, [&](size_t i) {
        std::vector<PartPair> below{waiting[i]};
        std::vector<TrianglePair> here;
        const auto goes_on = [&] {
          return !below.empty() && here.empty() && !is_found.load(std::memory_order_relaxed) &&
                 !shared.is_stopped();
        };
        for (uint32_t steps = 1; goes_on(); ++steps) {
          step(below, here);
          if (steps % kStepsBetweenReports == 0) shared.add(0);
        }
        if (!here.empty()) is_found.store(true, std::memory_order_relaxed);
      });
    });
    shared.finish();
    return is_found;
  }

 private:
  static constexpr uint32_t kStepsAlone = 4096, kStepsBetweenReports = 1024;
  static constexpr const char* kStage = "colliding";

  bool is_nothing() const { return first_.reference_count == 0 || second_.reference_count == 0; }
  PartPair root() const { return {{0, first_.bounds}, {0, placement_.box(second_.bounds)}}; }

  /// Calls visit(pair) for the pairs of parts of both that meet.
  template <typename Visit>
  void expand(const PartPair& pair, const Visit& visit) const {
    const Parts first(first_, pair.first, [](const Aabb& box) { return box; });
    const Parts second(second_, pair.second, [&](const Aabb& box) { return placement_.box(box); });
    for (uint32_t i = 0; i < first.count; ++i) {
      if (!overlap::meet(first.at[i].box, pair.second.box)) continue;
      for (uint32_t k = 0; k < second.count; ++k)
        if (overlap::meet(first.at[i].box, second.at[k].box))
          visit(PartPair{first.at[i], second.at[k]});
    }
  }

  std::vector<PartPair> first_pairs() const {
    std::vector<PartPair> pairs{root()};
    for (bool has_grown = true; has_grown && pairs.size() < kTasks;) {
      has_grown = false;
      std::vector<PartPair> next;
      for (const PartPair& pair : pairs) {
        if (pair.is_leaves()) {
          next.push_back(pair);
          continue;
        }
        has_grown = true;
        expand(pair, [&](const PartPair& below) { next.push_back(below); });
      }
      pairs.swap(next);
    }
    return pairs;
  }

  /// Takes the last pair, and puts those that it is made of in its place.
  void step(std::vector<PartPair>& waiting, std::vector<TrianglePair>& found) const {
    const PartPair pair = waiting.back();
    waiting.pop_back();
    if (pair.is_leaves())
      test_leaves(pair, found);
    else
      expand(pair, [&](const PartPair& below) { waiting.push_back(below); });
  }

  struct PlacedTriangle {
    TriangleCorners corners;
    Aabb box;
    uint32_t primitive;
  };
  static PlacedTriangle placed(const TriangleCorners& corners, uint32_t primitive) {
    PlacedTriangle result{corners, {}, primitive};
    for (const Vec3& corner : corners) extend(result.box, corner);
    return result;
  }

  void test_leaves(const PartPair& pair, std::vector<TrianglePair>& found) const {
    PlacedTriangle seconds[kMaxLeafTriangles];
    uint32_t count = 0;
    second_.for_each_triangle(pair.second.link, [&](const LeafTriangle& t) {
      const PlacedTriangle triangle = placed(placement_.corners(t), t.primitive);
      if (overlap::meet(triangle.box, pair.first.box)) seconds[count++] = triangle;
    });
    if (count == 0) return;
    first_.for_each_triangle(pair.first.link, [&](const LeafTriangle& t) {
      const PlacedTriangle first = placed({t.p0, t.p1, t.p2}, t.primitive);
      for (uint32_t k = 0; k < count; ++k)
        if (overlap::meet(first.box, seconds[k].box) &&
            triangles_meet(first.corners, seconds[k].corners))
          found.push_back({first.primitive, seconds[k].primitive});
    });
  }

  const BvhData& first_;
  const BvhData& second_;
  Placement placement_;
};

}  // namespace

struct BvhAccess {
  static const BvhData& data(const Bvh& bvh) { return bvh.data(); }
};

std::vector<TrianglePair> collide(const Bvh& first, const Bvh& second,
                                  const CollisionOptions& options) {
  Collider collider(BvhAccess::data(first), BvhAccess::data(second), options);
  std::vector<TrianglePair> pairs;
  const BuildOptions how{options.progress, options.threads};
  with_threads(how.threads, [&] { pairs = collider.pairs(how); });
  return pairs;
}

bool collides(const Bvh& first, const Bvh& second, const CollisionOptions& options) {
  return Collider(BvhAccess::data(first), BvhAccess::data(second), options)
      .any({options.progress, options.threads});
}

}  // namespace umbel
