// Scenes of millions of instances: a tree of them in the asset's file; only what a view
// shows is read. Every node has stand-ins, few instances in place of all below it, which are shown
// from afar. docs/instances.md says how to use it.
//
//   InstanceSelector selector(asset);
//   const InstanceStep step = selector.step(view, planes);  // what is there; reads nothing
//   selector.load(step.missing);                            // what is better; reads pages
//   for (const InstanceRun& run : step.runs)
//     for (const Instance& instance : selector.placements(run)) draw(instance);
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "umbel/asset.hpp"

namespace umbel {

/// Instances that a step shows: `placements` of a node's page, or of Asset::instances() where
/// `node` is kNone.
struct InstanceRun {
  uint32_t node;
  Range placements;
  /// Whether the coarsest clusters of their meshes are fine enough; else to_object(view, transform)
  /// says which are.
  bool is_coarsest;
  bool operator==(const InstanceRun&) const = default;
};

struct InstanceStep {
  std::vector<InstanceRun> runs;
  std::vector<uint32_t> missing;  ///< nodes whose pages are wanted, the most urgent first
  uint64_t shown = 0;             ///< placements in all runs
  uint64_t refined = 0;           ///< of these, in runs that are not `is_coarsest`
  uint64_t stand_ins = 0;         ///< of these, that stand for others
};

/// Selects from an asset's tree of instances, and keeps pages of it. Not for many threads at once.
class UMBEL_API InstanceSelector {
 public:
  /// Keeps at most about so many bytes of pages that the last step did not show, or all where it
  /// is 0. The asset must have a tree, and outlive this. Throws what reading its nodes throws.
  explicit InstanceSelector(const Asset& asset, size_t max_bytes = size_t{64} << 20);
  InstanceSelector(InstanceSelector&&) noexcept;
  InstanceSelector& operator=(InstanceSelector&&) noexcept;
  ~InstanceSelector();

  /// What a view of the scene, by error or camera, shows of what is loaded, without what lies
  /// outside the planes. Where a page is missing, the stand-ins stay.
  InstanceStep step(const lod::View& view, std::span<const Plane> planes = {});
  /// Reads pages, at most `most` of them.
  void load(std::span<const uint32_t> nodes, size_t most = ~size_t{0});
  /// A step that misses nothing: loads until all is there.
  InstanceStep settle(const lod::View& view, std::span<const Plane> planes = {});
  /// Until the next load.
  std::span<const Instance> placements(const InstanceRun& run) const;
  /// Of pages that are loaded.
  size_t bytes() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace umbel
