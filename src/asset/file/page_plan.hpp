// Which group is in which page, from what is known of groups without their bytes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "umbel/lod/types.hpp"

namespace umbel::asset {

/// A group that has been encoded, without its chunk.
struct GroupEntry {
  lod::Group group;
  uint32_t parents = 0;     ///< groups whose clusters were made from it
  uint32_t references = 0;  ///< groups that its clusters were made from
  uint32_t chunk_bytes = 0;
  uint32_t page = 0;  ///< set by plan_pages
};

struct GroupName {
  uint32_t mesh, group;
};

struct PagePlan {
  uint32_t page_bytes = 0;
  std::vector<GroupName> order;  ///< all groups as they are in the file
  std::vector<Range> pages;      ///< of `order`
};

/// Orders the groups of all meshes and fills pages with them. `page_bytes`: at most, where one
/// group does not take more; 0: as suits the size of the file.
PagePlan plan_pages(std::span<std::vector<GroupEntry>> meshes, uint32_t page_bytes);

}  // namespace umbel::asset
