// Clusters, and the seconds of the build alone, for `umbel bench clusters`.
#include "bind.hpp"
#include "timed.hpp"
#include "umbel/cluster.hpp"

namespace umbel::python {
namespace {

TimedClusters timed_clusters(const MeshArrays& mesh, const ClusterConfig& config, bool morton,
                             uint32_t threads) {
  double seconds = 0;
  Clusters clusters = run(nb::none(), threads, [&](const BuildOptions& options) {
    const MeshView view = mesh.view();
    validate(view, options);
    Clusters built;
    seconds = seconds_of(threads == 1, [&] {
      built = morton ? cluster_mesh_morton(view, config, options)
                     : cluster_mesh(view, config, 0.0f, options);
    });
    return built;
  });
  return nb::make_tuple(take<uint32_t>(std::move(clusters.items)),
                        take<uint32_t>(std::move(clusters.ranges)), seconds);
}

}  // namespace

void bind_timed_clusters(nb::module_& module) {
  module.def("timed_cluster_mesh", &timed_clusters, "mesh"_a, "config"_a, "morton"_a = false,
             "threads"_a = 1,
             "(items, ranges (k, 2), seconds): processor time of one thread, else wall time.");
}

}  // namespace umbel::python
