// Exact SAH kd-trees in O(N log N) (Wald & Havran 2006), subtrees and the lists of large nodes in
// parallel (after Choi et al., "Parallel SAH k-D Tree Construction", 2010). Events are sorted and
// kept sorted as long as cells have many triangles; with a few thousand, boxes are faster.
#include "kdtree/builders.hpp"
#include "kdtree/event_set.hpp"

namespace umbel::kdtree {

void build_exact(const Input& input, const Config& /*config*/, Progress& progress, Branch& root) {
  progress.report(0.05, "sorting events");
  Grower<EventSet>(input.rule, progress)
      .build(EventSet(input.primitives, input.rule, input.triangles, input.boxes), input.bounds,
             input.allowance, root);
}

}  // namespace umbel::kdtree
