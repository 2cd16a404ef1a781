// Which collapses are legal: the link condition, no triangle flips, and every vertex at the
// position has one to become.
#pragma once

#include "lod/simplify/collapse/collapse_mesh.hpp"
#include "lod/simplify/collapse/link_condition.hpp"
#include "lod/simplify/collapse/wedge_map.hpp"

namespace umbel::lod {

class CollapseRules {
 public:
  CollapseRules(const CollapseMesh& mesh, LinkCondition& link, WedgeMap& wedges)
      : mesh_(mesh), link_(link), wedges_(wedges) {}

  /// Whether p, which the link condition has marked last, may move onto its neighbour. If so, the
  /// wedge map holds what its vertices become.
  bool allow(uint32_t p, uint32_t target) {
    return keep_surface(p, target) && keep_seams(p, target);
  }
  /// The first part of it: the link condition, and no triangle flips.
  bool keep_surface(uint32_t p, uint32_t target);
  /// The second part.
  bool keep_seams(uint32_t p, uint32_t target);
  /// Whether all triangles at p but those that `goes` (LinkEdge) says go keep their orientation.
  template <typename Goes>
  bool keeps_orientation_but_for(uint32_t p, uint32_t target, const Goes& goes) const;
  /// Why not: what the last call of `allow` stopped at.
  LimitingFactor limiting_factor() const { return limiting_factor_; }

 private:
  using LinkEdge = CollapseMesh::LinkEdge;

  // The cosine by which a triangle may turn in one collapse.
  static constexpr double kLeastCosine = 0.25;

  bool keeps_orientation(uint32_t p, uint32_t target) const;
  bool flips(const Vec3& from, const Vec3& to, const LinkEdge& e) const;

  const CollapseMesh& mesh_;
  LinkCondition& link_;
  WedgeMap& wedges_;
  LimitingFactor limiting_factor_ = LimitingFactor::kNone;
};

// Whether a triangle does, or becomes too thin to tell, as its corner moves.
inline bool CollapseRules::flips(const Vec3& from, const Vec3& to, const LinkEdge& e) const {
  const Vec3 n = mesh_.point(e.next), side = mesh_.point(e.prev) - n;
  const Vec3 before = cross(n - from, side), after = cross(n - to, side);
  const double turn = dot(before, after), size = double{dot(after, after)};
  const double old_size = double{dot(before, before)};
  if (!(size > 0.0)) return true;
  return old_size > 0.0 &&
         !(turn > 0.0 && turn * turn >= kLeastCosine * kLeastCosine * size * old_size);
}

template <typename Goes>
bool CollapseRules::keeps_orientation_but_for(uint32_t p, uint32_t target, const Goes& goes) const {
  if (mesh_.input().allow_flips) return true;
  const Vec3 from = mesh_.point(p), to = mesh_.point(target);
  const auto link = mesh_.link(p);
  return std::none_of(link.begin(), link.end(),
                      [&](const LinkEdge& e) { return !goes(e) && flips(from, to, e); });
}

}  // namespace umbel::lod
