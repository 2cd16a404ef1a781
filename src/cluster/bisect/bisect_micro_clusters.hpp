// Bisection by micro-clusters: the fastest way to clusters.
#pragma once

#include <functional>

#include "cluster/bisect/micro_clusters.hpp"
#include "cluster/bisect/split_constraints.hpp"

namespace umbel::cluster {

/// Rearranges items[0, count) into cluster order and sets first[i] to 1 where a cluster starts;
/// `first` must be 0 elsewhere. What micro-clusters are too coarse for goes to
/// exact(offset, count), possibly from several threads at once, with its items in place.
/// Calls done(count) for parts that are finished, likewise.
void bisect_micro_clusters(const Source& source, const SplitConstraints& constraints,
                           uint32_t* items, uint8_t* first, uint32_t count, const BoxRecord& bounds,
                           const std::function<void(uint32_t, uint32_t)>& exact,
                           const std::function<void(uint32_t)>& done);

}  // namespace umbel::cluster
