// The builders, one file each. All take boxes that build.cpp has checked and scaled (finite, not
// empty, at least one, coordinates within about 1e6) and give a tree with exact boxes, children
// after parents and the primitives of each leaf in ascending order; build.cpp runs the passes that
// the configuration asks for afterwards. A builder that makes one leaf a primitive leaves larger
// leaves to collapse_leaves.
#pragma once

#include <span>

#include "base/progress.hpp"
#include "bvh/tree/merge_tree.hpp"

namespace umbel::bvh {

/// What a builder tells the caller.
class BuildProgress : public Progress {
 public:
  BuildProgress(const BuildOptions& options, const StageObserver& observer)
      : Progress(options), observer_(observer) {}

  void stage_took(std::string_view stage, double seconds) const {
    if (observer_) observer_(stage, seconds);
  }

 private:
  const StageObserver& observer_;
};

Bvh2 build_sweep(Boxes boxes, const Config& config, BuildProgress& progress);
Bvh2 build_binned(Boxes boxes, const Config& config, BuildProgress& progress);
Bvh2 build_spatial(const MeshView& mesh, Boxes boxes, const Config& config,
                   BuildProgress& progress);
Bvh2 build_lbvh(Boxes boxes, const Config& config, BuildProgress& progress);
Bvh2 build_hlbvh(Boxes boxes, const Config& config, BuildProgress& progress);
Bvh2 build_kmeans(Boxes boxes, const Config& config, BuildProgress& progress);
Bvh2 build_agglomerative(Boxes boxes, const Config& config, BuildProgress& progress);
Bvh2 build_aac(Boxes boxes, const Config& config, BuildProgress& progress);
Bvh2 build_ploc(Boxes boxes, const Config& config, BuildProgress& progress);
Bvh2 build_atrbvh(Boxes boxes, const Config& config, BuildProgress& progress);
Bvh2 build_insertion(Boxes boxes, const Config& config, BuildProgress& progress);

/// The full sweep over boxes that stand for `counts` primitives each: a tree with one box a leaf.
Bvh2 sweep_clusters(Boxes boxes, std::span<const uint32_t> counts, const Config& config);

}  // namespace umbel::bvh
