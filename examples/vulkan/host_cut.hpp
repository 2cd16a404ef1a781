// The cut of an instance, found on the host: what shaders/select.comp finds on the device, without
// a frustum, since rays go everywhere.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <umbel/umbel.hpp>
#include <vector>

namespace sample {

/// Calls `show` with each open group and those of its clusters that are in the cut, ascending.
/// `usable` says which groups can be shown: see PagePool.
void for_groups_of_cut(
    const umbel::lod::Tables& tables, std::span<const uint32_t> usable,
    const umbel::lod::View& view,
    const std::function<void(uint32_t group, std::span<const uint32_t> clusters)>& show);

}  // namespace sample
