// From a reference to its group.
#pragma once

#include <array>
#include <bit>
#include <string>

#include "base/bytes.hpp"
#include "umbel/asset.hpp"

namespace umbel::asset {

/// Whether a reference is what the group says of itself.
inline bool agrees(const GroupRef& reference, const lod::Group& group) {
  using Words = std::array<uint32_t, 4>;
  return std::bit_cast<uint32_t>(group.error) == std::bit_cast<uint32_t>(reference.error) &&
         std::bit_cast<Words>(group.sphere) == std::bit_cast<Words>(reference.sphere);
}

[[noreturn]] inline void disagree(const GroupRef& reference) {
  corrupt("a reference to group " + std::to_string(reference.group) +
          " is not what the group says of itself");
}

/// The index of the group in its page. Throws kCorrupt if it is not there, or not as the reference
/// says.
inline uint32_t follow(const GroupRef& reference, const AssetPage& page, uint32_t mesh) {
  for (uint32_t i = 0; i < page.groups.size(); ++i)
    if (page.groups[i].id == reference.group && page.groups[i].mesh == mesh) {
      if (!agrees(reference, page.groups[i].group)) disagree(reference);
      return i;
    }
  corrupt("group " + std::to_string(reference.group) + " is not in page " +
          std::to_string(page.index) + ", where a reference says it is");
}

}  // namespace umbel::asset
