// Parallel locally-ordered clustering on the processor. See the header.
#include "bvh/ploc.hpp"

#include "bvh/builders.hpp"

namespace umbel::bvh {

Bvh2 build_ploc(Boxes boxes, const Config& config, Progress& progress) {
  progress.report(0.05, "clustering");
  CpuExec exec;
  const auto count = static_cast<uint32_t>(boxes.size());
  BigVector<Merge> merges(count - 1);
  const Subtree root =
      Ploc<CpuExec>().run(exec, boxes.data(), count, config.ploc_radius, merges.data());
  progress.report(0.7, "laying out");
  return emit(merges, root, boxes);
}

}  // namespace umbel::bvh
