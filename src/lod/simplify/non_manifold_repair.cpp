#include "lod/simplify/non_manifold_repair.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/math.hpp"

namespace umbel::lod {
namespace {

// A new triangle's normal may differ by at most the angle of this cosine from that of the quad.
constexpr float kLeastCosine = 0.1f;

// One triangle at an edge, turned so that the edge runs from corner 0 to corner 1.
struct EdgeSide {
  size_t index;
  Triangle t;
};

class NonManifoldRepair {
 public:
  NonManifoldRepair(const RepairInput& input, std::vector<Triangle>& triangles)
      : input_(input), triangles_(triangles), first_(input.locked.size(), kNone) {
    for (size_t i = 0; i < triangles.size(); ++i)
      for (uint32_t k = 0; k < 3; ++k) link(i, k);
  }

  void repair_edge(uint32_t a, uint32_t b) {
    std::vector<EdgeSide> forward, backward;
    find_sides(a, b, forward, backward);
    if (remove_back_to_back(forward, backward)) return;
    if (flip_best(forward, backward)) return;
    split(forward, backward);
  }

  float deviation() const { return deviation_; }

 private:
  struct Flip {
    EdgeSide s, t;
    float cosine, deviation;
  };

  uint32_t position(uint32_t vertex) const { return input_.position_of[vertex]; }
  const Vec3& point(uint32_t vertex) const { return input_.positions[vertex]; }
  static bool is_gone(const Triangle& t) { return t[0] == t[1]; }

  // Every corner of a triangle is in the list of its position. Where a triangle has changed since,
  // its old entries stay, and are skipped because the corner is elsewhere.
  void link(size_t triangle, uint32_t corner) {
    const uint32_t p = position(triangles_[triangle][corner]);
    next_.push_back(first_[p]);
    corner_.push_back(static_cast<uint32_t>(3 * triangle + corner));
    first_[p] = static_cast<uint32_t>(next_.size() - 1);
  }

  void replace(size_t triangle, const Triangle& t) {
    const Triangle old = triangles_[triangle];
    triangles_[triangle] = t;
    for (uint32_t k = 0; k < 3; ++k)
      if (position(old[k]) != position(t[k])) link(triangle, k);
  }

  void add(const Triangle& t) {
    triangles_.push_back(t);
    for (uint32_t k = 0; k < 3; ++k) link(triangles_.size() - 1, k);
  }

  // Calls visit(triangle index, corner) for the triangles at a position, in descending order of
  // when they came there.
  template <typename Visit>
  void for_each_at(uint32_t p, const Visit& visit) const {
    for (uint32_t e = first_[p]; e != kNone; e = next_[e]) {
      const size_t i = corner_[e] / 3;
      const uint32_t k = corner_[e] % 3;
      if (!is_gone(triangles_[i]) && position(triangles_[i][k]) == p) visit(i, k);
    }
  }

  void find_sides(uint32_t a, uint32_t b, std::vector<EdgeSide>& forward,
                  std::vector<EdgeSide>& backward) {
    for_each_at(a, [&](size_t i, uint32_t k) {
      const Triangle& t = triangles_[i];
      const uint32_t v0 = t[k], v1 = t[(k + 1) % 3], v2 = t[(k + 2) % 3];
      if (position(v1) == b) forward.push_back({i, {v0, v1, v2}});
      if (position(v2) == b) backward.push_back({i, {v2, v0, v1}});
    });
    sort_unique(forward);
    sort_unique(backward);
  }

  // A corner that changed and changed back is in its list twice.
  static void sort_unique(std::vector<EdgeSide>& sides) {
    std::sort(sides.begin(), sides.end(),
              [](const EdgeSide& l, const EdgeSide& r) { return l.index < r.index; });
    const auto end =
        std::unique(sides.begin(), sides.end(),
                    [](const EdgeSide& l, const EdgeSide& r) { return l.index == r.index; });
    sides.erase(end, sides.end());
  }

  bool remove_back_to_back(std::span<const EdgeSide> forward, std::span<const EdgeSide> backward) {
    if (forward.size() + backward.size() <= 2) return false;
    for (const EdgeSide& f : forward)
      for (const EdgeSide& b : backward)
        if (position(f.t[2]) == position(b.t[2])) {
          triangles_[f.index] = triangles_[b.index] = {0, 0, 0};
          return true;
        }
    return false;
  }

  bool edge_exists(uint32_t p, uint32_t q) const {
    bool found = false;
    for_each_at(p, [&](size_t i, uint32_t k) {
      const Triangle& t = triangles_[i];
      found |= position(t[(k + 1) % 3]) == q || position(t[(k + 2) % 3]) == q;
    });
    return found;
  }

