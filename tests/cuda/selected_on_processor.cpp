#include "lod/select/selection.hpp"
#include "selected.hpp"

namespace umbel::cuda {

Selected select_on_processor(const lod::Tables& tables, const lod::View& view,
                             std::span<const Transform> instances, const SelectionRoom& room,
                             const std::vector<uint32_t>& page_of_group,
                             const std::vector<uint8_t>& resident) {
  testing::Pages pages{page_of_group, resident};
  testing::Selection s = testing::selected({tables}, view, {}, instances, room, &pages);
  return {std::move(s.cuts), std::move(pages.states), std::move(s.requests),
          std::move(s.urgencies)};
}

}  // namespace umbel::cuda
