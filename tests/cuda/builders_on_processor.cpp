#include "builders.hpp"

namespace umbel::cuda {

bvh::Subtree run_on_processor(Builder builder, const std::vector<Aabb>& boxes,
                              std::vector<bvh::Merge>& merges) {
  CpuExec exec;
  return run_builder(builder, exec, boxes.data(), static_cast<uint32_t>(boxes.size()),
                     merges.data());
}

}  // namespace umbel::cuda
