// What a selection with pages gives on the processor, compiled as a device's code cannot be.
#pragma once

#include <vector>

#include "umbel/cuda_select.hpp"

namespace umbel::cuda {

struct Selected {
  lod::InstanceCuts cuts;
  std::vector<uint32_t> states, requests;
  std::vector<float> urgencies;
};
Selected select_on_processor(const lod::Tables& tables, const lod::View& view,
                             std::span<const Transform> instances, const SelectionRoom& room,
                             const std::vector<uint32_t>& page_of_group,
                             const std::vector<uint8_t>& resident);

}  // namespace umbel::cuda
