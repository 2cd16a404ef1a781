// Bisection by micro-clusters: the fastest way to clusters.
#pragma once

#include <functional>

#include "cluster/bisect/micro_clusters.hpp"
#include "cluster/bisect/segment.hpp"

namespace umbel::cluster {

/// What micro-clusters are too coarse for goes to exact(offset, count), possibly from several
/// threads at once, with its items in place. Calls done(count) for parts that are finished,
/// likewise. segment.first must be 0.
void bisect_micro_clusters(const Segment& segment, const Box4& bounds,
                           const std::function<void(uint32_t, uint32_t)>& exact,
                           const std::function<void(uint32_t)>& done);

}  // namespace umbel::cluster
