// The way from one tier to the next: which unit every exit cluster goes to, and what must be known
// there.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "scale/exits.hpp"
#include "scale/partition.hpp"
#include "scale/route.hpp"

namespace umbel::scale {

/// Where a cluster lies: the middle of its box.
Vec3 middle(const Aabb& box);

/// Cuts what one unit has left into slices, one for each unit of the next tier that gets any or has
/// mail, and writes them to one file. `shared`: triangles in leaves that several units share, of
/// all units before.
void route_exits(const Exits& exits, const Partition& partition, uint64_t capacity,
                 SharedLeafCounts shared, const std::filesystem::path& path);

/// Edges that are not manifold, among those that no unit of the first tier could decide: of all
/// their sides together. In an order that does not depend on that of the units.
std::vector<PositionEdge> non_manifold_edges(std::vector<PositionEdge> undecided);

}  // namespace umbel::scale
