// Recursive axis-aligned bisection for one worker thread at a time.
//
// `umbel::build_clusters` is the parallel form for large inputs. A Bisector gives exactly the same
// clusters on one thread and keeps its scratch memory from call to call, so that many small inputs
// can be clustered from inside a parallel loop without allocating:
//
//   thread_local cluster::Bisector bisector;     // or one a tbb::enumerable_thread_specific
//   bisector.build(input, config, clusters);     // `clusters` keeps its capacity as well
//
// It starts no parallel work and reports no progress. It checks the config and that boxes and
// centroids are finite, and throws as build_clusters does. It looks at no vertex array, so item
// vertices may be indices into an arbitrarily large mesh at no cost.
//
// The units of connection weights: one unit of weight that a split cuts costs as much as one more
// item in the box of the node that is split, if the split is even, and n^2 / (4 i (n - i)) times
// that if it leaves i of n items on the left (ratio cut).
#pragma once

#include <functional>
#include <memory>
#include <span>

#include "umbel/cluster.hpp"

namespace umbel::cluster {

struct Source;

/// Some clusters as soon as they are found, on the thread that did it and has just looked at their
/// items: `items` from `offset` on in the order of all, and for each whether a cluster begins
/// there.
using VisitClusters = std::function<void(uint32_t offset, std::span<const uint32_t> items,
                                         std::span<const uint8_t> first)>;

/// `umbel::cluster_mesh` of ranges of the triangles, each by itself. Empty segments: one of all.
Clusters cluster_triangles(const MeshView& mesh, std::span<const Range> segments,
                           const ClusterConfig& config, float shared_vertex_weight,
                           const BuildOptions& options, const VisitClusters& visit = nullptr);

class Bisector {
 public:
  Bisector();
  ~Bisector();
  Bisector(Bisector&&) noexcept;
  Bisector& operator=(Bisector&&) noexcept;

  /// Not thread-safe: one Bisector a thread. `out` is overwritten and keeps its capacity.
  void build(const ClusterInput& input, const ClusterConfig& config, Clusters& out);

  /// The triangles of a valid mesh, whose boxes are never stored. Empty segments: one of all.
  void build(const MeshView& mesh, std::span<const Range> segments, const ClusterConfig& config,
             Clusters& out);

 private:
  struct Scratch;
  void build(const Source& source, uint32_t count, std::span<const Range> segments,
             const ClusterConfig& config, Clusters& out);
  std::unique_ptr<Scratch> scratch_;
};

}  // namespace umbel::cluster
