// Simplifies one group of clusters to fewer triangles with its border held fixed.
//
// A ladder: edge collapse that keeps attribute seams (collapse.hpp); meshoptimizer's edge collapse
// across them; removal of small separate components; merging of vertices by grid cell. Whatever
// comes back is checked edge by edge (topology.hpp), so that a group's result fits its neighbours
// in every cut; where it does not, the vertices around the fault are held and it is tried again.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/math.hpp"
#include "lod/dag/cluster_set.hpp"
#include "lod/dag/source.hpp"
#include "lod/dag/sub_mesh.hpp"
#include "lod/dag/topology.hpp"
#include "lod/simplify/collapse/collapse.hpp"
#include "lod/simplify/patches.hpp"

namespace umbel::lod {

struct Simplified {
  bool done = false;  ///< false: too little could be removed; the rest is unset
  AddedVertices added;
  float error = 0;            ///< how far this step moved the surface, in object space
  float attribute_error = 0;  ///< how much worse it made attributes, as a length
  float removed_radius = 0;   ///< half the diagonal of the largest component that it removed whole
  SimplifyMethod method = SimplifyMethod::kRegular;
  LimitingFactor limiting_factor = LimitingFactor::kNone;  ///< set even if not done
  std::vector<PositionPair> locked_edges;  ///< new edges between two locked vertices
};

/// What a simplification may do beyond the usual.
struct Allowance {
  bool locked_edges = true;  ///< new edges between locked vertices, which the caller checks
  bool last_resort = false;  ///< SimplifyMethod::kSloppy
  const LockedEdgeSet* taken = nullptr;  ///< edges that others have; the rest is for the caller
};

/// Keeps its scratch memory from group to group; one a thread.
class GroupSimplifier {
 public:
  GroupSimplifier(const Source& source, const Config& config, const Decimator& decimate);

  /// `locked` is by position id.
  Simplified simplify(const ClusterSet& set, std::span<const uint32_t> clusters,
                      std::span<const uint8_t> locked, Allowance allow);
  /// What the last group that could be simplified became. Vertices are those of the source, or
  /// kAddedVertex and more.
  SubMesh& left() { return left_; }

 private:
  struct Candidate {
    std::vector<Triangle> triangles;  // local vertices
    float error = 0, attribute_error = 0;
    float pruned = 0;  // radius of the largest part that went before the collapse
    SimplifyMethod method = SimplifyMethod::kRegular;
    std::vector<PositionPair> locked_edges;  // local positions
    bool valid = false;
    AddedVertices added;
    // New attributes of gathered vertices, attribute_weights_.size() each.
    std::vector<uint32_t> refitted;
    std::vector<float> refits;
  };

  struct Part {
    bool fixed = false;  // a neighbour touches it
    Aabb box;            // scaled
    float radius() const { return 0.5f * length(box.max - box.min); }
  };

  void gather(const ClusterSet& set, std::span<const uint32_t> clusters,
              std::span<const uint8_t> locked);
  void gather_attributes();
  void gather_further_attributes();
  void gather_skin();
  template <typename Value>
  void add_columns(float weight, uint32_t count, const Value& value);
  void prepare_repair();
  void find_spare_vertices();
  void find_components();
  float restore_components(size_t most_triangles, std::vector<Triangle>& triangles);
  uint32_t local_vertex(uint32_t vertex);
  void gather_positions(std::span<const uint8_t> locked);
  void drop_repeated_triangles();
  std::span<const Triangle> position_triangles();
  bool ask_caller(size_t target, size_t most, Candidate& candidate);
  Mesh gathered_mesh() const;
  void take_added(const DecimationResult& made, AddedVertices& added);
  void forget_added();
  uint32_t material(uint32_t local) const {
    const uint32_t v = vertices_[local];
    return v >= kAddedVertex ? added_materials_[v - kAddedVertex] : source_.material(v);
  }
  void find_rules();
  bool has_rules() const {
    return config_.seams != SeamRule::kAllow || config_.creases != SeamRule::kAllow;
  }
  bool protects_seams() const {
    return config_.seams == SeamRule::kProtect || config_.creases == SeamRule::kProtect;
  }
  CollapseInput collapse_input();
  Candidate collapse_regular(size_t target);
  Candidate collapse_regular(CollapseInput input, size_t target);
  std::vector<float> radii_of_parts();
  void refit_attributes(Candidate& candidate) const;
  void add_refitted(const Candidate& candidate, Simplified& result);
  void leave(Candidate& best, const Simplified& result);
  std::vector<double> growths(std::span<const Triangle> left);
  void keep_area(const Candidate& best, Simplified& result);
  void add_moved(uint32_t local, const Vec3& position, uint32_t& first_there, Simplified& result);
  Candidate collapse_non_manifold(size_t target, bool allow_flips);
  Candidate collapse(size_t target, unsigned options);
  bool suits_meshoptimizer() const;
  Candidate collapse_checked(size_t target, unsigned options, SimplifyMethod method);
  Candidate prune(const Candidate& from, size_t target);
  using PatchChange = float (*)(const PatchInput&, size_t, std::vector<Triangle>&);
  Candidate replace_patches(const Candidate& from, size_t target, PatchChange change);
  Candidate merge_cells(size_t target);
  std::span<const PositionPair> faults(std::span<const Triangle> triangles);
  std::span<const PositionPair> repair_faults(Candidate& candidate);
  void accept(Candidate& candidate);
  bool mixes_materials(std::span<const Triangle> triangles) const;
  void hold_around(uint32_t position);

  const Source& source_;
  const Config& config_;
  const Decimator& decimate_;
  std::vector<float> attribute_weights_;  // of this group's attributes
  SubMeshTopology topology_;
  EdgeCollapser collapser_;
  Allowance allow_;
  SubMesh left_;

  // The sub-mesh: vertices and positions are numbered from 0.
  std::vector<uint32_t> vertices_;  // local -> source vertex, or kAddedVertex and more
  std::vector<uint32_t> added_materials_;
  std::vector<uint32_t> position_of_;         // local vertex -> local position
  std::vector<Vec3> positions_;               // of local vertices, scaled
  std::vector<float> columns_;                // attributes, one after the other
  std::vector<float> attributes_;             // attribute_weights_.size() a local vertex
  std::vector<uint8_t> flags_;                // meshoptimizer's, of local vertices
  std::vector<uint8_t> locked_;               // of local positions
  std::vector<uint32_t> components_;          // of local positions
  bool has_non_manifold_ = false;             // any of components_
  std::vector<uint32_t> position_ids_;        // local position -> position id
  std::vector<uint8_t> spare_;                // local vertices that repair may bring back
  std::vector<uint32_t> component_of_;        // local position -> index into parts_
  std::vector<uint64_t> patch_of_;            // local vertex -> component and material
  std::vector<Part> parts_;                   // connected components
  bool has_parts_ = false;                    // parts_ are those of this group
  std::vector<Triangle> triangles_;           // local vertices
  std::vector<Triangle> position_triangles_;  // once asked for
  bool knows_topology_ = false;               // topology_ has this group
  std::vector<uint32_t> materials_;           // of local vertices; empty: one
  std::vector<SeamRule> rules_;               // of local positions; empty: allowed everywhere
  std::vector<uint8_t> held_;                 // local positions held for one more try
  std::vector<Triangle> result_positions_;
  // Open addressing, kNone empty.
  struct Numbered {
    uint32_t vertex, local;
  };
  std::vector<Numbered> vertex_table_;
  std::vector<uint32_t> position_table_, triangle_table_;
};

}  // namespace umbel::lod
