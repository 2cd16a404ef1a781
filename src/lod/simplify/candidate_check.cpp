#include "lod/simplify/candidate_check.hpp"

#include <algorithm>
#include <utility>

#include "lod/simplify/non_manifold_repair.hpp"

namespace umbel::lod {

void CandidateCheck::reset(const Allowance& allow) {
  allow_ = allow;
  knows_topology_ = knows_spare_ = false;
}

bool CandidateCheck::is_alone() const {
  return allow_.new_positions &&
         std::none_of(group_.locked.begin(), group_.locked.end(), [](uint8_t l) { return l != 0; });
}

std::span<const PositionPair> CandidateCheck::faults(std::span<const Triangle> triangles,
                                                     bool by_direction) {
  result_positions_.clear();
  for (const Triangle& t : triangles) result_positions_.push_back(group_.positions_of(t));
  if (!std::exchange(knows_topology_, true))
    topology_.set_sub_mesh(group_.position_triangles(), group_.locked,
                           group_.non_manifold_component);
  const auto& ids = group_.position_ids;
  const auto may_add = [&](uint32_t a, uint32_t b) {
    return allow_.locked_edges && !(allow_.taken && allow_.taken->contains({ids[a], ids[b]}));
  };
  return topology_.violations(result_positions_, may_add, by_direction);
}

// As long as it helps: one repair may undo another.
std::span<const PositionPair> CandidateCheck::repair(const GroupComponents& components,
                                                     Candidate& candidate) {
  if (!std::exchange(knows_spare_, true)) find_spare_vertices();
  auto found = faults(candidate.triangles);
  for (size_t before = found.size() + 1; !found.empty() && found.size() < before;) {
    before = found.size();
    const float moved = repair_edges(
        {group_.position_of, group_.positions, group_.locked, components.with_materials(), spare_},
        found, candidate.triangles);
    candidate.error = std::max(candidate.error, moved / group_.source.scale);
    found = faults(candidate.triangles);
  }
  return found;
}

// Those that are alone at a position that may move.
void CandidateCheck::find_spare_vertices() {
  spare_.assign(group_.vertices.size(), 1);
  std::vector<uint32_t> first(group_.position_count(), kNone);
  for (uint32_t v = 0; v < group_.vertices.size(); ++v) {
    const uint32_t p = group_.position_of[v];
    if (first[p] != kNone) spare_[v] = spare_[first[p]] = 0;
    if (group_.locked[p] || group_.non_manifold_component[p] != kNone) spare_[v] = 0;
    first[p] = v;
  }
}

void CandidateCheck::accept_if_sound(Candidate& candidate) {
  if (!group_.mixes_materials(candidate.triangles) && faults(candidate.triangles).empty())
    accept(candidate);
}

void CandidateCheck::accept(Candidate& candidate) const {
  candidate.valid = true;
  candidate.locked_edges.assign(topology_.locked_edges().begin(), topology_.locked_edges().end());
}

}  // namespace umbel::lod