  // The quad a, y, b, x of triangles (a, b, x) and (b, a, y), cut along x y instead of a b.
  std::optional<Flip> judge(const EdgeSide& s, const EdgeSide& t) const {
    const auto [a, b, x] = s.t;
    const uint32_t y = t.t[2];
    // At an attribute seam the two triangles have vertices of their own.
    if (t.t[0] != b || t.t[1] != a) return {};
    const uint32_t px = position(x), py = position(y);
    if (px == py || (input_.locked[px] && input_.locked[py])) return {};
    const Vec3 normal = cross(point(b) - point(a), point(x) - point(a)) +
                        cross(point(a) - point(b), point(y) - point(b));
    const Vec3 first = cross(point(y) - point(a), point(x) - point(a));
    const Vec3 second = cross(point(b) - point(y), point(x) - point(y));
    const auto cosine = [&](const Vec3& n) {
      const float l = length(n) * length(normal);
      return l > 0.0f ? dot(n, normal) / l : -1.0f;
    };
    const float worst = std::min(cosine(first), cosine(second));
    if (!(worst >= kLeastCosine) || edge_exists(px, py)) return {};
    // Both surfaces of a skew quad agree on its boundary; they are farthest apart where the
    // diagonals pass each other.
    const Vec3 across = cross(point(b) - point(a), point(y) - point(x));
    const float l = length(across);
    const float apart = l > 0.0f ? std::fabs(dot(point(x) - point(a), across)) / l : 0.0f;
    return Flip{s, t, worst, apart};
  }

  bool flip_best(std::span<const EdgeSide> forward, std::span<const EdgeSide> backward) {
    std::optional<Flip> best;
    for (const EdgeSide& f : forward)
      for (const EdgeSide& b : backward) {
        const auto flip = judge(f, b);
        if (flip && (!best || flip->deviation < best->deviation)) best = flip;
      }
    if (!best) return false;
    const auto [a, b, x] = best->s.t;
    const uint32_t y = best->t.t[2];
    replace(best->s.index, {a, y, x});
    replace(best->t.index, {y, b, x});
    deviation_ = std::max(deviation_, best->deviation);
    return true;
  }

  // Splits the edge in one patch by the nearest spare vertex that flips no triangle.
  void split(std::span<const EdgeSide> forward, std::span<const EdgeSide> backward) {
    mark_used();
    for (const EdgeSide& f : forward)
      for (const EdgeSide& b : backward)
        if (b.t[0] == f.t[1] && b.t[1] == f.t[0] && split(f, b)) return;
  }

  bool split(const EdgeSide& s, const EdgeSide& t) {
    const auto [a, b, x] = s.t;
    const uint32_t y = t.t[2];
    const Vec3 middle = 0.5f * (point(a) + point(b));
    const Vec3 normal = cross(point(b) - point(a), point(x) - point(a)) +
                        cross(point(a) - point(b), point(y) - point(b));
    const auto faces_alike = [&](uint32_t i, uint32_t j, uint32_t v) {
      const Vec3 n = cross(point(j) - point(i), point(v) - point(i));
      return dot(n, normal) >= kLeastCosine * length(n) * length(normal) && dot(n, normal) > 0.0f;
    };
    uint32_t best = kNone;
    float nearest = dot(point(b) - point(a), point(b) - point(a));
    for (uint32_t v = 0; v < input_.spare.size(); ++v) {
      if (!input_.spare[v] || used_[v] || input_.patch_of[v] != input_.patch_of[a]) continue;
      const Vec3 d = point(v) - middle;
      if (dot(d, d) < nearest && faces_alike(a, y, v) && faces_alike(y, b, v) &&
          faces_alike(b, x, v) && faces_alike(x, a, v)) {
        best = v;
        nearest = dot(d, d);
      }
    }
    if (best == kNone) return false;
    replace(s.index, {a, y, best});
    replace(t.index, {y, b, best});
    add({b, x, best});
    add({x, a, best});
    deviation_ =
        std::max(deviation_, std::fabs(dot(point(best) - middle, normal)) / length(normal));
    used_[best] = 1;
    return true;
  }

  void mark_used() {
    if (!used_.empty()) return;
    used_.assign(input_.positions.size(), 0);
    for (const Triangle& t : triangles_)
      for (uint32_t v : t) used_[v] = 1;
  }

  const RepairInput& input_;
  std::vector<Triangle>& triangles_;
  std::vector<uint32_t> first_;          // of each position: index into next_ and corner_
  std::vector<uint32_t> next_, corner_;  // corner: 3 * triangle + k
  std::vector<uint8_t> used_;            // local vertices that triangles have
  float deviation_ = 0.0f;
};

}  // namespace

float repair_edges(const RepairInput& input, std::span<const std::pair<uint32_t, uint32_t>> faults,
                   std::vector<Triangle>& triangles) {
  NonManifoldRepair repair(input, triangles);
  for (const auto& [a, b] : faults) repair.repair_edge(a, b);
  std::erase_if(triangles, [](const Triangle& t) { return t[0] == t[1]; });
  return repair.deviation();
}

}  // namespace umbel::lod
