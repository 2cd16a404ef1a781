// Parallel locally-ordered clustering on the processor. See the header. The top levels, above small
// clusters, may be built by SAH instead, which the paper does not do.
#include "bvh/build/ploc.hpp"

#include "base/polled_stage.hpp"
#include "bvh/build/builders.hpp"
#include "bvh/build/sah_top_levels.hpp"

namespace umbel::bvh {

Bvh2 build_ploc(Boxes boxes, const Config& config, BuildProgress& progress) {
  CpuExec exec;
  const auto count = static_cast<uint32_t>(boxes.size());
  BigVector<Merge> merges(count - 1);
  Subtree root{};
  {
    const PolledStage stage(progress, 0.05, "clustering");
    Ploc<CpuExec>().run(exec, boxes.data(), count, config.ploc_radius, merges.data(), &root);
  }
  if (config.ploc_sweep > 0) {
    const PolledStage stage(progress, 0.65, "sweeping clusters");
    root = sah_top_levels(merges, root, boxes, config.ploc_sweep, config);
  }
  progress.report(0.75, "laying out");
  return emit(merges, root, boxes);
}

}  // namespace umbel::bvh
