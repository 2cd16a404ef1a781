// Verification of what needs no geometry.
#pragma once

#include "lod/verify/findings.hpp"

namespace umbel::lod {

/// Whether every index in the tables leads to what it should. Only then may anything follow them.
bool verify_links(const Tables& tables, Findings& findings);

/// The same of tables whose clusters, so many, are elsewhere, but for what clusters say.
bool verify_links_but_clusters(const Tables& tables, size_t clusters, Findings& findings);
/// That `what`, a part of group `to`, may have been made from group `from`: that is finer, and no
/// root.
void verify_origin(const Tables& tables, uint32_t to, uint32_t from, const std::string& what,
                   Findings& findings);

/// That errors and spheres never shrink from a generating group to the groups of what it
/// generated, nor from a node of the hierarchy's children to the node.
void verify_monotone(const Tables& tables, Findings& findings);
/// The same from group `from` to group `to`, which has clusters that were made from it.
void verify_rise(const Tables& tables, uint32_t to, uint32_t from, Findings& findings);
/// The same of the hierarchy's nodes alone.
void verify_nodes(const Tables& tables, Findings& findings);

/// Whether sphere `outer` contains `inner`, but for rounding.
bool contains(const Sphere& outer, const Sphere& inner);

}  // namespace umbel::lod
