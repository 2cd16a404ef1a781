#include "lod/simplify/collapse/collapse_mesh.hpp"

#include <cmath>
#include <numeric>

namespace umbel::lod {

void CollapseMesh::load(const CollapseInput& input) {
  input_ = input;
  has_wedges_ = input.locked.size() != input.position_of.size();
  triangles_.assign(input.triangles.begin(), input.triangles.end());
  live_ = triangles_.size();
  removed_.assign(live_, 0);
  load_points();
  if (has_wedges_) list_wedges();
  rings_.build(points_.size(), triangles_.size(), [&](size_t t) { return positions_of(t); });
  marks_.assign(points_.size(), 0);
  slots_.resize(points_.size());
  sides_.assign(points_.size(), 0);
  stamp_ = 0;
  kinds_.resize(points_.size());
  for (uint32_t p = 0; p < points_.size(); ++p) find_kind(p);
}

void CollapseMesh::load_points() {
  points_.resize(input_.locked.size());
  for (size_t v = 0; v < input_.position_of.size(); ++v) {
    const Vec3& p = input_.positions[v];
    points_[input_.position_of[v]] = {p.x, p.y, p.z, 0.0f};
  }
  Aabb box;
  for (const Point& p : points_) extend(box, Vec3{p.x, p.y, p.z});
  const Vec3 d = box.max - box.min;
  extent_ = std::max({d.x, d.y, d.z});
  const float unit = extent_ > 0.0f ? std::ldexp(1.0f, 13 - std::ilogb(extent_)) : 1.0f;
  area_unit_ = unit * unit;
}

void CollapseMesh::list_wedges() {
  const size_t count = input_.position_of.size();
  uses_.assign(count, 0);
  for (const Triangle& t : triangles_)
    for (uint32_t v : t) ++uses_[v];
  // Offsets are ends first, which filling from behind turns into beginnings.
  wedge_offsets_.assign(points_.size() + 1, 0);
  for (size_t v = 0; v < count; ++v) wedge_offsets_[input_.position_of[v]] += is_used(v);
  std::partial_sum(wedge_offsets_.begin(), wedge_offsets_.end(), wedge_offsets_.begin());
  wedges_.resize(wedge_offsets_.back());
  for (size_t v = count; v-- > 0;)
    if (is_used(v)) wedges_[--wedge_offsets_[input_.position_of[v]]] = static_cast<uint32_t>(v);
}

CollapseMesh::Kind CollapseMesh::kind_of(uint32_t p) {
  const auto edges = link(p);
  if (edges.empty() || input_.locked[p]) return Kind::kFixed;
  const Kind other = input_.move_non_manifold ? Kind::kNonManifold : Kind::kFixed;
  const uint32_t is_next = ++stamp_;
  for (uint32_t i = 0; i < edges.size(); ++i) {
    const uint32_t n = edges[i].next;
    if (marks_[n] == is_next) return other;
    marks_[n] = is_next;
    slots_[n] = i;
  }
  // The fan turns from each triangle to the one that begins where this one ends.
  uint32_t first = 0, ends = 0;
  for (const LinkEdge& e : edges) ends += marks_[e.prev] != is_next;
  if (ends > 1) return other;
  if (ends == 1) {
    // The one that none ends at, if no two end alike. If two do, no walk reaches all of them,
    // wherever it begins.
    size_t sum = edges.size() * (edges.size() - 1) / 2;
    for (const LinkEdge& e : edges)
      if (marks_[e.prev] == is_next) sum -= slots_[e.prev];
    if (sum < edges.size()) first = static_cast<uint32_t>(sum);
  }
  // Where two triangles end alike, the fan may close without the first.
  size_t steps = 1;
  for (uint32_t i = first; steps <= edges.size() && marks_[edges[i].prev] == is_next; ++steps) {
    i = slots_[edges[i].prev];
    if (i == first) break;
  }
  if (steps != edges.size()) return other;
  return ends == 0 ? Kind::kInterior : Kind::kBorder;
}

void CollapseMesh::remove_triangle(size_t t) {
  removed_[t] = 1;
  --live_;
  if (has_wedges_) forget_uses(t);
  for (uint32_t p : positions_of(t)) {
    rings_.clear(p);
    kinds_[p] = Kind::kFixed;
  }
}

// Nothing branches on whether a triangle is left, which no processor can predict.
void CollapseMesh::copy_triangles(std::vector<Triangle>& out) const {
  out.resize(triangles_.size());
  size_t count = 0;
  for (size_t t = 0; t < triangles_.size(); ++t) {
    out[count] = triangles_[t];
    count += removed_[t] == 0;
  }
  out.resize(count);
}

}  // namespace umbel::lod
