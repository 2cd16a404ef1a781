// Edge collapse by quadrics of a part of a surface (Garland & Heckbert 1997; attributes by Hoppe
// 1999), cheapest first.
//
// A vertex moves onto a neighbour and takes its own triangles along; no new vertex is made. A
// collapse is done only if it keeps the surface a surface (the link condition of Dey et al. 1999;
// where that fails, a loop around a handle or a neck may collapse: loop_collapse.hpp), flips no
// triangle, and has for every vertex at the position one to become. All vertices at a position move
// together: along a seam each becomes the one on its own side, across it the one that costs least,
// as far as the rule of the seam allows; materials never mix.
// What a collapse changes is evaluated again at once, so the order is greedy, to within the width
// of a bucket of the queue.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lod/dag/topology.hpp"
#include "lod/simplify/collapse/bucket_queue.hpp"
#include "lod/simplify/collapse/collapse_costs.hpp"
#include "lod/simplify/collapse/collapse_input.hpp"
#include "lod/simplify/collapse/collapse_mesh.hpp"
#include "lod/simplify/collapse/collapse_rules.hpp"
#include "lod/simplify/collapse/loop_collapse.hpp"
#include "lod/simplify/collapse/removable_components.hpp"

namespace umbel::lod {

/// The loop of the queue. Reusable; not thread-safe.
class EdgeCollapser {
 public:
  EdgeCollapser() = default;
  EdgeCollapser(const EdgeCollapser&) = delete;
  EdgeCollapser& operator=(const EdgeCollapser&) = delete;

  /// Collapses edges until at most `target` triangles are left or nothing can go, or until it
  /// pauses. The triangles that are left keep their order.
  void run(const CollapseInput& input, size_t target);
  bool is_paused() const { return is_paused_; }
  /// Goes on after a pause, with connected components that may be removed as a whole: of
  /// positions, their component; of components, how far one is from the rest at most, infinite for
  /// those that stay. Empty: none may.
  void resume(std::span<const uint32_t> component_of, std::span<const float> component_radii);

  const std::vector<Triangle>& triangles() const { return result_; }
  /// The largest root of mean squared distance of one collapse from the planes it stands for, in
  /// the units of the positions.
  float error() const;
  /// The same of the attributes, as a length.
  float attribute_error() const;
  double area() const { return costs_.area(); }  ///< before
  /// The largest radius of a component that was removed.
  float removed_radius() const { return removed_radius_; }
  /// Moves `values`, the attributes of a vertex that is left, to those that fit best to all that it
  /// stands for. False where that is not known to be better: it stands for itself alone, or others
  /// stand at its position, or the border does.
  bool refit(uint32_t vertex, std::span<float> values) const;
  /// What stops most of the positions that are left: of the moves of each, the one that fails at
  /// the last of the tests says why.
  LimitingFactor limiting_factor() const;
  /// Whether the error rose steeply towards the end, and topology kept most of what is left.
  bool was_forced() const;
  /// Whether it did what may leave a non-manifold edge, or no triangle of a component.
  bool has_moved_non_manifold() const { return has_moved_non_manifold_; }
  /// New edges between locked positions of different non-manifold components.
  const std::vector<PositionPair>& locked_edges() const { return locked_edges_; }

 private:
  using Choice = CollapseCosts::Choice;
  /// Of a choice: the best, the best of those that were legal, to be made again, or to collapse a
  /// loop.
  enum class State : uint8_t { kCurrent, kSecond, kStale, kLoop };
  /// A move that may take the place of an illegal one.
  struct Candidate {
    CollapseCosts::Move move;
    bool is_ranked = false;  ///< with attributes, and legal but for seams, or
    bool has_loop = false;   ///< only as a loop
  };

  void load(const CollapseInput& input);
  void fill_queue();
  void collapse_all();
  void process(uint32_t p);
  void enqueue_best(uint32_t p);
  void enqueue_best_legal(uint32_t p);
  Candidate& first_candidate();
  bool is_possible(uint32_t p, Candidate& candidate);
  void enqueue_postponed();
  bool was_ranked_too_low(uint32_t p);
  bool loses_attributes(uint32_t p, uint32_t target);
  void offer(uint32_t p, uint32_t target);
  void choose(uint32_t p, const Choice& choice);
  void collapse(uint32_t p, uint32_t target);
  void collapse_loop();
  void move_ring(uint32_t p, uint32_t target);
  void record_locked_edges(uint32_t target);
  void remove_component(uint32_t component);

  CollapseMesh mesh_;
  AttributeQuadrics attributes_;
  WedgeMap wedges_{mesh_, attributes_};
  CollapseCosts costs_{mesh_, attributes_, wedges_};
  LinkCondition link_{mesh_};
  CollapseRules rules_{mesh_, link_, wedges_};
  LoopCollapse loop_{mesh_, rules_, costs_, wedges_};
  RemovableComponents components_{mesh_};

  size_t target_ = 0;
  float cost_limit_ = 0.0f;       // as a squared distance
  float pause_above_ = 0.0f;      // as a squared distance
  float attribute_limit_ = 0.0f;  // as a squared distance
  bool is_unlimited_ = false, is_unlimited_to_the_end_ = false;
  bool may_pause_ = false, is_paused_ = false, has_moved_non_manifold_ = false;
  BucketQueue queue_;                             // of positions, then components
  std::vector<Choice> choices_;                   // of positions
  std::vector<State> states_;                     // of choices_
  std::vector<uint32_t> ranked_again_;            // of positions: with how many triangles left
  std::vector<Candidate> candidates_;             // scratch
  std::vector<uint32_t> postponed_;               // positions whose choice is over the limit
  std::vector<LimitingFactor> limiting_factors_;  // of positions that are not in the queue
  float removed_radius_ = 0.0f;
  float early_error_ = 0.0f;  // as a squared distance, at `limit_below`
  std::vector<PositionPair> locked_edges_;
  std::vector<Triangle> result_;
};

}  // namespace umbel::lod
